//! The state in which a record begins.

use crate::SimulateError;
use crate::machine::Machine;
use crate::run::{Frozen, Steps, open_loop};
use lpv_core::Record;
use lpv_core::linalg::svd;
use lpv_numerics::statistics::range;
use nalgebra::{DMatrix, DVector};

/// Whether the record starts at the rest of the model: outputs at their offset, inputs near theirs.
pub fn at_rest(machine: &Machine, record: &Record, noise: Option<&[f64]>) -> bool {
    /// Part of the range of a signal that counts as nothing.
    const NOTHING: f64 = 1e-3;
    let offset = |which: usize, i: usize| {
        machine
            .offsets()
            .map_or(0.0, |(u, y)| if which == 0 { u[i] } else { y[i] })
    };
    let near = |x: &[f64], offset: f64, noise: f64| {
        let (low, high) = range(x);
        (x[0] - offset).abs() <= (5.0 * noise).max(NOTHING * (high - low))
    };
    record
        .outputs
        .columns
        .iter()
        .enumerate()
        .all(|(i, y)| near(y, offset(1, i), noise.map_or(0.0, |n| n[i])))
}

/// The first state by least squares over the first samples, directions that hardly show left at zero, and all where the model grows beyond the
/// range of numbers within them.
pub fn first_state(machine: &Machine, record: &Record) -> Result<DVector<f64>, SimulateError> {
    const TOLERANCE: f64 = 1e-4;
    let steps = Steps::new(machine, record);
    let first = steps.at(0)?;
    let (n, ny) = (first.states(), first.outputs());
    if n == 0 {
        return Ok(DVector::zeros(0));
    }
    let samples = (5 * n).max(50).min(record.len());
    let mut short = record.clone();
    short.truncate(samples);
    let forced = open_loop(machine, &short, None)?.outputs;
    let mut observed = DMatrix::zeros(samples * ny, n);
    let mut right = DVector::zeros(samples * ny);
    let mut product = DMatrix::identity(n, n);
    for k in 0..samples {
        let frozen = steps.at(k)?;
        observed.rows_mut(k * ny, ny).copy_from(&(frozen.c() * &product));
        for i in 0..ny {
            right[k * ny + i] = record.outputs.columns[i][k] - forced[(i, k)];
        }
        product = frozen.a() * product;
    }
    // What grows without bound within these samples tells nothing of the start.
    let Ok(svd) = svd(observed) else {
        return Ok(DVector::zeros(n));
    };
    let largest = svd.singular_values.max();
    let found = svd.solve(&right, TOLERANCE * largest).ok();
    let is_one = |x: &DVector<f64>| x.iter().all(|v| v.is_finite());
    Ok(found.filter(is_one).unwrap_or_else(|| DVector::zeros(n)))
}
