//! Errors of a model: frozen, one step ahead, open loop, closed loop; and what is left in the residuals.

mod bands;
mod check;
mod disturbance;
mod frozen;
mod record;
mod rigid;
mod stable;
mod text;

use crate::PipelineError;
use crate::signal::finite;
pub use bands::Band;
pub use check::{ErrorFigure, Evidence, FrozenCheck, OutputCheck, RecordCheck, Scope, Validation, validate};
pub(crate) use check::{Known, validate_knowing};
pub use frozen::judge_on_responses;
use lpv_core::Frf;
use lpv_numerics::statistics::amplitude_db;
pub(crate) use rigid::check_axis;
pub use rigid::{AxisCheck, ClosedLoopAxis};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub(crate) use stable::stability;

/// The two readings of a relative frozen error: the largest over frequency and position, and the median.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FrozenError {
    /// `20 log10 max ||G - F||_F / ||F||_F`.
    pub strict_max_db: f64,
    /// `20 log10` of the median.
    pub median_db: f64,
    /// Frequency of the largest error, Hz.
    pub worst_frequency_hz: f64,
    /// Index of the response with the largest error.
    pub worst_response: usize,
}

impl FrozenError {
    /// From relative errors, each with its frequency and the index of its response; none of none.
    pub fn of(errors: impl Iterator<Item = (f64, f64, usize)>) -> Option<Self> {
        let mut worst = (0.0, 0.0, 0);
        let mut all: Vec<f64> = errors
            .inspect(|e| {
                if e.0 > worst.0 {
                    worst = *e;
                }
            })
            .map(|e| e.0)
            .collect();
        let middle = all.len() / 2;
        if all.is_empty() {
            return None;
        }
        let (_, median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
        Some(Self {
            strict_max_db: finite(amplitude_db(worst.0)),
            median_db: finite(amplitude_db(*median)),
            worst_frequency_hz: worst.1,
            worst_response: worst.2,
        })
    }
}

/// Compares responses, position by position.
///
/// # Errors
/// Different numbers of responses or lines; nothing to compare.
pub fn frozen_error(model: &[Frf], truth: &[Frf]) -> Result<FrozenError, PipelineError> {
    let refuse = PipelineError::Structure {
        problem: "frozen error: give as many responses of the model as of the truth, at least one",
    };
    if model.len() != truth.len() {
        return Err(refuse);
    }
    let errors = model.iter().zip(truth).map(|(g, f)| g.relative_error(f));
    let errors = errors.collect::<Result<Vec<_>, _>>()?;
    let lines = errors
        .iter()
        .zip(model)
        .enumerate()
        .flat_map(|(index, (errors, g))| {
            let lines = errors.iter().zip(g.frequencies_hz());
            lines.map(move |(error, f)| (*error, *f, index))
        });
    FrozenError::of(lines).ok_or(refuse)
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
    Ok((
        amplitude_db(all.last().copied().unwrap_or(f64::NAN)),
        amplitude_db(median),
    ))
}
