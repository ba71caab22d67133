//! The search for order and integrators at all positions.

use super::LEAST_FLOOR;
use super::candidates::Candidate;
use crate::PipelineError;
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, FrfEstimate};
use pole_fit::{
    Integrators, NumeratorDegree, PoleFit, PoleFitError, PoleFitSettings, Scan, fit, fit_from, scan,
    scan_to_noise,
};
use rayon::prelude::*;

/// Orders that are tried at several positions where none is given, beyond the integrators: modes come in pairs.
pub(super) const FLEXIBLE_ORDERS: [usize; 6] = [2, 4, 6, 8, 10, 12];

/// The same where friction adds a real pole an axis.
const FLEXIBLE_ORDERS_OF_FRICTION: [usize; 12] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];

/// The same at one position, where a single lag, or nothing beside the integrators, may be all there is.
const FLEXIBLE_ORDERS_LTI: [usize; 9] = [0, 1, 2, 3, 4, 6, 8, 10, 12];

/// The same beside one integrator, whose partner is a real pole.
const FLEXIBLE_ORDERS_OF_ONE: [usize; 9] = [0, 1, 2, 3, 4, 5, 7, 9, 11];

/// Larger orders, beyond the integrators, that are tried in turn where none of these leaves noise alone.
pub(super) const LARGER_ORDERS: [usize; 9] = [16, 20, 26, 32, 40, 50, 64, 80, 96];

pub(super) fn kind(integrators: usize) -> Integrators {
    match integrators {
        0 => Integrators::Free,
        count => Integrators::Fixed(count),
    }
}

/// Cost over its expectation at the worst position.
pub(super) fn over_noise(fits: &[PoleFit]) -> f64 {
    let over = fits.iter().map(|f| f.account.cost / f.account.expected_cost);
    over.fold(0.0, f64::max)
}

/// Whether no estimated pole lies outside the unit circle.
pub(super) fn stable(fits: &[PoleFit]) -> bool {
    fits.iter().all(|f| f.account.unstable_poles.is_empty())
}

/// Real poles, one of each pair, below zero that are estimated: a machine in continuous time has no such samples, `e^(pT) > 0`.
pub(super) fn alternates(fit: &PoleFit) -> bool {
    fit.poles.iter().any(|l| l.im == 0.0 && l.re < 0.0)
}

/// Whether noise alone is left at every position.
pub(super) fn at_noise(fits: &[PoleFit]) -> bool {
    fits.iter().all(|f| f.account.is_noise(MORE_THAN_NOISE))
}

/// Whether noise is not reached, or not with stable poles.
pub(super) fn missed(fits: &[PoleFit]) -> bool {
    !at_noise(fits) || !stable(fits)
}

/// A slope this near to a whole number leaves no doubt about the integrators, where noise is reached.
const CLEAR_SLOPE: f64 = 0.05;

/// Cost over its expectation beyond which another start is tried.
const MORE_THAN_NOISE: f64 = 1.5;

/// Whether a slope leaves the number of integrators in doubt.
pub(super) fn doubtful(slope: f64) -> bool {
    (slope - slope.round()).abs() > CLEAR_SLOPE
}

/// Whether the lowest lines may fall with so many integrators.
pub(super) fn near(count: usize, slope: f64) -> bool {
    (count as f64 + slope).abs() <= 1.5
}

/// One of each pair of the estimated poles.
pub(crate) fn upper_half(fit: &PoleFit) -> Vec<Complex<f64>> {
    let estimated = fit.poles[fit.fixed_integrators..].iter();
    estimated.filter(|l| l.im >= 0.0).copied().collect()
}

/// Largest order, beyond the integrators, that is spent on distortion.
const MOST_OF_DISTORTION: usize = 32;

/// A cost within this factor of its expectation is that of the relative error in the weights: more orders would fit the distortion.
const WITHIN_DISTORTION: f64 = 2.0;

/// The same where several positions must agree.
const MOST_OF_SEVERAL: usize = 32;

/// Integrators and degree of the numerators.
pub(super) type Structure = (usize, NumeratorDegree);

/// A fit a position, and the scan at the middle one where the order was not given.
pub(super) type Fits = (Vec<PoleFit>, Option<Scan>);

/// Fits at all positions, with the order given or scanned.
pub(super) struct Search<'a> {
    /// Orders whose cost is within this factor of the best count as equal; 1 leaves the choice to description length.
    pub(super) slack: f64,
    pub(super) estimates: &'a [FrfEstimate],
    pub(super) clock: Discrete,
    pub(super) order: Option<usize>,
    pub(super) settings: PoleFitSettings,
    pub(super) integrators: usize,
    /// Whether friction adds real poles to those of the modes.
    pub(super) slow_poles: bool,
    /// Whether larger orders are left out: they did not reach the noise with other integrators.
    pub(super) small: bool,
    /// Whether the relative error in the weights is about what is left.
    pub(super) matched: bool,
    /// The scan of the states that stand out of the noise, for the integrators as they are.
    pub(super) counted: Option<Scan>,
    /// Every fit of one position with the present weights that was compared with the one taken.
    pub(super) candidates: Vec<Candidate>,
}

impl Search<'_> {
    /// Description length when the size of the noise is not known for sure: `N ln(cost / (N - k)) + k ln(N)`, where few equations leave
    /// less than the noise, as much less as they have unknowns. A noise that was measured counts as `n_0` more equations, which it leaves
    /// as it should: `(N + n_0) ln((n_0 + r (N - k)) / (n_0 + N - k)) + k ln(N)`, r the cost over its expectation. So few equations
    /// do not pay for unknowns that only fit their noise, and many are not bound to a wrong measure of it.
    pub(super) fn length(&self, fit: &PoleFit) -> f64 {
        /// `n_0`, about as many as 25 lines of a channel have.
        const WORTH_OF_NOISE: f64 = 50.0;
        let a = &fit.account;
        let (n, k) = (a.equations as f64, a.unknowns as f64);
        let left = (n - k).max(1.0);
        let cost = a.cost.max(f64::MIN_POSITIVE);
        if !self.noise_is_measured() {
            return n * (cost / left).ln() + k * n.ln();
        }
        let known = WORTH_OF_NOISE;
        let per_equation = (known + left * cost / a.expected_cost) / (known + left);
        (n + known) * per_equation.ln() + k * n.ln()
    }

    /// The same of all positions.
    pub(super) fn length_of_all(&self, fits: &[PoleFit]) -> f64 {
        fits.iter().map(|fit| self.length(fit)).sum()
    }

    /// Whether the weights are those of the noise alone.
    fn noise_is_measured(&self) -> bool {
        let assumed = self.estimates.iter().any(FrfEstimate::covariance_is_assumed);
        self.settings.relative_floor <= LEAST_FLOOR && !assumed
    }

    /// Cost over its expectation that is enough where distortion limits.
    fn enough(&self) -> f64 {
        if self.estimates.len() == 1 && self.matched {
            WITHIN_DISTORTION
        } else {
            0.0
        }
    }

    /// Takes another number of integrators.
    pub(super) fn integrate(&mut self, count: usize) {
        self.integrators = count;
        self.settings.integrators = kind(count);
        self.counted = None;
    }

    /// Integrators and degree of the numerators.
    pub(super) fn structure(&self) -> Structure {
        (self.integrators, self.settings.numerator)
    }

    /// Takes another structure. At several positions a single integrator is friction, which adds slow poles.
    pub(super) fn take(&mut self, (count, numerator): Structure) {
        self.integrate(count);
        self.settings.numerator = numerator;
        self.slow_poles = self.estimates.len() > 1 && count == 1;
    }

    /// Keeps the fits of a scan of one position to all lines beside the others.
    pub(super) fn keep(&mut self, integrators: usize, scan: &Scan) {
        if let [one] = self.estimates
            && one.frf().len() <= SCAN_LINES
        {
            let structure = (integrators, self.settings.numerator);
            let fits = scan.entries.iter().map(|e| e.fit.clone());
            self.candidates.extend(fits.map(|fit| Candidate {
                structure,
                fit,
                is_descended: false,
            }));
        }
    }

    /// Whether there are enough equations to tell the unknowns from their noise.
    pub(super) fn told(&self, fit: &PoleFit) -> bool {
        fit.account.equations as f64 >= EQUATIONS_OF_AN_UNKNOWN * fit.account.unknowns as f64
    }

    /// Orders to try, integrators included.
    fn orders(&self) -> Vec<usize> {
        let flexible = match self.estimates.len() {
            1 if self.integrators == 1 => FLEXIBLE_ORDERS_OF_ONE.as_slice(),
            1 => &FLEXIBLE_ORDERS_LTI,
            _ if self.slow_poles => &FLEXIBLE_ORDERS_OF_FRICTION,
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
        if known.is_empty() || !settings.several_starts || account.is_noise(MORE_THAN_NOISE) {
            return Ok(found);
        }
        match fit_from(estimate, self.clock, settings, known) {
            Ok(other) if other.account.cost < account.cost => Ok(other),
            _ => Ok(found),
        }
    }

    pub(super) fn run_as_measured(&mut self, reasons: &mut Vec<String>) -> Result<Fits, PipelineError> {
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
                let most = match (self.slack > 1.0, self.estimates.len()) {
                    (true, 1) => MOST_OF_DISTORTION,
                    (true, _) => 0,
                    (false, 1) => usize::MAX,
                    (false, _) => MOST_OF_SEVERAL,
                };
                let most = if self.small { 0 } else { most };
                let larger = LARGER_ORDERS.iter().filter(|n| **n <= most);
                let larger: Vec<usize> = larger.map(|n| n + self.integrators).collect();
                let tried = orders.iter().copied().max().unwrap_or(0);
                let scan_at = |i: usize| {
                    let few = thinned(&self.estimates[i]);
                    let found = match &self.counted {
                        Some(counted) if counted.chosen().is_some_and(|f| f.account.order > tried) => {
                            Ok(counted.clone())
                        }
                        Some(counted) => Ok(match scan(&few, self.clock, &self.settings, &orders) {
                            Ok(found) => found.join(counted.clone()),
                            Err(_) => counted.clone(),
                        }),
                        None => scan_to_noise(&few, self.clock, &self.settings, &orders, &larger),
                    };
                    found.map_err(failed(&self.estimates[i]))
                };
                let scans = indices
                    .par_iter()
                    .map(|&i| scan_at(i))
                    .collect::<Result<Vec<_>, _>>()?;
                scans.iter().for_each(|s| self.keep(self.integrators, s));
                let each: Vec<usize> = scans
                    .iter()
                    .map(|s| s.entries[self.parsimonious(s)].order)
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

    /// The order with the least [`Search::length`]. Where a model
    /// reaches the noise, this agrees with the scan's own choice; where nonlinear distortion keeps the cost above the
    /// noise, it does not buy order after order to explain it.
    pub(super) fn parsimonious(&self, scan: &Scan) -> usize {
        let (slack, enough) = (self.slack, self.enough());
        let length = |i: usize| self.length(&scan.entries[i].fit);
        // A flexible machine has stable modes: an order whose fit has a pole outside has found something else. As many unknowns as
        // equations fit any response.
        let account = |i: usize| &scan.entries[i].fit.account;
        let stable = |i: &usize| account(*i).unstable_poles.is_empty();
        let told = |i: &usize| self.told(&scan.entries[*i].fit);
        let all = 0..scan.entries.len();
        let some_stable = all.clone().any(|i| stable(&i));
        let some_told = all.clone().any(|i| stable(&i) && told(&i));
        let usable = || {
            let all = all.clone();
            all.filter(|i| (!some_stable || stable(i)) && (!some_told || told(i)))
        };
        let cost = |i: usize| scan.entries[i].fit.account.cost;
        let expected = |i: usize| scan.entries[i].fit.account.expected_cost;
        let least = usable().map(cost).fold(f64::INFINITY, f64::min);
        if slack > 1.0 {
            return usable()
                .find(|&i| cost(i) <= (slack * least).max(enough * expected(i)))
                .unwrap_or(scan.chosen);
        }
        usable()
            .min_by(|&a, &b| length(a).total_cmp(&length(b)))
            .unwrap_or(scan.chosen)
    }
}

/// Equations that tell an unknown from their noise, at least.
const EQUATIONS_OF_AN_UNKNOWN: f64 = 1.5;

/// Most lines that the scan over orders uses.
const SCAN_LINES: usize = 3000;

pub(super) fn thinned(estimate: &FrfEstimate) -> FrfEstimate {
    let step = estimate.frf().len().div_ceil(SCAN_LINES);
    estimate.select(|k, _| k % step == 0)
}
