//! What was found in the data: facts as a type, one sentence each, and how much it matters.
//!
//! Every finding names the record or position, what is wrong, and what to do. [`Severity::Contradiction`] means that no answer from
//! these data can be trusted: the first line of whatever is said about them must be that.

mod clock;
mod compare;
mod copies;
mod dead_time;
mod facts;
mod held;
mod jump;
#[cfg(test)]
mod kit;
mod loop_only;
mod of_place;
mod periods;
mod places;
mod replay;
mod saturation;
mod together;
mod told;
mod transient;
mod watch;
mod wrap;

pub(crate) use compare::Voice;
pub(crate) use of_place::{compare_measured, saturations, voices};
pub(crate) use together::{clocks, examine};
pub(crate) use told::{Row, contradictions, explanations, lines, serialize, told};
pub(crate) use watch::{Look, Watch};

use lpv_core::counted;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
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
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Finding {
    /// No record is left to judge a model with.
    #[error("no record has use = \"validation\": nothing is left to judge a model with; hold one out")]
    NothingHeldOut,
    /// A held-out record that a model was made from as well.
    #[error(
        "{record}: use = \"validation\", and the same samples stand in {of}, which is for estimation: it judges nothing; hold out a measurement of its own"
    )]
    HeldOutCopy {
        /// The record.
        record: String,
        /// The one that it is a copy of.
        of: String,
    },
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
        /// Where, Hz.
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
        "{record}: inputs explain little of an output's power linearly ({percent:.0} %); disturbances, noise or nonlinearity dominate"
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
    /// A log that repeats values.
    #[error(
        "{record}, column `{column}`: each value is held for {} samples; {}",
        (samples * 100.0).round() / 100.0,
        if *every { "the log runs faster than what it logs: keep one row of each value, and divide `sample_rate` by as much" }
        else if *wrong { "the other signals change with each sample: log this one at the full rate, or keep the rows in which it is new and set `sample_rate` to theirs" }
        else { "right where the actuator holds it; otherwise log it at the full rate" }
    )]
    HeldSamples {
        /// The record.
        record: String,
        /// The column.
        column: String,
        /// Samples for which a value is held, on average.
        samples: f64,
        /// Whether inputs and outputs all do.
        every: bool,
        /// Whether no machine does that.
        wrong: bool,
    },
    /// A counter that runs over.
    #[error(
        "{record}, column `{column}`: jumps by {modulus} {}, first in row {row}: a counter that runs over; add or subtract {modulus} from there on (unwrap), and read the record again",
        counted(*times, "time")
    )]
    CounterWraps {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// Range of the counter, in the unit of the column.
        modulus: f64,
        /// How often it ran over.
        times: usize,
        /// First row behind the first jump, from 1.
        row: usize,
    },
    /// A position that jumps.
    #[error(
        "{record}, column `{column}`: jumps by {size:.3e} {}, first in row {row}, many times what it moves in any other sample: the sensor lost its place, a reading is wrong, or samples are missing; cut the record there, or mend the reading",
        counted(*times, "time")
    )]
    PositionJumps {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// The largest jump, in the unit of the column.
        size: f64,
        /// How often it jumps.
        times: usize,
        /// First row behind the first jump, from 1.
        row: usize,
    },
    /// Missing samples.
    #[error(
        "{record}, column `{column}`: {} missing, the first behind row {row}; cut the record there, or measure again without loss",
        counted(*samples, "sample")
    )]
    LostSamples {
        /// The record.
        record: String,
        /// The column of times or numbers.
        column: String,
        /// How many.
        samples: usize,
        /// Row before the first gap, from 1.
        row: usize,
    },
    /// Times whose steps are not those of the sample rate.
    #[error(
        "{record}, column `{column}`: its steps are those of {hz:.6} Hz, and sample_rate says {sample_rate:.6}; correct sample_rate, or make one bundle for each rate"
    )]
    OtherRate {
        /// The record.
        record: String,
        /// The column of times.
        column: String,
        /// The rate of the column, Hz.
        hz: f64,
        /// That of the bundle, Hz.
        sample_rate: f64,
    },
    /// Times that stand still or go back.
    #[error(
        "{record}, column `{column}`: stands still or goes back {}, first behind row {row}; leave out the rows that are there twice, or sort them",
        counted(*times, "time")
    )]
    DoubleSamples {
        /// The record.
        record: String,
        /// The column of times or numbers.
        column: String,
        /// How often.
        times: usize,
        /// Row before the first of them, from 1.
        row: usize,
    },
    /// A controller that does not give the logged inputs.
    #[error(
        "{record}, column `{column}`: [controller] does not give the logged commands: {percent:.0} % of them are left when it is replayed; {}",
        factors.map_or("check its coefficients, their sign, the units of y and r, and whether an injection was logged".to_owned(), |f| f.to_string())
    )]
    ControllerMismatch {
        /// The record.
        record: String,
        /// The input.
        column: String,
        /// What is left of the input, percent of it.
        percent: f64,
        /// Factors on both paths with which it fits.
        factors: Option<Paths>,
    },
    /// Closed loop without excitation.
    #[error(
        "{record}: `{input}` follows from `{output}` exactly: as a controller makes it, or as a force does from an acceleration that is free of noise; a closed loop without excitation tells the controller and nothing of the machine: move the reference or inject a signal, and log it"
    )]
    FeedbackOnly {
        /// The record.
        record: String,
        /// The input.
        input: String,
        /// The output.
        output: String,
    },
    /// A period that is not that of the excitation.
    #[error(
        "{record}, column `{column}`: the excitation has a period of {period:.4} samples, not the one declared, and drifts against the sample clock (by {turn:.2} rad over the record); take both from one clock, or resample to a whole number of samples a period"
    )]
    PeriodDrifts {
        /// The record.
        record: String,
        /// The column that shows it best.
        column: String,
        /// The true period, samples.
        period: f64,
        /// Turn of the phase over the record, rad.
        turn: f64,
        /// Whether no answer can be trusted.
        grave: bool,
    },
    /// A level that drifts.
    #[error(
        "{record}, column `{column}`: the level drifts by {rise:.3e} a period ({percent:.1} % of the motion); a straight drift is taken out of the response: look after the sensor"
    )]
    LevelDrifts {
        /// The record.
        record: String,
        /// The column.
        column: String,
        /// Rise over a period, in its unit.
        rise: f64,
        /// The same over the rms of the motion, percent.
        percent: f64,
    },
    /// A command that the machine did not follow.
    #[error(
        "{record}, column `{column}`: the machine does not follow the command beyond {level:.4}: cut there, the response is smooth ({smooth_percent:.2} % from line to line instead of {percent:.1} %), so the amplifier saturates; log what acts behind it, cut the column at that level, or lower the amplitude"
    )]
    CommandSaturates {
        /// The record.
        record: String,
        /// The input.
        column: String,
        /// Where it saturates, in the unit of the input.
        level: f64,
        /// Median jump of the response from line to line, percent.
        percent: f64,
        /// The same with the command cut.
        smooth_percent: f64,
    },
    /// A reference that is the input.
    #[error(
        "{record}, column `{column}`: the reference is the input itself and tells nothing beside it; it is not used as one"
    )]
    ReferenceIsInput {
        /// The record.
        record: String,
        /// The reference.
        column: String,
    },
    /// An output that follows late.
    #[error(
        "{record}, column `{column}`: follows the input {samples} samples late; a model holds a dead time as so many states; shift the column forward by as many rows and add the delay to the model"
    )]
    DeadTime {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// How late.
        samples: usize,
    },
    /// An output that drifts.
    #[error(
        "{record}, column `{column}`: the level moves by {rise:.3e} over the record in a straight line, whatever the inputs do: a drift of the sensor, or an axis that runs free; of a sensor, take the line out of the column, or the model explains it by a slow mode"
    )]
    Trend {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// Rise over the record, in its unit.
        rise: f64,
    },
    /// A level that is not that of the records behind the model.
    #[error(
        "{record}, column `{column}`: lies {level:.3e} off what the model gives, all along ({percent:.1} % of the motion), and without this constant the error is {percent_left:.2} %: the zero of the sensor or a constant force is not that of the records behind the model; take the constant out of the column, or measure both with one zero"
    )]
    LevelDiffers {
        /// The record.
        record: String,
        /// The output.
        column: String,
        /// Mean of the error, in its unit.
        level: f64,
        /// The same, percent of the motion.
        percent: f64,
        /// Error without it, percent of the motion.
        percent_left: f64,
    },
    /// A response that stands out at few of its lines.
    #[error(
        "{place}: the response stands out of its noise at {good} of {lines} lines only, {:.4} to {:.4}; what is said of the others counts for little",
        band[0], band[1]
    )]
    FewGoodLines {
        /// Position or records.
        place: String,
        /// Lines where it does.
        good: usize,
        /// Lines that are excited.
        lines: usize,
        /// Lowest and highest of the good lines, Hz.
        band: [f64; 2],
    },
    /// One record of several with another sign or unit.
    #[error(
        "{record}, column `{column}`{}: {} those of the other records; {}",
        if *sure { "" } else { " or the input" },
        if *factor == -1.0 { "has the opposite sign of".to_owned() } else { format!("is {factor:.4} times") },
        if *records == 2 { "one of the two has another sign or unit: scale its column before reading" }
        else { "another sign or unit: divide the column by this in this record" }
    )]
    RecordStandsApart {
        /// The record.
        record: String,
        /// The column.
        column: String,
        /// How it stands to the others.
        factor: f64,
        /// Records compared.
        records: usize,
        /// Whether references tell that it is this column; else it may be an input.
        sure: bool,
    },
    /// Records of one place that are not of one machine.
    #[error(
        "{place}: {records} records are taken as one place and their responses disagree by {percent:.0} % (noise {noise_percent:.1} %), {record} most: name the position's column in [channels.scheduling] if they were measured at different places; else the amplitude (friction, backlash), a sign, a unit or the machine has changed between them"
    )]
    RecordsDisagree {
        /// Position or records.
        place: String,
        /// The record that differs most.
        record: String,
        /// How many there are.
        records: usize,
        /// Difference, percent of the response.
        percent: f64,
        /// What noise makes, percent.
        noise_percent: f64,
    },
    /// One position in another unit.
    #[error(
        "{record}: its position {position:.6} lies far outside that of all others, {:.6} to {:.6}{}",
        others[0], others[1],
        factor.map_or("; correct its scheduling column".to_owned(), |f| format!("; in their unit it would be {:.6}: multiply its scheduling column by {f}", position * f))
    )]
    PositionStandsApart {
        /// The record.
        record: String,
        /// Middle of its scheduling.
        position: f64,
        /// Range of the others.
        others: [f64; 2],
        /// Factor that brings it among them.
        factor: Option<f64>,
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

/// Factors on the two paths of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Paths {
    /// From the reference.
    pub reference: Option<f64>,
    /// From the output.
    pub output: f64,
}
