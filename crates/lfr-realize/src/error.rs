//! What can be wrong with a realisation, a reduction or a bound.

use lfr_fit::FitError;
use lpv_core::CoreError;

/// Every refusal of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RealizeError {
    /// The coefficient functions are not polynomials.
    #[error(
        "the model's coefficients are {basis} functions of p, which no finite LFR equals; interpolate with a polynomial or Chebyshev kind before realising"
    )]
    NotPolynomial {
        /// Name of the function basis.
        basis: &'static str,
    },
    /// An LFR that cannot be reduced.
    #[error("no reduction, at p = {p:?}: {problem}")]
    Reduction {
        /// Scheduling value.
        p: Vec<f64>,
        /// Why.
        problem: &'static str,
    },
    /// From the fit to frozen responses.
    #[error(transparent)]
    Fit(#[from] FitError),
}

impl From<CoreError> for RealizeError {
    fn from(e: CoreError) -> Self {
        match e {
            CoreError::NotRational { basis } => Self::NotPolynomial { basis },
            other => Self::Fit(FitError::Core(other)),
        }
    }
}
