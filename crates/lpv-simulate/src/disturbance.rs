//! The predictor of a model without a gain of its own.

use crate::{Frozen, Machine, Predictor};
use lpv_core::{Purpose, Record};
use lpv_numerics::statistics::standard_deviation;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Deviation of a white disturbance of the inputs, as a part of their rms, under which the one-step prediction of the first
/// transient record is most likely.
pub fn disturbance(machine: &Machine, transient: &[Record], noise: Option<&[f64]>) -> f64 {
    let record = transient
        .iter()
        .find(|r| r.purpose == Purpose::Estimation)
        .or_else(|| transient.first());
    let Some(record) = record.filter(|_| machine.gain().is_none()) else {
        return 0.0;
    };
    /// Samples that tell decades apart.
    const ENOUGH: usize = 600;
    let errors = |part: f64| predictor(machine, record, part, noise).errors(record, None, ENOUGH);
    likeliest(errors).0
}

/// The part of the inputs under which errors of a prediction are most likely, and these errors.
pub fn likeliest<E: Send>(
    errors: impl Fn(f64) -> Result<DMatrix<f64>, E> + Sync,
) -> (f64, Result<DMatrix<f64>, E>) {
    const TRIED: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];
    const WHERE_NONE_IS: f64 = 1e-3;
    let likelihood = |errors: &Result<DMatrix<f64>, E>| {
        // What is no number would count as no error.
        let errors = errors.as_ref().ok().filter(|e| e.iter().all(|v| v.is_finite()))?;
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
        .filter_map(|&part| {
            let errors = errors(part);
            Some((likelihood(&errors)?, part, errors))
        })
        .reduce_with(|a, b| if b.0 < a.0 { b } else { a })
        .map_or_else(
            || (WHERE_NONE_IS, errors(WHERE_NONE_IS)),
            |(_, part, errors)| (part, errors),
        )
}

/// The Kalman filter for inputs disturbed by the part `part` of their rms, or the model's own gain.
pub fn predictor<'a>(
    machine: &'a Machine,
    record: &Record,
    part: f64,
    noise: Option<&[f64]>,
) -> Predictor<'a, Machine> {
    match machine.gain() {
        Some(gain) => Predictor::with_gain(machine, gain.clone()),
        None => predictor_for_part(machine, record, part, noise),
    }
}

/// The Kalman filter for inputs disturbed by the part `part` of their rms.
pub fn predictor_for_part<'a, M: Frozen>(
    model: &'a M,
    record: &Record,
    part: f64,
    noise: Option<&[f64]>,
) -> Predictor<'a, M> {
    // Without a known noise only its ratio to the disturbance matters, and that is scanned.
    let noise: Vec<f64> = match noise {
        Some(noise) => noise.to_vec(),
        None => record
            .outputs
            .columns
            .iter()
            .map(|y| 1e-3 * standard_deviation(y))
            .collect(),
    };
    let inputs: Vec<f64> = record
        .inputs
        .columns
        .iter()
        .map(|u| part * standard_deviation(u))
        .collect();
    Predictor::for_disturbance(model, &inputs, &noise)
}
