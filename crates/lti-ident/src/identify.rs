//! The fit: scaling, starts, search, gain, account.

use crate::account::{InnovationFit, OrderEntry, StartEntry, StartKind};
use crate::assemble::Scaled;
use crate::choice;
use crate::predictor::{Predictor, reflected};
use crate::problem::{Point, Problem};
use crate::search::{Coordinates, Limits, search};
use crate::start::{ImpulseResponse, Realisation, grown, polished};
use crate::{CheckedInnovationSettings, LtiIdentError, Segment};
use lpv_core::{Discrete, StateSpace};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Innovation models of the orders in the settings, and the choice between them. A start is used at the order that
/// equals its number of states; higher orders profit, since each order also starts from the one below.
///
/// # Errors
/// [`LtiIdentError`] for segments that are empty, differ in channels, or are too short for the lowest order;
/// [`LtiIdentError::Constant`] for a channel without motion; [`LtiIdentError::NoStart`] if no order could be fitted.
pub fn identify(
    segments: &[Segment],
    clock: Discrete,
    settings: &CheckedInnovationSettings,
    starts: &[StateSpace<Discrete>],
) -> Result<InnovationFit, LtiIdentError> {
    let scaled = Scaled::new(segments, clock, settings)?;
    let settings = settings.get();
    let limits = Limits {
        iterations: settings.max_iterations,
        tolerance: settings.tolerance,
    };
    let response = ImpulseResponse::new(&scaled.problem, settings.response_samples)?;
    let targets: Vec<_> = scaled.problem.runs.iter().map(|r| r.outputs.clone()).collect();
    let realisation = response.realisation(&targets);
    let climb = Climb {
        scaled: &scaled,
        response: &response,
        limits,
    };
    // The climb needs a foot.
    let alone: BTreeSet<usize> = settings.orders.iter().copied().chain([1, 2]).collect();
    let own: Vec<(usize, Vec<Search>)> = alone
        .into_par_iter()
        .map(|order| (order, climb.alone(order, realisation.as_ref(), starts)))
        .collect();
    let mut own: BTreeMap<usize, Vec<Search>> = own.into_iter().collect();
    let mut climbed: BTreeMap<usize, Vec<Search>> = BTreeMap::new();
    for order in 1..=settings.orders.last().copied().unwrap_or(0) {
        let mut searches = own.remove(&order).unwrap_or_default();
        searches.extend(climb.climbed_to(&climbed, order));
        if !searches.is_empty() {
            climbed.insert(order, searches);
        }
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
        .par_iter()
        .map(|(order, searches)| (*order, entry(&scaled, *order, searches, limits)))
        .collect();
    let mut entries = Vec::new();
    for (order, judged) in judged {
        match judged {
            Ok(entry) => entries.push(entry),
            Err(error) => failures.push((order, error)),
        }
    }
    let chosen = choice::chosen(&entries);
    match (chosen, failures.first()) {
        (Some(chosen), _) => Ok(InnovationFit {
            entries,
            failures,
            chosen,
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

/// The search that ended lowest; the first of equals.
fn best(searches: &[Search]) -> Option<&Search> {
    searches
        .iter()
        .min_by(|a, b| a.story.cost.total_cmp(&b.story.cost))
}

struct Climb<'a> {
    scaled: &'a Scaled,
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
        let own = realisation
            .and_then(|r| Some((StartKind::Realisation, r.cut(order, self.scaled.problem.radius)?)));
        given
            .chain(own)
            .filter_map(|(kind, predictor)| Some(self.run(kind, polished(&self.scaled.problem, &predictor)?)))
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
            let start = match climbed.get(&lower).and_then(|s| best(s)) {
                Some(lower) => grown(&self.scaled.problem, &lower.point, self.response, order)?,
                None => return None,
            };
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
        let first_cost = start.cost;
        let outcome = search(&self.scaled.problem, start, &Coordinates::Local, self.limits);
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

    /// Poles and output matrix of a system that was handed in; the rest is polished.
    fn given(&self, system: &StateSpace<Discrete>) -> Option<Predictor> {
        let problem: &Problem = &self.scaled.problem;
        if system.outputs() != problem.outputs() {
            return None;
        }
        let (n, nw, ny) = (system.states(), problem.known(), problem.outputs());
        let c = self.scaled.scaled_rows(system.c());
        let none = DMatrix::zeros(n, nw);
        Predictor::new(
            &reflected(system.a(), problem.radius)?,
            &none,
            &c,
            &DMatrix::zeros(ny, nw),
        )
        .ok()
    }
}

fn entry(
    scaled: &Scaled,
    order: usize,
    searches: &[Search],
    limits: Limits,
) -> Result<OrderEntry, LtiIdentError> {
    let winner = best(searches).ok_or(LtiIdentError::NoStart { order })?;
    let model = scaled.model(&winner.point, limits)?;
    let starts: Vec<StartEntry> = searches.iter().map(|s| s.story).collect();
    let winner_at = starts.iter().position(|s| *s == winner.story).unwrap_or(0);
    let judged = scaled.judge(&model, &winner.point)?;
    let parameters = scaled.parameters(order);
    Ok(OrderEntry {
        order,
        initial_states: winner.point.initial.clone(),
        cost: winner.point.cost,
        winner: winner_at,
        starts,
        parameters,
        expected_cost: choice::expected_cost(&scaled.problem, &winner.point),
        simulated_fit_percent: judged.simulated,
        one_step_fit_percent: judged.one_step,
        simulation_covariance: judged.covariance,
        model,
    })
}
