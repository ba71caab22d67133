//! The search and its result.

use crate::ModalFitError;
use crate::model::{Modal, Parameter, Rigid, Section};
use crate::residues::{self, Ranks};
use crate::search::{DAMPING, Descent};
use crate::whiten::factors;
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, CoreError, Discrete, FrfEstimate, StateSpace};
use lpv_numerics::least_squares::{StopReason, minimise};
use lpv_numerics::poles::Oscillation;
use nalgebra::{DMatrix, Matrix2};

type C64 = Complex<f64>;

/// How to fit.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `integrators` | 0 | poles at z = 1 of the rigid body; they are not among the poles given | 0 to 2 |
/// | `direct` | false | whether there is a direct term D | |
/// | `max_iterations` | 30 | steps of the search | |
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModalSettings {
    /// Poles at z = 1 of the rigid body.
    pub integrators: usize,
    /// Whether there is a direct term.
    pub direct: bool,
    /// Steps of the search.
    pub max_iterations: usize,
}

impl Default for ModalSettings {
    fn default() -> Self {
        Self {
            integrators: 0,
            direct: false,
            max_iterations: 30,
        }
    }
}

/// A pole with the rank of its residue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalMode {
    /// The pole in z; of a pair the one with positive imaginary part.
    pub pole: C64,
    /// Rank of its residue: one for a mode by itself.
    pub rank: usize,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_deviation_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: f64,
}

/// How a fit went.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalAccount {
    /// Why the search ended.
    pub stop: StopReason,
    /// Steps that lowered the cost.
    pub iterations: usize,
    /// Sum of squares of the whitened residual: about one a real equation that is left, where noise alone is left.
    pub cost: f64,
    /// Its mean if noise alone is left.
    pub expected_cost: f64,
    /// Real equations: two a line and channel.
    pub equations: usize,
    /// Real unknowns.
    pub unknowns: usize,
}

/// A minimal modal model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalFit {
    /// The state space: the rigid body first, then the modes in the order of [`ModalFit::modes`].
    pub model: StateSpace<Discrete>,
    /// The poles by natural frequency.
    pub modes: Vec<ModalMode>,
    /// Rank of the gain of the rigid body; zero without one.
    pub rigid_rank: usize,
    /// How it went.
    pub account: ModalAccount,
}

/// Fits a modal model that begins at these poles, of a pair one or both.
///
/// # Errors
/// [`ModalFitError`]: no lines, no poles, poles that stand twice or on a line, more unknowns than equations, a covariance that is
/// not positive definite.
pub fn modal_fit(
    estimate: &FrfEstimate,
    clock: Discrete,
    poles: &[C64],
    settings: &ModalSettings,
) -> Result<ModalFit, ModalFitError> {
    let rigid = match settings.integrators {
        0 => None,
        1 => Some(Rigid::One),
        2 => Some(Rigid::Two),
        found => return Err(ModalFitError::Integrators { found }),
    };
    let frf = estimate.frf();
    if frf.is_empty() || frf.outputs() * frf.inputs() == 0 {
        return Err(ModalFitError::Empty {
            what: "lines or channels",
        });
    }
    let estimate = if rigid.is_some() {
        estimate.select(|_, f| f > 0.0)
    } else {
        estimate.clone()
    };
    let mut poles = upper_half(poles, rigid.is_some())?;
    poles.sort_by(|x, y| x.ln().norm().total_cmp(&y.ln().norm()));
    let lines = estimate.frf().frequencies_hz();
    let mut descent = Descent {
        z: lines.iter().map(|&f| clock.point(f)).collect(),
        factors: factors(&estimate)?,
        frf: estimate.frf(),
        clock,
        most: settings.max_iterations,
    };
    let at = |poles: &[C64]| residues::Residues::new(&estimate, clock, poles, rigid, settings.direct);
    let mut found = descent.fit(at(&poles)?.model(Ranks::One)?, &estimate)?;
    // Poles that are off leave more directions in the residues than there are: ranks are those at the fitted poles.
    for _ in 0..PASSES {
        let fitted: Vec<C64> = found.modes.iter().map(|m| m.pole).collect();
        let account = &found.account;
        let missed = account.excess() > EXCESS && account.cost > MISSED * account.expected_cost;
        let several = found.modes.iter().any(|m| m.rank > 1 && m.pole.im > 0.0);
        let ranks = if missed || several {
            Ranks::AboveNoise
        } else {
            Ranks::One
        };
        let next = at(&fitted)?.model(ranks)?;
        if next.ranks() == found.ranks() {
            break;
        }
        match descent.fit(next, &estimate) {
            Ok(other) if other.account.excess() < EXCESS.max(found.account.excess()) => found = other,
            _ => break,
        }
    }
    Ok(found)
}

impl ModalFit {
    /// Ranks of the residues, that of the rigid body last.
    fn ranks(&self) -> Vec<usize> {
        self.modes
            .iter()
            .map(|m| m.rank)
            .chain([self.rigid_rank])
            .collect()
    }
}

impl ModalAccount {
    /// How far the cost is above what noise alone leaves, in standard deviations of that.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let deviation = self.expected_cost * (2.0 / self.equations as f64).sqrt();
        (self.cost - self.expected_cost) / deviation
    }
}

impl Descent<'_> {
    fn fit(&mut self, start: Modal, estimate: &FrfEstimate) -> Result<ModalFit, ModalFitError> {
        let (equations, unknowns) = (self.equations(), start.parameters().len());
        if equations <= unknowns {
            return Err(ModalFitError::TooFewEquations { equations, unknowns });
        }
        let start = self.point(start).ok_or(CoreError::NotFinite {
            what: "modal fit: the response at the poles given",
            row: 0,
            column: 0,
        })?;
        let found = minimise(self, start, &DAMPING)?;
        let modal = found.point.modal;
        // The last linearisation is a step away that no longer counts.
        let linear = match found.linear {
            Some(linear) => linear,
            None => self.normal(&modal, &modal.parameters()),
        };
        let inverse = linear.inverse()?;
        let nu = estimate.degrees_of_freedom();
        let left = nu - self.frf.outputs() as f64;
        // Weights from an estimated covariance scatter: moments of the complex inverse Wishart distribution.
        let (mean, spread) = if nu.is_finite() && left > 1.0 {
            (nu / left, nu * nu / (left * left - 1.0))
        } else {
            (1.0, 1.0)
        };
        let modes = modes(&modal, &linear.parameters, &(inverse * spread), self.clock);
        Ok(ModalFit {
            model: modal.state_space(self.clock)?,
            modes,
            rigid_rank: modal.rigid.as_ref().map_or(0, |(_, c, _)| c.ncols()),
            account: ModalAccount {
                stop: found.stop,
                iterations: found.history.len() - 1,
                cost: found.point.cost,
                expected_cost: (equations - unknowns) as f64 * mean,
                equations,
                unknowns,
            },
        })
    }
}

/// What rank one may leave beyond the expected cost, in standard deviations of it, before higher ranks are tried.
const EXCESS: f64 = 6.0;

/// And the part of the expected cost: with many equations a covariance that is a little too small is many deviations.
const MISSED: f64 = 1.1;

/// Changes of the ranks at most.
const PASSES: usize = 4;

/// One pole of each pair.
fn upper_half(poles: &[C64], rigid: bool) -> Result<Vec<C64>, ModalFitError> {
    let mut upper: Vec<C64> = Vec::new();
    for (index, &pole) in poles.iter().enumerate() {
        let refused = |problem| {
            Err(ModalFitError::Pole {
                index,
                pole: pole.to_string(),
                problem,
            })
        };
        if !(pole.re.is_finite() && pole.im.is_finite()) {
            return refused("not a finite number");
        }
        if rigid && (pole - 1.0).norm() < 1e-9 {
            return refused("that of the rigid body; leave it out, or ask for no integrators");
        }
        if pole.im < 0.0 {
            continue;
        }
        if upper.iter().any(|other| (other - pole).norm() <= 1e-12) {
            return refused("given twice; residues of equal poles cannot be told apart");
        }
        upper.push(pole);
    }
    if upper.is_empty() && !rigid {
        return Err(ModalFitError::Empty { what: "poles" });
    }
    Ok(upper)
}

fn modes(
    modal: &Modal,
    parameters: &[Parameter],
    covariance: &DMatrix<f64>,
    clock: Discrete,
) -> Vec<ModalMode> {
    let at = |wanted: usize, part: bool| {
        parameters.iter().position(
            |p| matches!(*p, Parameter::Pole { section, imaginary } if section == wanted && imaginary == part),
        )
    };
    let one = |(i, section): (usize, &Section)| {
        // A real pole has no imaginary part to vary.
        let parts = [at(i, false), at(i, true)];
        let own = Matrix2::from_fn(|i, j| match (parts[i], parts[j]) {
            (Some(i), Some(j)) => covariance[(i, j)],
            _ => 0.0,
        });
        let found = Oscillation::new(section.pole, &own, clock.sample_time());
        ModalMode {
            pole: section.pole,
            rank: section.c.ncols(),
            frequency_hz: found.frequency_hz,
            frequency_deviation_hz: found.frequency_deviation_hz,
            damping: found.damping,
            damping_deviation: found.damping_deviation,
        }
    };
    modal.sections.iter().enumerate().map(one).collect()
}
