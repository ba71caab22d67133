//! The predictor of a model without a gain of its own.

use super::machine::Machine;
use super::predict::Predictor;
use crate::PipelineError;
use crate::signal::{deviation, range};
use lpv_core::{Purpose, Record};
use rayon::prelude::*;

/// Deviation of a white disturbance of the inputs, as a part of their rms, under which the one-step prediction of the first
/// transient record is most likely; and that record, in words.
pub(super) fn disturbance(machine: &Machine, transient: &[Record], noise: Option<&[f64]>) -> f64 {
    const TRIED: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];
    /// Enough samples to tell decades apart.
    const SAMPLES: usize = 600;
    let record = transient
        .iter()
        .find(|r| r.purpose == Purpose::Estimation)
        .or_else(|| transient.first());
    let Some(record) = record.filter(|_| machine.gain().is_none()) else {
        return 0.0;
    };
    let likelihood = |part: f64| {
        let predictor = predictor(machine, record, part, noise).ok()?;
        let errors = predictor.errors(record, None, SAMPLES).ok()?;
        let sum: f64 = errors
            .row_iter()
            .map(|r| {
                (r.norm_squared() / errors.ncols() as f64)
                    .max(f64::MIN_POSITIVE)
                    .ln()
            })
            .sum();
        sum.is_finite().then_some(sum)
    };
    TRIED
        .par_iter()
        .map(|&part| (likelihood(part).unwrap_or(f64::INFINITY), part))
        .collect::<Vec<_>>()
        .into_iter()
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(TRIED[3], |(_, part)| part)
}

/// Positions at which gains are computed.
const GAIN_POSITIONS: usize = 5;

/// A gain for inputs disturbed by the part `part` of their rms, or the model's own.
pub(super) fn predictor<'a>(
    machine: &'a Machine,
    record: &Record,
    part: f64,
    noise: Option<&[f64]>,
) -> Result<Predictor<'a, Machine>, PipelineError> {
    if let Some(gain) = machine.gain() {
        return Ok(Predictor::with_gain(machine, gain.clone()));
    }
    let positions = match (machine.range(), record.scheduling.columns.first()) {
        (Some(_), Some(p)) => {
            let (low, high) = range(p);
            let steps = if high > low { GAIN_POSITIONS - 1 } else { 0 };
            (0..=steps)
                .map(|i| low + (high - low) * i as f64 / steps.max(1) as f64)
                .collect()
        }
        _ => Vec::new(),
    };
    // Without a known noise only its ratio to the disturbance matters, and that is scanned.
    let noise: Vec<f64> = match noise {
        Some(noise) => noise.to_vec(),
        None => record
            .outputs
            .columns
            .iter()
            .map(|y| 1e-3 * deviation(y))
            .collect(),
    };
    let inputs: Vec<f64> = record
        .inputs
        .columns
        .iter()
        .map(|u| part * deviation(u))
        .collect();
    Predictor::for_disturbance(machine, &positions, &inputs, &noise)
}
