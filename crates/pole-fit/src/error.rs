//! What can be wrong with a fit.

use lpv_core::CoreError;

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoleFitError {
    /// A refusal of the core types: a frequency above Nyquist, a dimension, a number that is not finite.
    #[error(transparent)]
    Core(#[from] CoreError),
    /// The order leaves no room for the fixed integrators, is zero and strictly proper, or is too high to be meant.
    #[error(
        "order {order} with {integrators} fixed integrators: give integrators <= order <= {limit}, above 0 if strictly proper"
    )]
    Order {
        /// Degree of the denominator asked for.
        order: usize,
        /// Fixed integrators in it.
        integrators: usize,
        /// Highest order accepted.
        limit: usize,
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
    /// The FRF has no outputs, no inputs or no lines, or no order was asked for.
    #[error("{what}: nothing there; give at least one")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// No line lies in the band.
    #[error("no line lies in [{lower_hz}, {upper_hz}]; the estimate has {lines} lines, widen the band")]
    EmptyBand {
        /// Lower limit, Hz.
        lower_hz: f64,
        /// Upper limit, Hz.
        upper_hz: f64,
        /// Lines of the estimate.
        lines: usize,
    },
    /// Fewer real equations than unknowns.
    #[error(
        "order {order}: {equations} real equations for {unknowns} unknowns; use more lines or a lower order"
    )]
    TooFewLines {
        /// Degree of the denominator.
        order: usize,
        /// Real equations (two a line and channel).
        equations: usize,
        /// Real unknowns.
        unknowns: usize,
    },
    /// The polynomials cannot be told apart on the lines.
    #[error("no polynomial of degree {degree} is independent of the lower ones on {lines} lines")]
    Basis {
        /// Degree that failed.
        degree: usize,
        /// Lines used.
        lines: usize,
    },
    /// The covariance was estimated from too little to be inverted.
    #[error(
        "the covariance has {found} degrees of freedom, its inverse needs more than {needed}: smooth it over more lines or choose `DiagonalCovariance` or `Relative` weights"
    )]
    DegreesOfFreedom {
        /// Complex degrees of freedom after smoothing.
        found: f64,
        /// What they must exceed.
        needed: f64,
    },
    /// The response is zero on every line.
    #[error("the response is zero on every line used; there is nothing to fit")]
    ZeroResponse,
    /// A number overflowed on the way.
    #[error("{what} overflows at line {line} ({frequency_hz}); rescale the response and its covariance")]
    Overflow {
        /// The quantity.
        what: &'static str,
        /// Index of the line in the estimate, from 0.
        line: usize,
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// The linear problem for the numerators could not be solved.
    #[error(
        "order {order}: the numerators cannot be determined (their normal matrix is not positive definite); use a lower order or more lines"
    )]
    Numerators {
        /// Degree of the denominator.
        order: usize,
    },
    /// An eigenvalue iteration failed.
    #[error("order {order}: {what} cannot be computed; use another order")]
    Eigenvalues {
        /// Degree of the denominator.
        order: usize,
        /// The quantity.
        what: &'static str,
    },
}
