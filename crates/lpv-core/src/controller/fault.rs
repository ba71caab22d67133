//! What makes coefficients no controller.

use std::fmt;

/// What makes coefficients no controller, and which.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerFault {
    /// The field.
    pub key: &'static str,
    /// The loop, then the coefficient, where it is one of them; both from 0.
    pub at: Vec<usize>,
    /// The problem.
    pub problem: ControllerProblem,
}

impl std::error::Error for ControllerFault {}

impl fmt::Display for ControllerFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "controller.{}", self.key)?;
        self.at.iter().try_for_each(|k| write!(f, "[{k}]"))?;
        write!(f, ": {}", self.problem)
    }
}

/// What can be wrong with the coefficients of a controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ControllerProblem {
    /// Coefficients for another number of loops.
    #[error(
        "a list of {found} polynomials for {expected} inputs; give one polynomial for all loops, or one a loop"
    )]
    Loops {
        /// Number of inputs.
        expected: usize,
        /// Lists given.
        found: usize,
    },
    /// A polynomial without coefficients.
    #[error("an empty polynomial; give at least one coefficient")]
    EmptyPolynomial,
    /// A coefficient that is NaN or infinite.
    #[error("{value} is not a finite number")]
    NotFinite {
        /// The coefficient.
        value: f64,
    },
    /// A denominator that starts with zero.
    #[error(
        "the first coefficient of the denominator is zero, so the controller is not causal; leave leading zeros out"
    )]
    NotCausal,
    /// A saturation that is no positive number.
    #[error("limit {value}; it must be finite and above zero")]
    Limit {
        /// The limit.
        value: f64,
    },
}
