//! Fits over a range of orders: the data of a stabilisation diagram, and an order chosen from it.

mod entry;

use crate::fit::fit_lines;
use crate::model::Setup;
use crate::relocate::size;
use crate::search::Begin;
use crate::subspace::Subspace;
use crate::weights::Lines;
use crate::{Integrators, PoleFitError, PoleFitSettings};
use lpv_core::{Discrete, FrfEstimate};
use num_complex::Complex;

use entry::put;
pub use entry::{STABLE_DAMPING, STABLE_FREQUENCY, Scan, ScanEntry};

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

/// For each of these integrators, the order of the states that a subspace method counts in the noise, if they are at most `most` beside
/// the integrators and the fit from their poles leaves noise alone; with the orders just below it. Where no fit does, they are counted
/// once more, with four times the powers. Fixed integrators are none of these states.
///
/// # Errors
/// [`PoleFitError`] of settings, lines and weights that no fit can take.
pub fn scan_counted(
    estimate: &FrfEstimate,
    clock: Discrete,
    settings: &PoleFitSettings,
    integrators: &[Integrators],
    most: usize,
) -> Result<Vec<Option<Scan>>, PoleFitError> {
    let each: Vec<(PoleFitSettings, Lines)> = integrators
        .iter()
        .map(|&integrators| {
            let settings = PoleFitSettings {
                integrators,
                ..*settings
            };
            let settings = PoleFitSettings {
                order: settings.order.max(settings.fixed_integrators()),
                ..settings
            };
            settings.check()?;
            Ok((settings, Lines::new(estimate, clock, &settings)?))
        })
        .collect::<Result<_, PoleFitError>>()?;
    let mut scans = vec![None; each.len()];
    // The lines differ by that at z = 1 at most.
    let first = each.first().filter(|_| settings.weighting.knows_noise());
    let mut subspace = first.and_then(|(_, lines)| Subspace::new(lines));
    while let (Some(counted), Some((_, lines))) = (&subspace, first) {
        for ((settings, lines), scan) in each.iter().zip(&mut scans) {
            *scan = Search::new(lines, clock, settings).of_states(counted, most)?;
        }
        let finer = counted.finer(lines);
        subspace = finer.filter(|_| scans.iter().all(Option::is_none));
    }
    Ok(scans)
}

/// As [`scan`], up to an order that leaves noise alone. A subspace method counts the states that stand out of the noise; where they are
/// more than `orders` have, and the fit from their poles leaves noise alone, only the orders just below are tried beside it. Else
/// `orders` are, then that fit, and then `larger` in turn until one leaves noise alone; those between it and the one before, by
/// bisection. A smaller order begins at the poles of the larger fit without those that matter least. A cost within a tenth of its
/// expectation is noise; one within half of it is, if the next order takes less than 3 % off. It gives up where [`PATIENCE`] larger
/// orders in a row lower the cost by less than a third.
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
    let tried = orders.iter().copied().max().unwrap_or(0);
    let most = larger.iter().copied().max().unwrap_or(tried);
    let counted = Subspace::new(&lines).filter(|_| settings.weighting.knows_noise());
    let counted = counted.and_then(|c| c.poles(settings.fixed_integrators()));
    let counted = counted.filter(|poles| (1..=most).contains(&search.order_of(poles)));
    if let Some(poles) = counted.as_ref().filter(|poles| search.order_of(poles) > tried)
        && search.reaches_noise(poles)?
    {
        return search.end();
    }
    for &order in orders {
        search.add(order, Begin::Data)?;
    }
    if !settings.weighting.knows_noise() || search.over() <= SURELY_NOISE {
        return search.end();
    }
    if let Some(poles) = counted.filter(|poles| search.order_of(poles) <= tried)
        && search.reaches_noise(&poles)?
    {
        return search.end();
    }
    let mut best = search.least();
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
    /// Of two fits of an order the better one stays.
    fn add(&mut self, order: usize, begin: Begin<'_>) -> Result<Option<usize>, PoleFitError> {
        let settings = PoleFitSettings {
            order,
            ..*self.settings
        };
        settings.check()?;
        match fit_lines(self.lines, self.clock, &settings, begin) {
            Ok(fit) => Ok(Some(put(
                &mut self.entries,
                ScanEntry::new(fit, settings.weighting),
            ))),
            Err(error) => {
                self.failures.push((order, error));
                Ok(None)
            }
        }
    }

    /// Whether the fit of this order leaves what noise alone may leave.
    fn is_noise(&self, order: usize) -> bool {
        let fit = self.entries.iter().find(|e| e.order == order);
        fit.is_some_and(|e| e.fit.account.is_noise(SURELY_NOISE))
    }

    /// The least cost over its expectation.
    fn over(&self) -> f64 {
        let over = |e: &ScanEntry| e.fit.account.cost / e.fit.account.expected_cost;
        self.entries.iter().map(over).fold(f64::INFINITY, f64::min)
    }

    /// The scan from the first start with the counted states that leaves noise alone.
    fn of_states(mut self, counted: &Subspace, most: usize) -> Result<Option<Scan>, PoleFitError> {
        let fixed = self.settings.fixed_integrators();
        let channels = self.lines.n_y.min(self.lines.n_u);
        for poles in counted.starts(fixed, channels).unwrap_or_default() {
            if (1..=most + fixed).contains(&self.order_of(&poles)) && self.reaches_noise(&poles)? {
                return self.end().map(Some);
            }
        }
        Ok(None)
    }

    /// The order of a fit with these poles, one of each pair.
    fn order_of(&self, poles: &[Complex<f64>]) -> usize {
        self.settings.fixed_integrators() + size(poles)
    }

    /// Whether the fit from these poles leaves noise alone: then those just below it join it, as long as they describe the data more
    /// shortly; else nothing does.
    fn reaches_noise(&mut self, poles: &[Complex<f64>]) -> Result<bool, PoleFitError> {
        let mut order = self.order_of(poles);
        let known = self.entries.iter().any(|e| e.order == order);
        self.add(order, Begin::Near(poles))?;
        if !self.is_noise(order) {
            if !known {
                self.remove(order);
            }
            return Ok(false);
        }
        while let Some(fewer) = self.fewer(order)? {
            order = fewer;
        }
        Ok(true)
    }

    /// One or two orders below, the first that describes the data more shortly; modes come in pairs.
    fn fewer(&mut self, order: usize) -> Result<Option<usize>, PoleFitError> {
        for fewer in [order.saturating_sub(1), order.saturating_sub(2)] {
            let Some(from) = self.entries.iter().find(|e| e.order == order) else {
                break;
            };
            let length = from.mdl;
            if fewer <= self.settings.fixed_integrators() {
                break;
            }
            let settings = PoleFitSettings {
                order,
                ..*self.settings
            };
            let Some(poles) = from.fit.most_important(&Setup::of(self.lines, &settings), fewer) else {
                break;
            };
            if let Some(at) = self.add(fewer, Begin::Near(&poles))?
                && self.entries[at].mdl < length
            {
                return Ok(Some(fewer));
            }
        }
        Ok(None)
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
            match self.add(middle, poles.as_deref().map_or(Begin::Data, Begin::Near))? {
                Some(at) if self.entries[at].mdl < length => (known, high) = (at, middle),
                // What was added stands below what is known.
                Some(_) => (known, low) = (known + 1, middle),
                None => low = middle,
            }
        }
        Ok(())
    }

    fn end(self) -> Result<Scan, PoleFitError> {
        match self.failures.first() {
            _ if !self.entries.is_empty() => Ok(Scan::of(self.entries, self.failures)),
            Some((_, error)) => Err(error.clone()),
            None => Err(PoleFitError::Empty { what: "orders" }),
        }
    }
}
