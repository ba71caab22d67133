//! Why a model does not run along a record.

/// Every refusal of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A model of another sample time than the records.
    #[error(
        "the model has the sample time {model}, the records {records}; identify one at this rate, or convert the model"
    )]
    Clock {
        /// Of the model.
        model: f64,
        /// Of the records.
        records: f64,
    },
    /// Model and record do not fit, or the model cannot do what is asked.
    #[error("{problem}")]
    Structure {
        /// What does not fit, and what to do.
        problem: &'static str,
    },
    /// Of lpv-core.
    #[error(transparent)]
    Core(#[from] lpv_core::CoreError),
}
