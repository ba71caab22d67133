//! Errors.

use lpv_core::CoreError;

/// Why there is no modal fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModalFitError {
    /// From lpv-core: a matrix that is singular, a number that is not finite.
    #[error(transparent)]
    Core(#[from] CoreError),
    /// Nothing to fit.
    #[error("modal fit: no {what}")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A pole that no partial fraction takes.
    #[error("modal fit: pole {index}, z = {pole}, is {problem}")]
    Pole {
        /// Index among those given.
        index: usize,
        /// The pole.
        pole: String,
        /// What is wrong, and what to do.
        problem: &'static str,
    },
    /// Integrators that a rigid body does not have.
    #[error("modal fit: {found} integrators; a rigid body has none, one or two")]
    Integrators {
        /// As asked.
        found: usize,
    },
    /// More unknowns than equations.
    #[error("modal fit: {equations} equations for {unknowns} unknowns; use more lines, or fewer modes")]
    TooFewEquations {
        /// Two a line and channel.
        equations: usize,
        /// Of all modes.
        unknowns: usize,
    },
    /// A line without a usable covariance.
    #[error(
        "modal fit: the covariance at {frequency_hz} Hz is not positive definite; average it over more lines"
    )]
    Covariance {
        /// Of the line.
        frequency_hz: f64,
    },
}
