//! The noise of a sample: what does not repeat, or what no motion makes.

use crate::PipelineError;
use crate::progress::{Counter, Progress};
use experiment_data::{Bundle, DataError};
use lpv_core::{ControllerState, Position, Record};
use lpv_diagnose::{Explained, Track};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// Where the size of the noise is from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseSource {
    /// `periods`, `repeats`, `rest`, `quantisation`, `band` or `assumed`.
    pub source: String,
    /// Whether no model can be better than it; else `over_noise` is only a scale.
    pub is_floor: bool,
}

/// Pairs of channels, by record and sample.
pub(super) type Pairs = Vec<Vec<[f64; 2]>>;

/// What does not repeat from one period to the next, differences over the root of two; near which position.
pub(super) fn unrepeated(bundle: &Bundle, progress: Progress<'_>) -> Result<(f64, Pairs), PipelineError> {
    /// Records that are enough.
    const RECORDS: usize = 4;
    /// Periods in which a transient may still be.
    const FIRST: usize = 2;
    /// Samples of a record that are enough.
    const SAMPLES: usize = 1 << 20;
    let entries = &bundle.description().records;
    let periodic: Vec<usize> = (0..entries.len()).filter(|i| entries[*i].is_periodic()).collect();
    let from = (periodic.len() / 2).saturating_sub(RECORDS / 2);
    let chosen: Vec<usize> = periodic.into_iter().skip(from).take(RECORDS).collect();
    let counter = Counter::new(progress, "reading records", chosen.len());
    let differences = |i: &usize| -> Result<(Option<Position>, Vec<[f64; 2]>), DataError> {
        let (mut before, mut periods): (Option<Record>, usize) = (None, 0);
        let mut all: Vec<Vec<[f64; 2]>> = Vec::new();
        let position = bundle.each_period(*i, |part| {
            if let Some(before) = before.as_ref().filter(|b| all.len() * b.len() < SAMPLES) {
                let pair =
                    |r: &Record, k: usize| [0, 1].map(|i| r.outputs.columns.get(i).map_or(0.0, |y| y[k]));
                let one = |k: usize| {
                    let ([a, b], [c, d]) = (pair(&part, k), pair(before, k));
                    [(a - c) * FRAC_1_SQRT_2, (b - d) * FRAC_1_SQRT_2]
                };
                all.push((0..part.len()).map(one).collect());
            }
            periods += 1;
            before = Some(part);
        })?;
        counter.one();
        // Of two periods even the first counts.
        let first = FIRST.min(periods.saturating_sub(2));
        Ok((position, all.into_iter().skip(first).flatten().collect()))
    };
    let found: Vec<Result<_, DataError>> = chosen.par_iter().map(differences).collect();
    let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
    let positions: Vec<f64> = found
        .iter()
        .filter_map(|(p, _)| p.as_ref().and_then(Position::single))
        .collect();
    let position = positions.iter().sum::<f64>() / positions.len().max(1) as f64;
    let left = found.into_iter().map(|(_, d)| d).filter(|d| !d.is_empty());
    Ok((position, left.collect()))
}

/// Deviation of white noise with the third differences of the outputs, or with those of the errors of a model, which the moves do
/// not enlarge.
pub(super) fn roughness(model: &Explained, controller: &ControllerState, tracks: &[Track]) -> [f64; 2] {
    let third = |records: &[Vec<[f64; 2]>], i: usize| {
        let rows = records.iter().flat_map(|y| y.windows(4));
        lpv_diagnose::roughness(rows.map(|w| [w[0][i], w[1][i], w[2][i], w[3][i]]))
    };
    let outputs: Vec<Vec<[f64; 2]>> = tracks.iter().map(|t| t.outputs.clone()).collect();
    let errors = |track: &Track| -> Option<Vec<[f64; 2]>> {
        let run = model.closed_loop(controller, track)?;
        Some(run.error(track))
    };
    // Where the model diverges the outputs alone tell.
    let errors: Option<Vec<_>> = tracks.iter().map(errors).collect();
    std::array::from_fn(|i| {
        let left = errors.as_ref().map_or(f64::INFINITY, |e| third(e, i));
        third(&outputs, i).min(left)
    })
}
