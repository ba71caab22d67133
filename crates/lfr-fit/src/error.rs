//! What can be wrong with a fit.

use lpv_core::CoreError;

/// Every refusal of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Nothing to compare with, or nothing to fit.
    #[error("no {what}; give at least one")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A setting outside its range.
    #[error("setting `{name}` = {value}: {allowed}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Positions of one data set, or a model and its data, that do not fit together.
    #[error("position {index} of the data, {what}: expected {expected}, found {found}")]
    Data {
        /// Index of the position, from 0.
        index: usize,
        /// The quantity.
        what: &'static str,
        /// What the model or the first position asks for.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A line that cannot be weighted.
    #[error("position {index} of the data, line {line} ({frequency_hz}): {problem}")]
    Line {
        /// Index of the position, from 0.
        index: usize,
        /// Index of the line, from 0.
        line: usize,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Fewer real equations than unknowns.
    #[error(
        "{equations} real equations for {unknowns} unknowns; give more lines or positions, or free fewer entries"
    )]
    TooFewEquations {
        /// Two a line and channel.
        equations: usize,
        /// Free entries that no change of coordinates accounts for.
        unknowns: usize,
    },
    /// The model that a fit is to start from has no response at a position of the data.
    #[error("the start of the fit has no response at p = {p:?}: {problem}")]
    Start {
        /// Scheduling value.
        p: Vec<f64>,
        /// Why.
        problem: &'static str,
    },
    /// Records along a moving p that a model cannot be fitted to.
    #[error("moving records: {problem}")]
    Moving {
        /// What is wrong.
        problem: &'static str,
    },
    /// Poles that a local model cannot have.
    #[error("pole {index} = {pole}: {problem}")]
    Pole {
        /// Index in the list given, from 0.
        index: usize,
        /// The pole.
        pole: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A factorisation that did not converge; only numbers near overflow do this.
    #[error("{operation} did not converge; rescale the responses")]
    NoConvergence {
        /// The operation.
        operation: &'static str,
    },
    /// From the models.
    #[error(transparent)]
    Core(#[from] CoreError),
}

impl FitError {
    /// Refuses a value of a setting that is not good.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn unless(good: bool, name: &'static str, value: f64, allowed: &'static str) -> Result<(), Self> {
        match good {
            true => Ok(()),
            false => Err(Self::Setting { name, value, allowed }),
        }
    }
}
