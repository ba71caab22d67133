//! What can be wrong with an identification.

use lpv_core::{CoreError, counted};

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
        "input `{input}` and output `{output}`: inertia {inertia:e} (standard deviation {deviation:.1e}) is not above zero; the axis does not accelerate enough, this input does not drive this output, or the output is a speed, which quantity = [\"speed\"] in [channels.output] would say"
    )]
    Inertia {
        /// The input.
        input: String,
        /// The output.
        output: String,
        /// The estimate.
        inertia: f64,
        /// Its standard deviation.
        deviation: f64,
    },
    /// An axis whose force stands out of what inverse dynamics leaves at no frequency.
    #[error(
        "input `{input}` and output `{output}`: at no frequency does the force stand out of what inertia and friction leave of it, so that noise would set the inertia; excite with larger motion or higher frequencies, give references, or set a regression cut-off near {force_band_hz:.3} Hz, below which the force has its power"
    )]
    NotExcited {
        /// The input.
        input: String,
        /// The output.
        output: String,
        /// Frequency below which the force has its power.
        force_band_hz: f64,
    },
    /// An input that drives the axis backwards.
    #[error(
        "input `{input}` and output `{output}` have opposite signs: a positive input accelerates the output backwards (inertia {inertia:.4e}, standard deviation {deviation:.1e}); set scale = [-1.0] in [channels.input], -1.0 at the place of `{input}`"
    )]
    OppositeSigns {
        /// The input.
        input: String,
        /// The output.
        output: String,
        /// The estimate, below zero.
        inertia: f64,
        /// Its standard deviation.
        deviation: f64,
    },
    /// An output that follows the force as a speed does.
    #[error(
        "output `{output}` looks like a speed and not like a position: J v' + F v explains {speed_percent:.0} % of the force of `{input}`, J q'' + F q' only {position_percent:.0} %; if it is one, say so: quantity = [\"speed\"] in [channels.output], with format = 2, or a unit such as rad/s; else identify without --structure rigid-body"
    )]
    SpeedOutput {
        /// The input.
        input: String,
        /// The output.
        output: String,
        /// Part of the force that a speed explains, percent.
        speed_percent: f64,
        /// Part that a position explains, percent.
        position_percent: f64,
    },
    /// Rigid-body axes of a machine with other numbers of inputs and outputs.
    #[error(
        "a rigid-body axis needs one output for each input; the bundle has {} ({}) and {} ({}): name as many outputs as inputs in [channels]",
        counted(inputs.len(), "input"), inputs.join(", "), counted(outputs.len(), "output"), outputs.join(", ")
    )]
    Axes {
        /// Names of the inputs.
        inputs: Vec<String>,
        /// Names of the outputs.
        outputs: Vec<String>,
    },
}
