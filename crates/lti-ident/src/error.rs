//! What can be wrong with an identification.

use lpv_core::CoreError;

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LtiIdentError {
    /// A refusal of the core types: a dimension, a number that is not finite.
    #[error(transparent)]
    Core(#[from] CoreError),
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
    /// There are no segments, or records without inputs or outputs.
    #[error("{what}: nothing there; give at least one")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// The samples asked for are not in the record.
    #[error(
        "segment {segment} asks for samples {start} to {end} of {samples}; give start < end <= {samples}"
    )]
    Range {
        /// Index of the segment, from 0.
        segment: usize,
        /// First sample.
        start: usize,
        /// One past the last sample.
        end: usize,
        /// Samples of the record.
        samples: usize,
    },
    /// Segments that do not have the same channels.
    #[error("segment {segment} has {found} {what}, the first has {expected}; identify one machine at a time")]
    Channels {
        /// Index of the segment, from 0.
        segment: usize,
        /// Inputs or outputs.
        what: &'static str,
        /// Number in the first segment.
        expected: usize,
        /// Number here.
        found: usize,
    },
    /// A signal that says nothing.
    #[error("{what} {channel} (from 0) is constant; leave the channel out")]
    Constant {
        /// Input or output.
        what: &'static str,
        /// Index of the channel, from 0.
        channel: usize,
    },
    /// Fewer equations than unknowns.
    #[error("{what}: {equations} equations for {unknowns} unknowns; use more samples or a lower order")]
    TooFewSamples {
        /// What was to be estimated.
        what: &'static str,
        /// Equations available.
        equations: usize,
        /// Unknowns.
        unknowns: usize,
    },
    /// A least-squares problem whose unknowns cannot be told apart.
    #[error("{what}: the data do not tell the unknowns apart; excite the machine more richly")]
    Singular {
        /// What was to be estimated.
        what: &'static str,
    },
    /// No start gave a stable model with a finite cost.
    #[error("order {order}: no start gave a stable model; use another order or give a start")]
    NoStart {
        /// Number of states.
        order: usize,
    },
    /// Least squares gave an inertia that no mass has.
    #[error(
        "axis {axis}: inertia {inertia} is not above zero; the axis does not accelerate enough, or input {axis} does not drive output {axis}"
    )]
    Inertia {
        /// Index of the axis, from 0.
        axis: usize,
        /// The estimate.
        inertia: f64,
    },
}
