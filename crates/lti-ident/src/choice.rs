//! The choice of the order.

use crate::account::OrderEntry;
use crate::problem::{Equations, InitialStates, Point, Problem};
use crate::search::local_directions;

/// The cost plus twice its optimism; infinite where the curvature cannot be inverted.
///
/// Once is what parameters win that have nothing to model but stand where they are put. States that are fitted to noise
/// also choose their frequency, and the maximum over frequencies is larger: with the single price white noise got twice
/// the states that there were.
pub(crate) fn expected_cost(problem: &Problem, point: &Point) -> f64 {
    let directions = local_directions(&point.predictor, problem.direct);
    Equations::new(problem, point, &directions, InitialStates::Estimated)
        .and_then(|equations| Some(point.cost + 2.0 * equations.optimism()?))
        .unwrap_or(f64::INFINITY)
}

/// The order that is expected to do best.
pub(crate) fn chosen(entries: &[OrderEntry]) -> Option<usize> {
    (0..entries.len()).min_by(|&i, &j| entries[i].expected_cost.total_cmp(&entries[j].expected_cost))
}
