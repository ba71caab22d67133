//! What can be wrong with a model, a signal or a file.

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoreError {
    /// A number is NaN or infinite.
    #[error("{what}: entry ({row}, {column}) is not a finite number; remove or repair it")]
    NotFinite {
        /// The matrix or signal.
        what: &'static str,
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
    },
    /// Coefficients that are no controller.
    #[error(transparent)]
    Controller(#[from] crate::ControllerFault),
    /// A dimension does not fit the others.
    #[error("{what}: expected {expected}, found {found}")]
    Dimension {
        /// The quantity.
        what: &'static str,
        /// What the other dimensions ask for.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// Two systems that are to be joined tick differently.
    #[error(
        "the clocks differ: Nyquist frequencies {first_nyquist_hz} and {second_nyquist_hz}; sample both systems alike"
    )]
    DifferentClocks {
        /// Of the first system, Hz.
        first_nyquist_hz: f64,
        /// Of the second system.
        second_nyquist_hz: f64,
    },
    /// Two coefficients that are to be added depend on p through different functions.
    #[error("{what}: functions of p differ ({first} and {second}); refit one in the basis of the other")]
    DifferentFunctions {
        /// The two coefficients.
        what: &'static str,
        /// Name of the basis of the first.
        first: &'static str,
        /// Name of the basis of the second.
        second: &'static str,
    },
    /// An iteration that did not end.
    #[error("{operation} did not converge; rescale the states")]
    NoConvergence {
        /// The operation that gave up.
        operation: &'static str,
    },
    /// A sample time that no clock can have.
    #[error("sample time {value}: give a finite number above zero")]
    SampleTime {
        /// The value given.
        value: f64,
    },
    /// Bounds of a scheduling parameter that enclose nothing.
    #[error(
        "scheduling parameter {parameter}: [{lower}, {upper}] is not an interval; give finite bounds, lower < upper, far enough apart for rounding"
    )]
    EmptyRange {
        /// Index of the parameter, from 0.
        parameter: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A scheduling value outside the range that the model is made for.
    #[error(
        "scheduling parameter {parameter} = {value} is outside [{lower}, {upper}]; the model does not extrapolate"
    )]
    OutsideRange {
        /// Index of the parameter, from 0.
        parameter: usize,
        /// The value given.
        value: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A frequency that is negative, not finite, out of order or above Nyquist.
    #[error("frequency {index} = {value_hz}: {problem}")]
    Frequency {
        /// Index in the list, from 0.
        index: usize,
        /// The value, Hz.
        value_hz: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The response is infinite because a pole lies on the line.
    #[error("a pole of the model lies on the frequency line {frequency_hz}; leave this line out")]
    PoleOnLine {
        /// The line, Hz.
        frequency_hz: f64,
    },
    /// The map from w to z of an LFR cannot be inverted.
    #[error("the LFR is not well-posed: I - D11 Delta(p) is singular at p = {p:?}")]
    IllPosed {
        /// The scheduling value.
        p: Vec<f64>,
    },
    /// The LFR is rational in p, so it has no exact polynomial state space.
    #[error(
        "the LFR is rational in p and has no exact polynomial state space; tabulate it with `Lfr::tabulate`"
    )]
    NotPolynomial,
    /// Only polynomials have an exact LFR; of several parameters, only monomials.
    #[error(
        "a {basis} coefficient function has no exact LFR here; refit it with monomials or, for one parameter, a Chebyshev basis"
    )]
    NotRational {
        /// Name of the function basis.
        basis: &'static str,
    },
    /// Knots or grid points that are not strictly increasing.
    #[error("knot {index}: {problem}")]
    Knots {
        /// Index of the offending knot, from 0.
        index: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The system has a pole that does not allow the operation.
    #[error("{operation} needs all poles strictly inside the stable region; pole {pole} is not")]
    Unstable {
        /// The operation refused.
        operation: &'static str,
        /// The offending pole.
        pole: String,
    },
    /// Tustin's map sends a pole to infinity, or a matrix has no inverse.
    #[error("{operation}: the matrix to invert is singular")]
    Singular {
        /// The operation refused.
        operation: &'static str,
    },
    /// Sub-steps of the integrator were halved to the limit without reaching the tolerance.
    #[error(
        "integration: error {error:e} after {substeps} sub-steps a sample is above the tolerance {tolerance:e}; raise the tolerance or shorten the sample time"
    )]
    Integration {
        /// Estimated error.
        error: f64,
        /// Sub-steps tried last.
        substeps: usize,
        /// Tolerance asked for.
        tolerance: f64,
    },
    /// A continuous model much faster than the clock that is to sample it.
    #[error(
        "zero-order hold: the matrices times the sample time have norm {norm:e}, above {largest:e}; shorten the sample time or rescale the states"
    )]
    TooStiff {
        /// Norm of `[A B; 0 0] T`.
        norm: f64,
        /// The largest that is accepted.
        largest: f64,
    },
    /// A model file that cannot be read.
    #[error("model file, line {line}, column {column}: {message}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser or a check said.
        message: String,
    },
    /// A model file of another schema.
    #[error(
        "model file: format `{format}` version {version} is not `lpv-model` version {supported}; export it again with this program's version"
    )]
    Schema {
        /// Format name found.
        format: String,
        /// Version found.
        version: u32,
        /// Version that this crate reads.
        supported: u32,
    },
}
