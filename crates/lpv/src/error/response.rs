//! Why a measured frequency response cannot be taken to the model.

/// What does not fit between a measured frequency response, the outputs and the clock of the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResponseProblem {
    /// An output that is no motion.
    #[error(
        "it is of {response}, and output `{output}` is {} {quantity}; leave `quantity` of the record out if the response is of that {quantity}, or correct `quantity` or `units` of the output",
        if *quantity == "other" { "something" } else { "a" }
    )]
    NoMotion {
        /// The output.
        output: String,
        /// What it is.
        quantity: &'static str,
        /// What the response is of.
        response: &'static str,
    },
    /// An acceleration under a force that is held.
    #[error(
        "it is one of continuous time, and output `{output}` is an acceleration, which follows a held force without delay: for a model of the displacement write quantity = [\"position\"] in [channels.output] (the response is taken to it), or quantity = \"acceleration/input\" in the record if it was measured between samples"
    )]
    HeldAcceleration {
        /// The output.
        output: String,
    },
    /// Too few lines for a fit.
    #[error(
        "it has {}, and a fit needs {needed} or more to tell modes from noise; measure more, or hold it out with use = \"validation\"", lpv_core::counted(*found, "line")
    )]
    FewLines {
        /// Lines of the record.
        found: usize,
        /// Least number.
        needed: usize,
    },
    /// Lines that a sampled response does not have.
    #[error(
        "its highest line, {highest_hz} Hz, is not below half of sample_rate = {rate_hz} Hz; correct sample_rate, leave these lines out (`rows`), or, of a response of continuous time, say quantity = \"displacement/force\" and give the model a sample rate of 20 times its highest line"
    )]
    BeyondNyquist {
        /// The highest line.
        highest_hz: f64,
        /// Of the description.
        rate_hz: f64,
    },
    /// A response of continuous time, or of another derivative than the output, too near to the sample rate.
    #[error(
        "as {quantity} it goes up to {highest_hz} Hz, which asks for sample_rate = {needed_hz} Hz or more instead of {rate_hz} Hz, or what folds back is missed; without records of samples it is the rate of the model and free to choose; else leave the lines above out (`rows`), or, of a response between samples, say \".../input\" and give the output its quantity"
    )]
    SlowClock {
        /// What the response is.
        quantity: &'static str,
        /// Its highest line.
        highest_hz: f64,
        /// Of the description.
        rate_hz: f64,
        /// What would do.
        needed_hz: f64,
    },
}
