//! What a scan finds: fits of increasing order.

use crate::{PoleFit, PoleFitError, Weighting};
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

impl ScanEntry {
    /// Without what the entry before it says, which [`Scan::of`] adds.
    pub(super) fn new(fit: PoleFit, weighting: Weighting) -> Self {
        let (aic, mdl) = criteria(&fit, weighting);
        Self {
            order: fit.account.order,
            fit,
            aic,
            mdl,
            stable: Vec::new(),
        }
    }
}

/// Puts an entry in the order of the others, and says where: of two fits of an order the better one stays.
pub(super) fn put(entries: &mut Vec<ScanEntry>, entry: ScanEntry) -> usize {
    let at = entries.partition_point(|e| e.order < entry.order);
    match entries.get_mut(at).filter(|e| e.order == entry.order) {
        Some(own) if own.fit.account.cost <= entry.fit.account.cost => {}
        Some(own) => *own = entry,
        None => entries.insert(at, entry),
    }
    at
}

impl Scan {
    /// Of entries with increasing orders, one at least.
    pub(super) fn of(mut entries: Vec<ScanEntry>, failures: Vec<(usize, PoleFitError)>) -> Self {
        for i in 0..entries.len() {
            let before = i.checked_sub(1).map(|i| &entries[i].fit);
            entries[i].stable = stable(&entries[i].fit, before);
        }
        let shorter = |a: &usize, b: &usize| entries[*a].mdl.total_cmp(&entries[*b].mdl);
        let chosen = (0..entries.len()).min_by(shorter).unwrap_or(0);
        Self {
            entries,
            failures,
            chosen,
        }
    }

    /// Both scans together: of two fits of one order the better one.
    #[must_use]
    pub fn join(mut self, other: Self) -> Self {
        for entry in other.entries {
            put(&mut self.entries, entry);
        }
        self.failures.extend(other.failures);
        Self::of(self.entries, self.failures)
    }

    /// The fit of the chosen order.
    #[must_use]
    pub fn chosen(&self) -> Option<&PoleFit> {
        self.entries.get(self.chosen).map(|e| &e.fit)
    }
}

/// Akaike's criterion and the description length.
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

/// Which poles the fit before has too.
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
