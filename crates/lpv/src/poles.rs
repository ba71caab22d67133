//! Frequency responses in, poles at every position out: order and integrators chosen where they are not given.

use crate::PipelineError;
use crate::config::IdentifyConfig;
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, FrfEstimate};
use pole_fit::{
    Integrators, NumeratorDegree, PoleFit, PoleFitError, PoleFitSettings, Scan, Weighting, fit, fit_from,
    scan_to_noise,
};
use rayon::prelude::*;

/// The poles at every position.
#[derive(Debug, Clone)]
pub struct PoleStage {
    /// Order of the common denominator, integrators included.
    pub order: usize,
    /// Poles held at z = 1.
    pub integrators: usize,
    /// Relative error beside the noise in the weights, where noise does not explain what is left; else zero.
    pub relative_error: f64,
    /// Lines on either side over which the covariance is averaged as a weight.
    pub smoothing: usize,
    /// One fit a position.
    pub fits: Vec<PoleFit>,
    /// The scan that chose the order, where it was not given, at the middle position.
    pub scan: Option<Scan>,
    /// Why this order and these integrators.
    pub reasons: Vec<String>,
}

/// Orders that are tried at several positions where none is given, beyond the integrators: modes come in pairs.
const FLEXIBLE_ORDERS: [usize; 6] = [2, 4, 6, 8, 10, 12];

/// The same at one position, where a single lag, or nothing beside the integrators, may be all there is.
const FLEXIBLE_ORDERS_LTI: [usize; 9] = [0, 1, 2, 3, 4, 6, 8, 10, 12];

/// Larger orders, beyond the integrators, that are tried in turn where none of these leaves noise alone.
const LARGER_ORDERS: [usize; 9] = [16, 20, 26, 32, 40, 50, 64, 80, 96];

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
    let mut integrators = config.integrators.unwrap_or_else(|| {
        let (slope, count) = integrators_from_slope(middle);
        // The series expansion over several positions knows two or none: one is left to the poles.
        let count = match count {
            1 if estimates.len() > 1 => 0,
            more if estimates.len() > 1 => more.min(2),
            any => any,
        };
        reasons.push(format!(
            "{count} integrators: |F| falls with the power {slope:.2} of frequency at the lowest lines"
        ));
        count
    });
    let kind = if integrators == 0 {
        Integrators::Free
    } else {
        Integrators::Fixed(integrators)
    };
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
            integrators: kind,
            numerator: NumeratorDegree::StrictlyProper,
            smoothing_lines: smoothing,
            weighting: if outputs * inputs > COUPLED_CHANNELS {
                Weighting::DiagonalCovariance
            } else {
                Weighting::Covariance
            },
            ..PoleFitSettings::new(integrators + FLEXIBLE_ORDERS[0])
        },
        integrators,
    };
    let before = reasons.len();
    let mut found = search.run(&mut reasons)?;
    let misfit = found
        .0
        .iter()
        .map(|f| f.account.cost / f.account.expected_cost)
        .fold(0.0, f64::max);
    let mut relative_error = 0.0;
    if misfit > DISTORTED {
        // Not noise but distortion or unmodelled dynamics is left: lines with little noise must not outweigh it.
        let floor = found
            .0
            .iter()
            .map(|f| f.account.relative_error_rms)
            .fold(0.0, f64::max)
            .clamp(1e-9, 0.1);
        relative_error = floor;
        reasons.truncate(before);
        reasons.push(format!(
            "what is left is {misfit:.0} times the noise: fitted again with a relative error of {:.1} % in the weights",
            100.0 * floor
        ));
        search.settings.relative_floor = floor;
        search.slack = DISTORTION_SLACK;
        // Distortion would buy a lower cost with poles outside.
        search.settings.keep_stable = true;
        if estimates.len() == 1 && config.integrators.is_none() {
            // Friction turns integrators into slow poles, and a direct term takes what the amplifier does to the phase.
            reasons.push("integrators left free: friction may have moved them".to_owned());
            integrators = 0;
            search.integrators = 0;
            search.settings.integrators = Integrators::Free;
            search.settings.numerator = NumeratorDegree::Proper;
        }
        found = search.run(&mut reasons)?;
    }
    let (fits, scan) = found;
    let order = fits[0].account.order;
    Ok(PoleStage {
        order,
        integrators,
        relative_error,
        smoothing,
        fits,
        scan,
        reasons,
    })
}

/// Complex degrees of freedom of a covariance from which on it serves as a weight line by line.
const ENOUGH_FREEDOM: f64 = 12.0;

/// The same for each output: the inverse of a covariance scatters with the number of its rows.
const FREEDOM_OF_AN_OUTPUT: f64 = 4.0;

/// Channels beyond which the poles are found with the variances alone: the numerators of all channels are otherwise one system.
const COUPLED_CHANNELS: usize = 16;

/// Cost over its expectation beyond which noise does not explain the residual.
const DISTORTED: f64 = 10.0;

/// Distortion is not to be bought order after order: the smallest order within this factor of the least cost is taken.
const DISTORTION_SLACK: f64 = 1.5;

/// Cost over its expectation beyond which another start is tried.
const MORE_THAN_NOISE: f64 = 1.5;

/// One of each pair of the estimated poles.
pub(crate) fn upper_half(fit: &PoleFit) -> Vec<Complex<f64>> {
    let estimated = fit.poles[fit.fixed_integrators..].iter();
    estimated.filter(|l| l.im >= 0.0).copied().collect()
}

/// Largest order, beyond the integrators, that is spent on distortion.
const MOST_OF_DISTORTION: usize = 32;

/// Fits at all positions, with the order given or scanned.
struct Search<'a> {
    /// Orders whose cost is within this factor of the best count as equal; 1 leaves the choice to description length.
    slack: f64,
    estimates: &'a [FrfEstimate],
    clock: Discrete,
    order: Option<usize>,
    settings: PoleFitSettings,
    integrators: usize,
}

impl Search<'_> {
    /// Orders to try, integrators included.
    fn orders(&self) -> Vec<usize> {
        let flexible = match self.estimates.len() {
            1 => FLEXIBLE_ORDERS_LTI.as_slice(),
            _ => &FLEXIBLE_ORDERS,
        };
        let orders = flexible.iter().map(|n| n + self.integrators);
        orders.filter(|n| *n > 0).collect()
    }

    /// The fit of one position; where it leaves more than noise, the better of it and the one that begins at known poles.
    fn one(
        &self,
        estimate: &FrfEstimate,
        settings: &PoleFitSettings,
        known: &[Complex<f64>],
    ) -> Result<PoleFit, PoleFitError> {
        let found = fit(estimate, self.clock, settings)?;
        let account = &found.account;
        if known.is_empty() || account.cost <= MORE_THAN_NOISE * account.expected_cost {
            return Ok(found);
        }
        match fit_from(estimate, self.clock, settings, known) {
            Ok(other) if other.account.cost < account.cost => Ok(other),
            _ => Ok(found),
        }
    }

    fn run(&self, reasons: &mut Vec<String>) -> Result<(Vec<PoleFit>, Option<Scan>), PipelineError> {
        let failed = |e: &FrfEstimate| {
            let place = e
                .position()
                .map_or_else(|| "pole fit".to_owned(), |p| format!("pole fit at p = {p:.6}"));
            move |source| PipelineError::Poles { place, source }
        };
        let (mut scanned, mut middle): (Option<Scan>, usize) = (None, 0);
        let order = match self.order {
            Some(order) => order,
            None => {
                // The middle and both ends: a mode may be invisible at one of them.
                let n = self.estimates.len();
                let mut indices = vec![0, n / 2, n - 1];
                indices.dedup();
                let orders = self.orders();
                let most = if self.slack > 1.0 {
                    MOST_OF_DISTORTION
                } else {
                    usize::MAX
                };
                let larger = LARGER_ORDERS.iter().filter(|n| **n <= most);
                let larger: Vec<usize> = larger.map(|n| n + self.integrators).collect();
                let scans = indices
                    .par_iter()
                    .map(|&i| {
                        let few = thinned(&self.estimates[i]);
                        scan_to_noise(&few, self.clock, &self.settings, &orders, &larger)
                            .map_err(failed(&self.estimates[i]))
                    })
                    .collect::<Result<Vec<_>, _>>()?;
                let each: Vec<usize> = scans
                    .iter()
                    .map(|s| s.entries[parsimonious(s, self.slack)].order)
                    .collect();
                let chosen = each.iter().copied().max().unwrap_or(self.integrators + 2);
                let each: Vec<String> = each.iter().map(ToString::to_string).collect();
                reasons.push(format!(
                    "order {chosen}: {} at the positions tried",
                    each.join(", ")
                ));
                scanned = scans.into_iter().nth(indices.len() / 2);
                middle = indices[indices.len() / 2];
                chosen
            }
        };
        // The poles of the scan start what its order misses at another position.
        let entry = scanned
            .as_ref()
            .and_then(|s| s.entries.iter().find(|e| e.order == order));
        let known: Vec<Complex<f64>> = entry.map_or_else(Vec::new, |e| upper_half(&e.fit));
        let whole = self.estimates[middle].frf().len() <= SCAN_LINES;
        let there = entry.filter(|_| whole).map(|e| e.fit.clone());
        let at = |order: usize| -> Result<Vec<PoleFit>, PipelineError> {
            let settings = PoleFitSettings {
                order,
                ..self.settings
            };
            let one = |(i, e): (usize, &FrfEstimate)| match &there {
                // What the scan has fitted to all lines.
                Some(fit) if i == middle && fit.account.order == order => Ok(fit.clone()),
                _ => self.one(e, &settings, &known).map_err(failed(e)),
            };
            self.estimates.par_iter().enumerate().map(one).collect()
        };
        let stable = |fits: &[PoleFit]| fits.iter().all(|f| f.account.unstable_poles.is_empty());
        let fits = at(order)?;
        if self.order.is_some() || stable(&fits) {
            return Ok((fits, scanned));
        }
        // One position alone may show a pole outside that nothing but noise has put there: a smaller order then serves all.
        for lower in self.orders().into_iter().rev() {
            if lower < order {
                let smaller = at(lower)?;
                if stable(&smaller) {
                    reasons.push(format!(
                        "order {lower} instead: with {order} a position has poles outside the unit circle"
                    ));
                    return Ok((smaller, scanned));
                }
            }
        }
        Ok((fits, scanned))
    }
}

/// The order with the least description length when the noise level is not trusted: `N ln(cost) + k ln(N)`. Where a model
/// reaches the noise, this agrees with the scan's own choice; where nonlinear distortion keeps the cost above the
/// noise, it does not buy order after order to explain it.
fn parsimonious(scan: &Scan, slack: f64) -> usize {
    let length = |i: usize| {
        let a = &scan.entries[i].fit.account;
        let n = a.equations as f64;
        n * (a.cost.max(f64::MIN_POSITIVE) / n).ln() + a.unknowns as f64 * n.ln()
    };
    // A flexible machine has stable modes: an order whose fit has a pole outside has found something else.
    let stable = |i: &usize| scan.entries[*i].fit.account.unstable_poles.is_empty();
    let some_stable = (0..scan.entries.len()).any(|i| stable(&i));
    let usable = || (0..scan.entries.len()).filter(|i| !some_stable || stable(i));
    let cost = |i: usize| scan.entries[i].fit.account.cost;
    let least = usable().map(cost).fold(f64::INFINITY, f64::min);
    if slack > 1.0 {
        return usable()
            .find(|&i| cost(i) <= slack * least)
            .unwrap_or(scan.chosen);
    }
    usable()
        .min_by(|&a, &b| length(a).total_cmp(&length(b)))
        .unwrap_or(scan.chosen)
}

/// Most lines that the scan over orders uses.
const SCAN_LINES: usize = 3000;

fn thinned(estimate: &FrfEstimate) -> FrfEstimate {
    let step = estimate.frf().len().div_ceil(SCAN_LINES);
    estimate.select(|k, _| k % step == 0)
}

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
