//! Fits over a range of orders: the data of a stabilisation diagram, and an order chosen from it.

use crate::fit::fit_lines;
use crate::weights::Lines;
use crate::{PoleFit, PoleFitError, PoleFitSettings, Weighting};
use lpv_core::{Discrete, FrfEstimate};
use num_complex::Complex;

/// Largest relative change of a natural frequency from one order to the next of a stable pole.
pub const STABLE_FREQUENCY: f64 = 0.01;
/// Largest relative change of its damping.
pub const STABLE_DAMPING: f64 = 0.05;

/// Fits of several orders.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Successful fits, orders increasing.
    pub entries: Vec<ScanEntry>,
    /// Orders that could not be fitted, and why.
    pub failures: Vec<(usize, PoleFitError)>,
    /// Index in `entries` of the least [`ScanEntry::mdl`].
    pub chosen: usize,
}

/// One order of a [`Scan`].
#[derive(Debug, Clone, PartialEq)]
pub struct ScanEntry {
    /// Degree of the denominator.
    pub order: usize,
    /// The fit.
    pub fit: PoleFit,
    /// Akaike's criterion: `-2 ln L + 2 n_theta`.
    pub aic: f64,
    /// Minimum description length: `-2 ln L + n_theta ln N`, with `N` real equations.
    pub mdl: f64,
    /// For each pole of the fit: whether the entry before has a pole with a natural frequency within 1 % and a damping
    /// within 5 %. Fixed integrators are stable; poles of the first entry are not.
    pub stable: Vec<bool>,
}

impl Scan {
    /// The fit of the chosen order.
    #[must_use]
    pub fn chosen(&self) -> Option<&PoleFit> {
        self.entries.get(self.chosen).map(|e| &e.fit)
    }
}

/// Fits each of the orders (sorted, doubles dropped) with otherwise equal settings.
///
/// With covariance weights `-2 ln L` is twice the cost, divided by its mean a complex equation, so that an estimated
/// covariance does not count twice. With the other weights the size of the noise is unknown, and `-2 ln L` is
/// `N ln(cost / N)`.
///
/// # Errors
/// As [`crate::fit`], if no order could be fitted; [`PoleFitError::Empty`] without orders; [`PoleFitError::Order`].
pub fn scan(
    estimate: &FrfEstimate,
    clock: Discrete,
    settings: &PoleFitSettings,
    orders: &[usize],
) -> Result<Scan, PoleFitError> {
    let mut orders = orders.to_vec();
    orders.sort_unstable();
    orders.dedup();
    if orders.is_empty() {
        return Err(PoleFitError::Empty { what: "orders" });
    }
    settings.check()?;
    let lines = Lines::new(estimate, clock, settings)?;
    let mut entries: Vec<ScanEntry> = Vec::with_capacity(orders.len());
    let mut failures = Vec::new();
    for order in orders {
        let settings = PoleFitSettings { order, ..*settings };
        settings.check()?;
        match fit_lines(&lines, clock, &settings) {
            Ok(fit) => {
                let (aic, mdl) = criteria(&fit, settings.weighting);
                let stable = stable(&fit, entries.last().map(|e| &e.fit));
                entries.push(ScanEntry {
                    order,
                    fit,
                    aic,
                    mdl,
                    stable,
                });
            }
            Err(error) => failures.push((order, error)),
        }
    }
    let chosen = (0..entries.len()).min_by(|&i, &j| entries[i].mdl.total_cmp(&entries[j].mdl));
    match (chosen, failures.first()) {
        (Some(chosen), _) => Ok(Scan {
            entries,
            failures,
            chosen,
        }),
        (None, Some((_, error))) => Err(error.clone()),
        (None, None) => Err(PoleFitError::Empty { what: "orders" }),
    }
}

fn criteria(fit: &PoleFit, weighting: Weighting) -> (f64, f64) {
    let account = &fit.account;
    let (n, unknowns) = (account.equations as f64, account.unknowns as f64);
    let likelihood = match weighting {
        Weighting::Covariance | Weighting::DiagonalCovariance => {
            account.cost / account.expected_cost * (n - unknowns)
        }
        // Exact fits of noise-free data must not send the logarithm to minus infinity.
        Weighting::Relative | Weighting::Uniform => n * (account.cost.max(f64::MIN_POSITIVE) / n).ln(),
    };
    (likelihood + 2.0 * unknowns, likelihood + unknowns * n.ln())
}

fn stable(fit: &PoleFit, before: Option<&PoleFit>) -> Vec<bool> {
    let polar = |z: &Complex<f64>| {
        let s = z.ln();
        (s.norm(), -s.re / s.norm())
    };
    let near = |z: &Complex<f64>, old: &Complex<f64>| {
        let ((w, d), (w_old, d_old)) = (polar(z), polar(old));
        (w - w_old).abs() <= STABLE_FREQUENCY * w_old
            && (d - d_old).abs() <= STABLE_DAMPING * d_old.abs()
            && z.im.total_cmp(&0.0) == old.im.total_cmp(&0.0)
    };
    let candidates = before.map_or(&[][..], |b| &b.poles[b.fixed_integrators..]);
    fit.poles
        .iter()
        .enumerate()
        .map(|(i, z)| i < fit.fixed_integrators || candidates.iter().any(|old| near(z, old)))
        .collect()
}
