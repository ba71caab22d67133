//! The predictor of a model without a gain of its own, also about a simulation with effects.

use super::machine::Machine;
use super::predict::Predictor;
use super::simulate::{Frozen, Run};
use crate::PipelineError;
use crate::signal::deviation;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Continuous, Discrete, Purpose, Record, Signals, StateSpace};
use rayon::prelude::*;
use residual_trace::{Base, Explained};

/// Deviation of a white disturbance of the inputs, as a part of their rms, under which the one-step prediction of the first
/// transient record is most likely.
pub(super) fn disturbance(machine: &Machine, transient: &[Record], noise: Option<&[f64]>) -> f64 {
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

/// Errors of a prediction.
type Errors = Result<DMatrix<f64>, PipelineError>;

/// The part of the inputs under which errors of a prediction are most likely, and these errors.
fn likeliest(errors: impl Fn(f64) -> Errors + Sync) -> (f64, Errors) {
    const TRIED: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];
    const WHERE_NONE_IS: f64 = 1e-3;
    let likelihood = |errors: &Errors| {
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
pub(super) fn predictor<'a>(
    machine: &'a Machine,
    record: &Record,
    part: f64,
    noise: Option<&[f64]>,
) -> Predictor<'a, Machine> {
    match machine.gain() {
        Some(gain) => Predictor::with_gain(machine, gain.clone()),
        None => for_part(machine, record, part, noise),
    }
}

fn for_part<'a, M: Frozen>(
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
            .map(|y| 1e-3 * deviation(y))
            .collect(),
    };
    let inputs: Vec<f64> = record
        .inputs
        .columns
        .iter()
        .map(|u| part * deviation(u))
        .collect();
    Predictor::for_disturbance(model, &inputs, &noise)
}

/// The linear part of a base, sampled.
struct Linear<'a>(&'a Base, Discrete);

impl Frozen for Linear<'_> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, PipelineError> {
        let [a, b, c] = self.0.frozen(p.first().copied().unwrap_or(0.0))?;
        let d = DMatrix::zeros(c.nrows(), b.ncols());
        Ok(StateSpace::new(a, b, c, d, Continuous)?.zero_order_hold(self.1)?)
    }
}

/// Errors of the one-step prediction about a simulation with effects, `n_y x N`: the simulation has what effects do, and the
/// deviation of the record from it follows the linear part of the base, driven by the deviation of the inputs and corrected by a
/// Kalman gain. To first order in that deviation this is the extended Kalman filter whose effects do not change with it.
///
/// # Errors
/// Those of [`Predictor`].
pub(super) fn errors_about(
    explained: &Explained,
    clock: Discrete,
    simulated: &Run,
    record: &Record,
    noise: Option<&[f64]>,
) -> Result<DMatrix<f64>, PipelineError> {
    let base = explained.mounted_base();
    let model = Linear(&base, clock);
    let deviation = Record {
        outputs: less(&record.outputs, &simulated.outputs),
        inputs: less(&record.inputs, &simulated.inputs),
        ..record.clone()
    };
    // The size of the inputs is that of the record.
    let errors = |part: f64| for_part(&model, record, part, noise).errors(&deviation, None, record.len());
    likeliest(errors).1
}

fn less(signals: &Signals, simulated: &DMatrix<f64>) -> Signals {
    let mut left = signals.clone();
    for (column, simulated) in left.columns.iter_mut().zip(simulated.row_iter()) {
        column.iter_mut().zip(simulated.iter()).for_each(|(y, s)| *y -= s);
    }
    left
}
