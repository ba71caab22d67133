//! Fits over a range of orders: the data of a stabilisation diagram, and an order chosen from it.

use crate::fit::fit_lines;
use crate::model::Setup;
use crate::search::Begin;
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
    let mut search = Search::new(&lines, clock, settings);
    for order in orders {
        search.add(order, Begin::Data)?;
    }
    search.end()
}

/// As [`scan`], and where none of the orders leaves noise alone, with the larger ones in turn until one does; then with those
/// between it and the one before, by bisection, each from the poles of the larger fit without those that matter least. A cost
/// within a tenth of its expectation is noise; one within half of it is, if the next order takes less than 3 % off. It
/// gives up where [`PATIENCE`] larger orders in a row lower the cost by less than a third.
///
/// With weights that are no covariance there is no noise to reach, and no larger order is tried.
///
/// # Errors
/// As [`scan`].
pub fn scan_to_noise(
    estimate: &FrfEstimate,
    clock: Discrete,
    settings: &PoleFitSettings,
    orders: &[usize],
    larger: &[usize],
) -> Result<Scan, PoleFitError> {
    settings.check()?;
    let lines = Lines::new(estimate, clock, settings)?;
    let mut search = Search::new(&lines, clock, settings);
    for &order in orders {
        search.add(order, Begin::Data)?;
    }
    if !search.knows_noise() || search.over() <= SURELY_NOISE {
        return search.end();
    }
    let mut best = search.least();
    let tried = orders.iter().copied().max().unwrap_or(0);
    let (mut idle, mut below) = (0, tried);
    for &order in larger.iter().filter(|n| **n > tried) {
        let before = search.over();
        search.add(order, Begin::Quick)?;
        let over = search.over();
        if before <= AT_NOISE && over > (1.0 - WORTH) * before {
            // Nothing more is to be had: the one before was noise.
            search.remove(order);
            break;
        }
        if over <= SURELY_NOISE {
            search.between(below, order)?;
            break;
        }
        below = order;
        let least = search.least();
        idle = if least < best / 1.5 { 0 } else { idle + 1 };
        if idle == 0 {
            best = least;
        }
        if idle == PATIENCE {
            break;
        }
    }
    search.end()
}

/// Larger orders in a row that may bring little.
pub const PATIENCE: usize = 6;

/// Costs within this factor of what noise alone leaves may be noise, if no larger order lowers them.
const AT_NOISE: f64 = 1.5;
/// Costs within this one are.
const SURELY_NOISE: f64 = 1.1;
/// Part of the cost that a larger order must take off there.
const WORTH: f64 = 0.03;

/// A scan under way.
struct Search<'a> {
    lines: &'a Lines,
    clock: Discrete,
    settings: &'a PoleFitSettings,
    entries: Vec<ScanEntry>,
    failures: Vec<(usize, PoleFitError)>,
}

impl<'a> Search<'a> {
    fn new(lines: &'a Lines, clock: Discrete, settings: &'a PoleFitSettings) -> Self {
        Self {
            lines,
            clock,
            settings,
            entries: Vec::new(),
            failures: Vec::new(),
        }
    }

    /// Fits an order, from poles where they are given, and says at which place among the entries it stands.
    fn add(&mut self, order: usize, begin: Begin<'_>) -> Result<Option<usize>, PoleFitError> {
        let settings = PoleFitSettings {
            order,
            ..*self.settings
        };
        settings.check()?;
        match fit_lines(self.lines, self.clock, &settings, begin) {
            Ok(fit) => {
                let (aic, mdl) = criteria(&fit, settings.weighting);
                let at = self.entries.partition_point(|e| e.order < order);
                let before = at.checked_sub(1).and_then(|i| self.entries.get(i));
                let stable = stable(&fit, before.map(|e| &e.fit));
                let entry = ScanEntry {
                    order,
                    fit,
                    aic,
                    mdl,
                    stable,
                };
                self.entries.insert(at, entry);
                Ok(Some(at))
            }
            Err(error) => {
                self.failures.push((order, error));
                Ok(None)
            }
        }
    }

    fn knows_noise(&self) -> bool {
        matches!(
            self.settings.weighting,
            Weighting::Covariance | Weighting::DiagonalCovariance
        )
    }

    /// The least cost over its expectation.
    fn over(&self) -> f64 {
        let over = |e: &ScanEntry| e.fit.account.cost / e.fit.account.expected_cost;
        self.entries.iter().map(over).fold(f64::INFINITY, f64::min)
    }

    fn remove(&mut self, order: usize) {
        self.entries.retain(|e| e.order != order);
    }

    fn least(&self) -> f64 {
        let costs = self.entries.iter().map(|e| e.fit.account.cost);
        costs.fold(f64::INFINITY, f64::min)
    }

    /// The smallest order above `low` that describes the data as shortly as `high` does, by bisection.
    fn between(&mut self, mut low: usize, mut high: usize) -> Result<(), PoleFitError> {
        let Some(mut known) = self.entries.iter().position(|e| e.order == high) else {
            return Ok(());
        };
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            let from = &self.entries[known];
            let settings = PoleFitSettings {
                order: from.order,
                ..*self.settings
            };
            let poles = from.fit.most_important(&Setup::of(self.lines, &settings), middle);
            let length = from.mdl;
            match self.add(middle, poles.as_deref().map_or(Begin::Data, Begin::Poles))? {
                Some(at) if self.entries[at].mdl < length => (known, high) = (at, middle),
                // What was added stands below what is known.
                Some(_) => (known, low) = (known + 1, middle),
                None => low = middle,
            }
        }
        Ok(())
    }

    fn end(self) -> Result<Scan, PoleFitError> {
        let length = |i: usize| self.entries[i].mdl;
        let chosen = (0..self.entries.len()).min_by(|&i, &j| length(i).total_cmp(&length(j)));
        match (chosen, self.failures.first()) {
            (Some(chosen), _) => Ok(Scan {
                entries: self.entries,
                failures: self.failures,
                chosen,
            }),
            (None, Some((_, error))) => Err(error.clone()),
            (None, None) => Err(PoleFitError::Empty { what: "orders" }),
        }
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
