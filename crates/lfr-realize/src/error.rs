//! What can be wrong with a realisation.

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
    /// Nothing to compare with.
    #[error("no {what} to verify the realisation on; give at least one")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// From the models.
    #[error(transparent)]
    Core(CoreError),
}

impl From<CoreError> for RealizeError {
    fn from(e: CoreError) -> Self {
        match e {
            CoreError::NotRational { basis } => Self::NotPolynomial { basis },
            other => Self::Core(other),
        }
    }
}
