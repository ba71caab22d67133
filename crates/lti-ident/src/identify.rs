//! The fit: scaling, starts, search, gain, account.

use crate::account::{InnovationFit, OrderEntry, StartEntry, StartKind};
use crate::assemble::Scaled;
use crate::choice;
use crate::predictor::{Predictor, reflected};
use crate::problem::{Point, Problem};
use crate::search::{Coordinates, Limits, search};
use crate::start::{ImpulseResponse, Realisation, grown, polished};
use crate::{Focus, InnovationSettings, LtiIdentError, Segment};
use lpv_core::{Discrete, StateSpace};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Samples on which all starts of all orders are searched; of a longer record a part, since the search takes time in
/// proportion.
const SCANNED: usize = 10_000;

/// Innovation models of the orders in the settings, and the choice between them. A start is used at the order that
/// equals its number of states; higher orders profit, since each order also starts from the one below.
///
/// # Errors
/// [`LtiIdentError`] for segments that are empty, differ in channels, or are too short for the lowest order;
/// [`LtiIdentError::Constant`] for a channel without motion; [`LtiIdentError::NoStart`] if no order could be fitted.
pub fn identify(
    segments: &[Segment],
    clock: Discrete,
    settings: &InnovationSettings,
    starts: &[StateSpace<Discrete>],
) -> Result<InnovationFit, LtiIdentError> {
    identify_telling(segments, clock, settings, starts, &|_, _| {})
}

/// [`identify`], which tells how many parts of its work are done and at most how many there are; from any thread.
///
/// # Errors
/// Those of [`identify`].
pub fn identify_telling(
    segments: &[Segment],
    clock: Discrete,
    settings: &InnovationSettings,
    starts: &[StateSpace<Discrete>],
    tell: &(dyn Fn(usize, usize) + Sync),
) -> Result<InnovationFit, LtiIdentError> {
    let scaled = Scaled::new(segments, clock, settings)?;
    let limits = Limits {
        iterations: settings.max_iterations,
        tolerance: settings.tolerance,
    };
    let part = scaled.problem.part(SCANNED);
    let scanned = part.as_ref().unwrap_or(&scaled.problem);
    let response = ImpulseResponse::new(scanned, settings.response_samples)?;
    let targets: Vec<_> = scanned.runs.iter().map(|r| r.outputs.clone()).collect();
    let realisation = response.realisation(&targets);
    let climb = Climb {
        scaled: &scaled,
        problem: scanned,
        response: &response,
        limits,
    };
    // The climb needs a foot.
    let alone: BTreeSet<usize> = settings.orders.iter().copied().chain([1, 2]).collect();
    let highest = settings.orders.iter().copied().max().unwrap_or(0);
    let done = AtomicUsize::new(0);
    let parts = alone.len() + highest + settings.orders.len();
    let part_done = || tell(done.fetch_add(1, Ordering::Relaxed) + 1, parts);
    let own: Vec<(usize, Vec<Search>)> = alone
        .into_par_iter()
        .map(|order| {
            let searches = climb.alone(order, realisation.as_ref(), starts);
            part_done();
            (order, searches)
        })
        .collect();
    let mut own: BTreeMap<usize, Vec<Search>> = own.into_iter().collect();
    let mut climbed: BTreeMap<usize, Vec<Search>> = BTreeMap::new();
    for order in 1..=highest {
        let mut searches = own.remove(&order).unwrap_or_default();
        searches.extend(climb.climbed_to(&climbed, order));
        if !searches.is_empty() {
            climbed.insert(order, searches);
        }
        part_done();
    }
    let mut fitted = Vec::new();
    let mut failures = Vec::new();
    for &order in &settings.orders {
        match (scaled.enough_samples(order), climbed.remove(&order)) {
            (Err(error), _) => failures.push((order, error)),
            (Ok(()), None) => failures.push((order, LtiIdentError::NoStart { order })),
            (Ok(()), Some(searches)) => fitted.push((order, searches)),
        }
    }
    let judged: Vec<(usize, Result<OrderEntry, LtiIdentError>)> = fitted
        .into_par_iter()
        .map(|(order, mut searches)| {
            let winner = match &part {
                Some(_) => resumed(&scaled.problem, &mut searches, limits),
                None => best(&searches),
            };
            let none = LtiIdentError::NoStart { order };
            let made = winner
                .ok_or(none)
                .and_then(|winner| entry(&scaled, settings.focus, &searches, winner, limits));
            part_done();
            (order, made)
        })
        .collect();
    let mut entries = Vec::new();
    for (order, judged) in judged {
        match judged {
            Ok(entry) => entries.push(entry),
            Err(error) => failures.push((order, error)),
        }
    }
    let chosen = choice::chosen(&entries, settings.focus);
    match (chosen, failures.first()) {
        (Some(chosen), _) => Ok(InnovationFit {
            entries,
            failures,
            chosen,
            scanned_samples: scanned.samples(),
        }),
        (None, Some((_, error))) => Err(error.clone()),
        (None, None) => Err(LtiIdentError::Empty { what: "orders" }),
    }
}

/// One search with its story.
struct Search {
    story: StartEntry,
    point: Point,
}

/// Index of the search that ended lowest; the first of equals.
fn best(searches: &[Search]) -> Option<usize> {
    (0..searches.len()).min_by(|&i, &j| searches[i].story.cost.total_cmp(&searches[j].story.cost))
}

fn searched(problem: &Problem, kind: StartKind, start: Point, limits: Limits) -> Search {
    let first_cost = start.cost;
    let outcome = search(problem, start, &Coordinates::Local, limits);
    let story = StartEntry {
        kind,
        first_cost,
        cost: outcome.point.cost,
        iterations: outcome.iterations,
        stop: outcome.stop,
    };
    Search {
        story,
        point: outcome.point,
    }
}

/// Appends the search over all samples from the best over a part of them, and returns its index.
fn resumed(problem: &Problem, searches: &mut Vec<Search>, limits: Limits) -> Option<usize> {
    let start = polished(problem, &searches[best(searches)?].point.predictor)?;
    searches.push(searched(problem, StartKind::Scan, start, limits));
    Some(searches.len() - 1)
}

struct Climb<'a> {
    scaled: &'a Scaled,
    /// All samples, or the part that is scanned.
    problem: &'a Problem,
    response: &'a ImpulseResponse<'a>,
    limits: Limits,
}

impl Climb<'_> {
    /// Searches that need no other order: from the realisation and from the starts that were handed in.
    fn alone(
        &self,
        order: usize,
        realisation: Option<&Realisation>,
        starts: &[StateSpace<Discrete>],
    ) -> Vec<Search> {
        if self.scaled.enough_samples(order).is_err() {
            return Vec::new();
        }
        let given = starts.iter().enumerate().filter(|(_, s)| s.states() == order);
        let given = given.filter_map(|(i, s)| Some((StartKind::Given(i), self.given(s)?)));
        let own =
            realisation.and_then(|r| Some((StartKind::Realisation, r.cut(order, self.problem.region)?)));
        given
            .chain(own)
            .filter_map(|(kind, predictor)| Some(self.run(kind, polished(self.problem, &predictor)?)))
            .collect()
    }

    /// Searches from the optima of the two orders below. Single steps find modes one half at a time, which has left
    /// local minima in which steps of two ended, and the other way round.
    fn climbed_to(&self, climbed: &BTreeMap<usize, Vec<Search>>, order: usize) -> Vec<Search> {
        if self.scaled.enough_samples(order).is_err() {
            return Vec::new();
        }
        let grow = |added: &usize| {
            let lower = order.checked_sub(*added)?;
            let searches = climbed.get(&lower)?;
            let point = &searches[best(searches)?].point;
            let start = grown(self.problem, point, self.response, order)?;
            Some(self.run(StartKind::Grown { from: lower }, start))
        };
        [1, 2]
            .par_iter()
            .map(grow)
            .collect::<Vec<_>>()
            .into_iter()
            .flatten()
            .collect()
    }

    fn run(&self, kind: StartKind, start: Point) -> Search {
        searched(self.problem, kind, start, self.limits)
    }

    /// Poles and output matrix of a system that was handed in; the rest is polished.
    fn given(&self, system: &StateSpace<Discrete>) -> Option<Predictor> {
        let problem = self.problem;
        if system.outputs() != problem.outputs() {
            return None;
        }
        let (n, nw, ny) = (system.states(), problem.known(), problem.outputs());
        let c = self.scaled.scaled_rows(system.c());
        let none = DMatrix::zeros(n, nw);
        Predictor::new(
            &reflected(system.a(), problem.region)?,
            &none,
            &c,
            &DMatrix::zeros(ny, nw),
        )
        .ok()
    }
}

fn entry(
    scaled: &Scaled,
    focus: Focus,
    searches: &[Search],
    winner: usize,
    limits: Limits,
) -> Result<OrderEntry, LtiIdentError> {
    let point = &searches[winner].point;
    let order = point.predictor.states;
    let assembled = scaled.model(point, limits)?;
    let judged = scaled.judge(&assembled)?;
    let parameters = scaled.parameters(order);
    Ok(OrderEntry {
        order,
        initial_states: assembled.initial,
        cost: point.cost,
        winner,
        starts: searches.iter().map(|s| s.story).collect(),
        parameters,
        expected_cost: choice::expected_cost(point, focus, parameters),
        simulated_fit_percent: judged.simulated,
        one_step_fit_percent: judged.one_step,
        simulation_covariance: judged.covariance,
        model: assembled.model,
    })
}
