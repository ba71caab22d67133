//! What can go wrong.

use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TraceError {
    /// There is no base model for these data.
    #[error("no base model: {why}")]
    NoBase {
        /// What is missing.
        why: &'static str,
    },
    /// A record cannot be used.
    #[error("record {record}: {problem}")]
    Record {
        /// Its name.
        record: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// The base model leaves all numbers along a record.
    #[error(
        "record {record}: the base model diverges in closed loop; check signs and units of its inputs and outputs, and of [controller] and [geometry] where the bundle has them"
    )]
    Diverges {
        /// Its name.
        record: String,
    },
    /// Data that contradict themselves, and of which nothing can be told.
    #[error("the data contradict themselves: {what}; so that nothing is told of them: {why}")]
    Contradicted {
        /// The contradictions.
        what: String,
        /// What went wrong.
        why: String,
    },
    /// A definition of a user's effect that is wrong.
    #[error("the effect `{name}` of your own: {problem}")]
    UserEffect {
        /// Its name.
        name: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// Too few records.
    #[error("{what}")]
    TooFew {
        /// What is needed.
        what: &'static str,
    },
    /// A machine that an observer cannot hold at its records.
    #[error(
        "without its controller only an axis with one input, one output and no scheduling is diagnosed: give the bundle its [controller] and \
         [channels.reference]"
    )]
    NoController,
    /// Inputs and positions that are not those of axes that each move by themselves.
    #[error(
        "without its controller a machine of several axes is diagnosed where each input moves a position of its own: there are {inputs} \
         inputs, and {positions} positions that do not move together; make a bundle of the axes that move by themselves, or give the \
         bundle its [controller] and [channels.reference]"
    )]
    Axes {
        /// Inputs.
        inputs: usize,
        /// Positions that do not move together.
        positions: usize,
    },
    /// An input that is not the force of one position.
    #[error(
        "without its controller a machine of several axes is diagnosed where each input moves a position of its own: the best for {input} is \
         {output}, whose motion explains {percent:.0} % of its square; make a bundle of the axes that move by themselves, or give the \
         bundle its [controller] and [channels.reference]"
    )]
    Coupled {
        /// The input.
        input: String,
        /// The output that it moves, if any.
        output: String,
        /// Part of the squared input that the motion explains by inertia and friction, percent.
        percent: f64,
    },
    /// Of lti-ident.
    #[error(transparent)]
    Lti(#[from] lti_ident::LtiIdentError),
    /// Of lpv-core.
    #[error(transparent)]
    Core(#[from] lpv_core::CoreError),
}
