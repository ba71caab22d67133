//! Frozen systems on a grid, as many as a file holds.

use crate::PipelineError;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Clock, CoreError, SchedulingRange, StateSpace};

/// A scheduling value and A, B, C, D there.
pub(super) type Frozen = (Vec<f64>, [DMatrix<f64>; 4]);

/// Numbers of all frozen systems together: a text of some hundred megabytes.
const MOST_NUMBERS: u64 = 8_000_000;
/// What a frozen system takes beside its numbers, in numbers.
const SYSTEM: usize = 50;

/// Frozen systems on a grid of so many points a parameter.
fn systems(points: usize, parameters: usize) -> u64 {
    let parameters = u32::try_from(parameters).unwrap_or(u32::MAX);
    (points as u64).saturating_pow(parameters)
}

/// The frozen systems on a grid of `points` values a parameter, counted before they are made. The sizes are states, outputs,
/// inputs.
///
/// # Errors
/// [`PipelineError::Grid`] if they are too many; a model that cannot be frozen somewhere.
pub(super) fn frozen_grid<K: Clock>(
    (states, outputs, inputs): (usize, usize, usize),
    range: &SchedulingRange,
    points: usize,
    frozen: impl Fn(&[f64]) -> Result<StateSpace<K>, CoreError>,
) -> Result<Vec<Frozen>, PipelineError> {
    let parameters = range.parameters();
    let one = (states + outputs) * (states + inputs) + parameters + SYSTEM;
    let fits = |points: usize| systems(points, parameters).saturating_mul(one as u64) <= MOST_NUMBERS;
    if !fits(points) {
        return Err(PipelineError::Grid {
            parameters,
            points,
            systems: (points as f64).powi(parameters as i32),
            most: (2..points).rev().find(|n| fits(*n)),
        });
    }
    let at = |p: Vec<f64>| {
        let s = frozen(&p)?;
        Ok((p, [s.a().clone(), s.b().clone(), s.c().clone(), s.d().clone()]))
    };
    range.grid(points).into_iter().map(at).collect()
}
