//! What was found in the data: facts as a type, one sentence each, and how much it matters.
//!
//! Every finding names the record or position, what is wrong, and what to do. [`Severity::Contradiction`] means that no answer from
//! these data can be trusted: the first line of whatever is said about them must be that.

mod told;

pub(crate) use told::{contradictions, lines, serialize, told};

use serde::{Deserialize, Serialize};

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// Deserves attention; the answer is worse for it.
    Warning,
    /// The data contradict themselves or their description: an answer from them cannot be trusted.
    Contradiction,
}

/// One thing that was found, with its facts. `record` is the name of a record, `place` a position or the records there.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Finding {
    /// No record is left to judge a model with.
    #[error("no record has use = \"validation\": nothing is left to judge a model with; hold one out")]
    NothingHeldOut,
    /// Moves with references, and no controller to simulate them.
    #[error("no [controller]: moves cannot be simulated in closed loop; write down its coefficients")]
    NoController,
    /// Many lines hardly stand out of their noise.
    #[error(
        "{place}: an output stands less than {level_db} dB above its noise at {low} of {lines} lines; excite them more or measure more periods"
    )]
    LowSignal {
        /// Position or records.
        place: String,
        /// What counts as low, dB.
        level_db: f64,
        /// Lines below it.
        low: usize,
        /// Lines that are excited.
        lines: usize,
    },
    /// The response is noise.
    #[error(
        "{place}: the frequency response is mostly noise ({percent:.0} % in the median); check `period`, excite more or measure more periods"
    )]
    ResponseIsNoise {
        /// Position or records.
        place: String,
        /// Relative deviation, median over the lines, percent.
        percent: f64,
    },
    /// Too few periods for a covariance.
    #[error("{place}: {periods} steady periods leave the covariance uncertain; measure six or more")]
    FewPeriods {
        /// Position or records.
        place: String,
        /// Periods that were used.
        periods: usize,
    },
    /// The transient takes many periods.
    #[error(
        "{place}: {skipped} of {periods} periods still show the transient; start the record later or measure longer"
    )]
    LongTransient {
        /// Position or records.
        place: String,
        /// Periods left out.
        skipped: usize,
        /// Periods of the record.
        periods: usize,
    },
    /// Inputs that say nearly the same.
    #[error(
        "{place}: the inputs are nearly dependent (condition {condition:.0} at {frequency_hz:.4}); use orthogonal phases in the experiments"
    )]
    DependentInputs {
        /// Position or records.
        place: String,
        /// Largest condition number.
        condition: f64,
        /// Where, cycles per unit of time.
        frequency_hz: f64,
    },
    /// The response of a closed loop from its inputs.
    #[error(
        "{place}: closed loop without a usable reference: the noise that is fed back biases the response; record the excitation"
    )]
    BiasedLoop {
        /// Position or records.
        place: String,
    },
    /// Nonlinear distortion that can be seen.
    #[error(
        "{place}: {parity} nonlinear distortion ({percent:.2} % of the output) above the noise of the response ({noise_percent:.2} %); a linear model cannot be better"
    )]
    Distortion {
        /// Position or records.
        place: String,
        /// `odd` or `even`.
        parity: String,
        /// Of the output, percent.
        percent: f64,
        /// Noise of the response, percent.
        noise_percent: f64,
    },
    /// An excitation that wastes its range.
    #[error(
        "{record}, column `{column}`: a crest factor of {crest_factor:.1}; better phases put more power into the same amplitude"
    )]
    CrestFactor {
        /// The record.
        record: String,
        /// The reference.
        column: String,
        /// Peak over rms.
        crest_factor: f64,
    },
    /// Power close to half the sampling rate.
    #[error(
        "{record}, column `{column}`: {percent:.0} % of the power lies above 0.8 of the Nyquist frequency; check the anti-alias filter"
    )]
    NearNyquist {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// Part of the power, percent.
        percent: f64,
    },
    /// A sensor with large steps.
    #[error(
        "{record}, column `{column}`: readings come in steps of {step:.3e}, {percent:.0} % of the rms; the noise is that of the converter: move further or use a finer sensor"
    )]
    CoarseSensor {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// Step, in the unit of the column.
        step: f64,
        /// Step over the rms, percent.
        percent: f64,
    },
    /// The inputs do not explain an output.
    #[error(
        "{record}: inputs explain less than half of an output's power linearly ({percent:.0} %); disturbances, noise or nonlinearity dominate"
    )]
    Unexplained {
        /// The record.
        record: String,
        /// The part that they explain, percent.
        percent: f64,
    },
    /// One position where the machine moves over many.
    #[error(
        "periodic records at one position only: the model cannot know how the dynamics change; measure at several"
    )]
    OnePosition,
    /// Records beyond the measured positions.
    #[error(
        "records move to [{:.4}, {:.4}], the periodic ones cover [{:.4}, {:.4}]; a model is not known beyond",
        moves[0], moves[1], covered[0], covered[1]
    )]
    BeyondPositions {
        /// Where records go.
        moves: [f64; 2],
        /// Where periodic ones are.
        covered: [f64; 2],
    },
    /// A gap between positions.
    #[error(
        "a gap of {gap:.4} between neighbouring positions, {ratio:.1} times the mean; measure in between"
    )]
    PositionGap {
        /// Width of the gap, in units of p.
        gap: f64,
        /// Over the mean distance.
        ratio: f64,
    },
}

impl Finding {
    /// How much it matters.
    pub fn severity(&self) -> Severity {
        match self {
            Self::NothingHeldOut | Self::NoController | Self::CrestFactor { .. } => Severity::Note,
            _ => Severity::Warning,
        }
    }

    /// The record or position that it is about; empty for the whole bundle.
    pub fn place(&self) -> &str {
        match self {
            Self::LowSignal { place, .. }
            | Self::ResponseIsNoise { place, .. }
            | Self::FewPeriods { place, .. }
            | Self::LongTransient { place, .. }
            | Self::DependentInputs { place, .. }
            | Self::BiasedLoop { place }
            | Self::Distortion { place, .. } => place,
            Self::CrestFactor { record, .. }
            | Self::NearNyquist { record, .. }
            | Self::CoarseSensor { record, .. }
            | Self::Unexplained { record, .. } => record,
            Self::NothingHeldOut
            | Self::NoController
            | Self::OnePosition
            | Self::BeyondPositions { .. }
            | Self::PositionGap { .. } => "",
        }
    }
}
