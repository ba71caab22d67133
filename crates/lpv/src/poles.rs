//! Frequency responses in, poles at every position out: order and integrators chosen where they are not given.

mod candidates;
mod contest;
mod direct;
mod distortion;
mod friction;
mod integrators;
mod search;

use crate::PipelineError;
use crate::config::{IdentifyConfig, RigidBody};
use crate::rigid::RigidEvidence;
pub use candidates::Undetermined;
use friction::evidence;
use lpv_core::{Discrete, FrfEstimate};
use pole_fit::{NumeratorDegree, PoleFit, PoleFitSettings, Scan, Weighting};
pub(crate) use search::upper_half;
use search::{FLEXIBLE_ORDERS, Search, kind, missed, over_noise};

/// The poles at every position.
#[derive(Debug, Clone)]
pub struct PoleStage {
    /// Order of the common denominator, integrators included.
    pub order: usize,
    /// Poles held at z = 1.
    pub integrators: usize,
    /// Whether friction to ground makes slow poles beside them.
    pub slow_poles: bool,
    /// Relative error beside the noise in the weights, where noise does not explain what is left; else zero.
    pub relative_error: f64,
    /// Whether the fits have a direct term.
    pub direct: bool,
    /// Lines on either side over which the covariance is averaged as a weight.
    pub smoothing: usize,
    /// One fit a position.
    pub fits: Vec<PoleFit>,
    /// The scan that chose the order, where it was not given, at the middle position.
    pub scan: Option<Scan>,
    /// What the lowest lines show of the rigid body, where several positions and as many inputs as outputs tell.
    pub rigid: Option<RigidEvidence>,
    /// What the gain of the rigid body is taken for, where that was given.
    pub rigid_body: Option<RigidBody>,
    /// Other fits of one position that describe its lines about as shortly, or lines that chance might have given.
    pub candidates: Vec<PoleFit>,
    /// Why this order and these integrators.
    pub reasons: Vec<String>,
}

/// What the series expansion (13) has for a rigid body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigidTerms {
    /// Nothing.
    Absent,
    /// Two integrators in every diagonal channel, their gains the same at all positions: as in the paper.
    Constant,
    /// Integrators in every channel, with gains that depend on p: single ones, double ones, or both.
    Varying {
        /// `1 / (z - 1)`.
        single: bool,
        /// phi_R.
        double: bool,
    },
}

impl PoleStage {
    /// The rigid body that the integrators and the lowest lines ask for, or that was given.
    pub fn rigid_terms(&self) -> RigidTerms {
        let varies = match self.rigid_body {
            Some(given) => given == RigidBody::Coupled,
            None => self.rigid.as_ref().is_some_and(RigidEvidence::gain_varies),
        };
        match (self.integrators, self.slow_poles) {
            (0, _) => RigidTerms::Absent,
            (2, false) if !varies => RigidTerms::Constant,
            (count, slow) => RigidTerms::Varying {
                single: count == 1 || slow,
                double: count > 1,
            },
        }
    }
}

/// Common-denominator fits at all positions.
///
/// # Errors
/// [`PipelineError::Poles`] with the position.
pub fn fit_poles(
    estimates: &[FrfEstimate],
    clock: Discrete,
    config: &IdentifyConfig,
) -> Result<PoleStage, PipelineError> {
    let mut reasons = Vec::new();
    let middle = estimates
        .get(estimates.len() / 2)
        .ok_or(PipelineError::Structure {
            problem: "no frequency response was given; estimate at least one position first",
        })?;
    let mut one_by_slope = false;
    let is_square = middle.frf().outputs() == middle.frf().inputs();
    let given = match config.rigid_body.filter(|_| estimates.len() > 1) {
        Some(_) if !is_square => {
            return Err(PipelineError::Structure {
                problem: "`rigid-body` is for machines with as many inputs as outputs; leave it out",
            });
        }
        Some(RigidBody::Decoupled) if config.integrators.is_some_and(|count| count != 2) => {
            return Err(PipelineError::Structure {
                problem: "`rigid-body = \"decoupled\"` has two integrators an axis; leave `integrators` out, or set it to 2",
            });
        }
        Some(RigidBody::Decoupled) => Some(2),
        _ => config.integrators,
    };
    let one = estimates.len() == 1;
    let (slope, by_slope) = integrators_from_slope(middle);
    let count = given.unwrap_or_else(|| {
        // A slope of one may be that of friction, which is looked for below, or of a lag.
        let count = match by_slope {
            1 if !one => {
                one_by_slope = true;
                0
            }
            more => more.min(2),
        };
        reasons.push(format!(
            "{}: |F| falls with the power {slope:.2} of frequency at the lowest lines",
            lpv_core::counted(count, "integrator")
        ));
        count
    });
    // A covariance from few periods scatters: averaged over neighbouring lines it becomes a usable weight.
    let freedom = estimates
        .iter()
        .map(FrfEstimate::degrees_of_freedom)
        .fold(f64::INFINITY, f64::min);
    let (outputs, inputs) = (middle.frf().outputs(), middle.frf().inputs());
    let enough = ENOUGH_FREEDOM.max(FREEDOM_OF_AN_OUTPUT * outputs as f64);
    let smoothing = if freedom < ENOUGH_FREEDOM.max(outputs as f64 + 2.0) {
        (enough / freedom.max(1.0)).ceil() as usize
    } else {
        0
    };
    if smoothing > 0 {
        reasons.push(format!(
            "the FRF covariance has {freedom:.0} degrees of freedom: averaged over {smoothing} lines on either side as a weight"
        ));
    }
    let mut search = Search {
        slack: 1.0,
        estimates,
        clock,
        order: config.order,
        settings: PoleFitSettings {
            integrators: kind(count),
            numerator: NumeratorDegree::StrictlyProper,
            smoothing_lines: smoothing,
            weighting: if outputs * inputs > COUPLED_CHANNELS {
                Weighting::DiagonalCovariance
            } else {
                Weighting::Covariance
            },
            ..PoleFitSettings::new(count + FLEXIBLE_ORDERS[0])
        },
        integrators: count,
        slow_poles: given == Some(1),
        small: false,
        matched: true,
        counted: None,
        candidates: Vec::new(),
    };
    let counted = given.is_none() && search.count_states();
    if counted && search.integrators != count {
        reasons.push(format!(
            "{} instead: they describe the response most shortly",
            lpv_core::counted(search.integrators, "integrator")
        ));
    }
    let mut before = reasons.len();
    let mut found = search.run(&mut reasons)?;
    let settled = counted && !missed(&found.0) && !few_equations(&found.0);
    if one
        && given.is_none()
        && !settled
        && let Some(other) = search.other_integrators(slope, &found.0, &[2, 1, 0], &mut reasons)
    {
        found = other;
    }
    let mut rigid = None;
    if !one && (count > 0 || one_by_slope) {
        rigid = evidence(estimates, clock, &found.0);
        let seen = rigid.as_ref().is_some_and(RigidEvidence::has_friction);
        if (seen || one_by_slope || missed(&found.0)) && given.is_none() {
            match search.with_friction(&found.0)? {
                Some(other) => {
                    reasons.truncate(before);
                    reasons.push(format!(
                        "{} instead, and slow poles: there is friction to ground",
                        lpv_core::counted(search.integrators, "integrator")
                    ));
                    before = reasons.len();
                    reasons.extend(other.reasons);
                    (found, rigid) = (other.fits, Some(other.rigid));
                }
                // What a spring or a lag bends at the lowest lines is neither mass nor friction.
                None if count == 0 => rigid = None,
                None => {}
            }
        }
    }
    let unseen = rigid.is_none();
    let missing = missed(&found.0);
    if !one && given.is_none() && (missing || unseen) {
        // What the lowest lines tell of the rigid body leaves friction alone in doubt.
        let counts: &[usize] = if missing && unseen { &[2, 1, 0] } else { &[1] };
        if let Some(other) = search.other_integrators(slope, &found.0, counts, &mut reasons) {
            found = other;
            rigid = (search.integrators > 0)
                .then(|| evidence(estimates, clock, &found.0))
                .flatten();
        }
    }
    let misfit = over_noise(&found.0);
    if misfit > DISTORTED {
        // Not noise but distortion or unmodelled dynamics is left: lines with little noise must not outweigh it.
        let error = found.0.iter().map(|f| f.account.relative_error_rms);
        let mut floor = error.fold(0.0, f64::max).clamp(LEAST_FLOOR, 0.1);
        reasons.truncate(before);
        search.settings.relative_floor = floor;
        search.counted = None;
        search.candidates.clear();
        search.slack = DISTORTION_SLACK;
        // At one position distortion would buy a lower cost with poles outside; at several, other minima at each.
        search.settings.keep_stable = one;
        search.settings.several_starts = one;
        // The first fit may have missed more than distortion: its error is then too large in the weights.
        for _ in 0..if one { MOST_FLOORS } else { 0 } {
            let over = search.least_over();
            if over > FLOOR_TOO_LARGE || floor <= LEAST_FLOOR {
                break;
            }
            floor = (floor * over.sqrt()).max(LEAST_FLOOR);
            search.settings.relative_floor = floor;
        }
        search.candidates.clear();
        let digits = if floor < 0.01 { 3 } else { 1 };
        let left = match estimates.iter().any(FrfEstimate::covariance_is_assumed) {
            true => "more is left than the assumed error".to_owned(),
            false => format!("what is left is {misfit:.0} times the noise"),
        };
        reasons.push(format!(
            "{left}: fitted again with a relative error of {:.digits$} % in the weights",
            100.0 * floor
        ));
        found = if one {
            search.distorted(slope, given, &mut reasons)?
        } else {
            search.run(&mut reasons)?
        };
    }
    if given.is_none()
        && let [taken] = found.0.as_slice()
        && let Some(other) = search.contest(taken)
    {
        reasons.push(format!(
            "{}, order {} instead: fits that begin at the poles of each other describe so few lines more shortly",
            lpv_core::counted(search.integrators, "integrator"),
            other.account.order
        ));
        found.0 = vec![other];
    }
    let (fits, scan) = found;
    let order = fits[0].account.order;
    let candidates = match (one, given, config.order) {
        (true, None, None) => [search.about_as_short(&fits[0]), search.resampled(&fits[0])].concat(),
        _ => Vec::new(),
    };
    Ok(PoleStage {
        order,
        integrators: search.integrators,
        slow_poles: search.slow_poles && rigid.as_ref().is_some_and(RigidEvidence::has_friction),
        relative_error: if misfit > DISTORTED {
            search.settings.relative_floor
        } else {
            0.0
        },
        smoothing,
        direct: search.settings.numerator == NumeratorDegree::Proper,
        fits,
        scan,
        rigid,
        rigid_body: config.rigid_body,
        candidates,
        reasons,
    })
}

/// Equations for each unknown below which chance may count states.
const ENOUGH_EQUATIONS: usize = 5;

fn few_equations(fits: &[PoleFit]) -> bool {
    let few = |f: &PoleFit| f.account.equations < ENOUGH_EQUATIONS * f.account.unknowns;
    fits.iter().any(few)
}

/// Complex degrees of freedom of a covariance from which on it serves as a weight line by line.
const ENOUGH_FREEDOM: f64 = 12.0;

/// The same for each output: the inverse of a covariance scatters with the number of its rows.
const FREEDOM_OF_AN_OUTPUT: f64 = 4.0;

/// Channels beyond which the poles are found with the variances alone: the numerators of all channels are otherwise one system.
const COUPLED_CHANNELS: usize = 16;

/// Cost over its expectation beyond which noise does not explain the residual.
const DISTORTED: f64 = 10.0;

/// Least relative error in the weights.
const LEAST_FLOOR: f64 = 1e-9;

/// Cost over its expectation below which the relative error in the weights is many times what is left.
const FLOOR_TOO_LARGE: f64 = 0.05;

/// Fits at most until it is.
const MOST_FLOORS: usize = 4;

/// Distortion is not to be bought order after order: the smallest order within this factor of the least cost is taken.
const DISTORTION_SLACK: f64 = 1.5;

/// Power with which the diagonal falls over the lowest lines, and the number of integrators that it means.
pub(crate) fn integrators_from_slope(estimate: &FrfEstimate) -> (f64, usize) {
    let frf = estimate.frf();
    let lowest = frf.len().min(8).max(2.min(frf.len()));
    let first = usize::from(frf.frequencies_hz().first() == Some(&0.0));
    if frf.len() < first + 2 {
        return (0.0, 0);
    }
    let channels = frf.outputs().min(frf.inputs());
    let size = |k: usize| {
        (0..channels)
            .map(|i| frf.line(k)[(i, i)].norm())
            .fold(0.0, f64::max)
            .ln()
    };
    // Least-squares slope of ln |F| over ln f.
    let points: Vec<(f64, f64)> = (first..(first + lowest).min(frf.len()))
        .map(|k| (frf.frequencies_hz()[k].ln(), size(k)))
        .collect();
    let n = points.len() as f64;
    let (mx, my) = (
        points.iter().map(|p| p.0).sum::<f64>() / n,
        points.iter().map(|p| p.1).sum::<f64>() / n,
    );
    let covariance: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let variance: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let slope = if variance > 0.0 {
        covariance / variance
    } else {
        0.0
    };
    (slope, (-slope).round().clamp(0.0, 4.0) as usize)
}

#[cfg(test)]
mod tests;
