//! One-step prediction about a simulation with effects.

use lpv_core::nalgebra::DMatrix;
use lpv_core::{Continuous, Discrete, Record, Signals, StateSpace};
use lpv_diagnose::{Base, Explained};
use lpv_simulate::{Frozen, Run, SimulateError, likeliest, predictor_for_part};

/// The linear part of a base, sampled.
struct Linear<'a>(&'a Base, Discrete);

impl Frozen for Linear<'_> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
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
) -> Result<DMatrix<f64>, SimulateError> {
    let base = explained.mounted_base();
    let model = Linear(&base, clock);
    let deviation = Record {
        outputs: less(&record.outputs, &simulated.outputs),
        inputs: less(&record.inputs, &simulated.inputs),
        ..record.clone()
    };
    // The size of the inputs is that of the record.
    let errors =
        |part: f64| predictor_for_part(&model, record, part, noise).errors(&deviation, None, record.len());
    likeliest(errors).1
}

fn less(signals: &Signals, simulated: &DMatrix<f64>) -> Signals {
    let mut left = signals.clone();
    for (column, simulated) in left.columns.iter_mut().zip(simulated.row_iter()) {
        column.iter_mut().zip(simulated.iter()).for_each(|(y, s)| *y -= s);
    }
    left
}
