//! Errors of a model: frozen, open loop, closed loop.

use crate::PipelineError;
use experiment_data::Controller;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, Frf, Record, StateSpace};
use serde::Serialize;

/// The two readings of a relative frozen error: the largest over frequency and position, and the median.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrozenError {
    /// `20 log10 max ||G - F||_F / ||F||_F`.
    pub strict_max_db: f64,
    /// `20 log10` of the median.
    pub median_db: f64,
    /// Frequency of the largest error, cycles per unit of time.
    pub worst_frequency_hz: f64,
    /// Index of the response with the largest error.
    pub worst_response: usize,
}

/// Decibels of an amplitude ratio.
pub fn decibel(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// Compares responses, position by position.
///
/// # Errors
/// Different numbers of responses or lines; nothing to compare.
pub fn frozen_error(model: &[Frf], truth: &[Frf]) -> Result<FrozenError, PipelineError> {
    let mut all = Vec::new();
    let mut worst = (0.0, 0.0, 0);
    for (index, (g, f)) in model.iter().zip(truth).enumerate() {
        let errors = g.relative_error(f)?;
        for (k, &e) in errors.iter().enumerate() {
            if e > worst.0 {
                worst = (e, g.frequencies_hz()[k], index);
            }
        }
        all.extend(errors);
    }
    if all.is_empty() || model.len() != truth.len() {
        return Err(PipelineError::Structure {
            problem: "frozen error: give as many responses of the model as of the truth, at least one",
        });
    }
    all.sort_by(f64::total_cmp);
    Ok(FrozenError {
        strict_max_db: decibel(worst.0),
        median_db: decibel(all[all.len() / 2]),
        worst_frequency_hz: worst.1,
        worst_response: worst.2,
    })
}

/// Error by channel: largest and median of `|G_ij - F_ij| / ||F||_F` over lines and responses, in decibels; relative to the
/// whole matrix at the line, since a single channel may be zero.
///
/// # Errors
/// Different lines or channels; a channel that does not exist.
pub fn channel_error(
    model: &[Frf],
    truth: &[Frf],
    output: usize,
    input: usize,
) -> Result<(f64, f64), PipelineError> {
    let mut all = Vec::new();
    for (g, f) in model.iter().zip(truth) {
        g.relative_error(f)?;
        if output >= f.outputs() || input >= f.inputs() {
            return Err(PipelineError::Structure {
                problem: "error by channel: the responses have no such channel",
            });
        }
        all.extend(
            (0..f.len())
                .map(|k| (g.line(k)[(output, input)] - f.line(k)[(output, input)]).norm() / f.line(k).norm()),
        );
    }
    all.sort_by(f64::total_cmp);
    let median = all.get(all.len() / 2).copied().unwrap_or(f64::NAN);
    Ok((decibel(all.last().copied().unwrap_or(f64::NAN)), decibel(median)))
}

/// A model that can be frozen at any p: what the simulations below need.
pub trait Frozen {
    /// The model at p.
    ///
    /// # Errors
    /// p outside the range.
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, PipelineError>;
}

impl Frozen for lpv_core::LpvStateSpace<Discrete> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, PipelineError> {
        Ok(self.frozen(p)?)
    }
}

impl Frozen for lpv_core::Lfr<Discrete> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, PipelineError> {
        Ok(self.frozen(p)?)
    }
}

/// Response of a model, from rest, to the recorded inputs along the recorded scheduling: `n_y x N`.
///
/// # Errors
/// p outside the range of the model, channels that do not fit.
pub fn open_loop(model: &impl Frozen, record: &Record) -> Result<DMatrix<f64>, PipelineError> {
    simulate(model, record, |k, _, u| {
        for (u, column) in u.iter_mut().zip(&record.inputs.columns) {
            *u = column[k];
        }
        Ok(())
    })
}

/// Response of the model in closed loop with the bundle's controller, from rest, along the recorded references and
/// scheduling: `n_y x N`. The model must be strictly proper.
///
/// # Errors
/// As [`open_loop`]; a controller that does not fit.
pub fn closed_loop(
    model: &impl Frozen,
    controller: &Controller,
    record: &Record,
) -> Result<DMatrix<f64>, PipelineError> {
    let mut state = controller.start()?;
    let mut r = vec![0.0; record.references.channels()];
    simulate(model, record, move |k, y, u| {
        for (r, column) in r.iter_mut().zip(&record.references.columns) {
            *r = column[k];
        }
        state.step(&r, y, u);
        for (u, column) in u.iter_mut().zip(&record.injection.columns) {
            *u += column[k];
        }
        Ok(())
    })
}

/// A direct term below this part of `|C| |B|` is what a realisation leaves of zero.
const ROUNDING: f64 = 1e-12;

fn simulate(
    model: &impl Frozen,
    record: &Record,
    mut input: impl FnMut(usize, &[f64], &mut [f64]) -> Result<(), PipelineError>,
) -> Result<DMatrix<f64>, PipelineError> {
    let mut p = vec![0.0; record.scheduling.channels()];
    let mut outputs = DMatrix::zeros(0, 0);
    let mut x = DVector::zeros(0);
    let mut u = DVector::zeros(record.inputs.channels());
    for k in 0..record.len() {
        for (p, column) in p.iter_mut().zip(&record.scheduling.columns) {
            *p = column[k];
        }
        let frozen = model.at(&p)?;
        if k == 0 {
            if frozen.d().amax() > ROUNDING * frozen.c().amax() * frozen.b().amax() {
                return Err(PipelineError::Structure {
                    problem: "simulation: the model has a direct term; a sampled machine has none",
                });
            }
            if frozen.inputs() != u.len() {
                return Err(PipelineError::Structure {
                    problem: "simulation: the record has another number of inputs than the model",
                });
            }
            x = DVector::zeros(frozen.states());
            outputs = DMatrix::zeros(frozen.outputs(), record.len());
        }
        let y = frozen.c() * &x;
        input(k, y.as_slice(), u.as_mut_slice())?;
        x = frozen.a() * &x + frozen.b() * &u;
        outputs.set_column(k, &y);
    }
    Ok(outputs)
}

/// Root mean square of `simulated - recorded` over the samples that both have, one value an output.
pub fn rms_error(simulated: &DMatrix<f64>, record: &Record) -> Vec<f64> {
    record
        .outputs
        .columns
        .iter()
        .enumerate()
        .take(simulated.nrows())
        .map(|(i, y)| {
            let sum: f64 = y
                .iter()
                .zip(simulated.row(i).iter())
                .map(|(y, s)| (s - y).powi(2))
                .sum();
            (sum / y.len().min(simulated.ncols()).max(1) as f64).sqrt()
        })
        .collect()
}
