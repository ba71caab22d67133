//! What can be wrong with a layout, a setting or a record.

use lpv_core::CoreError;

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrfError {
    /// A refusal of lpv-core: wrong dimensions or numbers that are not finite.
    #[error(transparent)]
    Core(#[from] CoreError),
    /// A setting outside its range.
    #[error("setting `{setting}` = {value}: {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// The value given.
        value: f64,
        /// The range that is allowed.
        expected: &'static str,
    },
    /// A layout that describes no experiment.
    #[error("layout: `{field}` = {value}: {expected}")]
    Layout {
        /// Name of the field.
        field: &'static str,
        /// The value given.
        value: f64,
        /// The range that is allowed.
        expected: &'static str,
    },
    /// No record was given.
    #[error("no record: give at least one")]
    NoRecords,
    /// A record that does not belong with the first one.
    #[error(
        "record {record} (`{name}`): {what} is {found}, in the first record it is {expected}; estimate it apart"
    )]
    Mismatch {
        /// Index of the record, from 0.
        record: usize,
        /// Its name.
        name: String,
        /// The quantity that differs.
        what: &'static str,
        /// Value in the first record.
        expected: f64,
        /// Value in this record.
        found: f64,
    },
    /// A record of the wrong kind.
    #[error(
        "record {record} (`{name}`) is not periodic; use the local polynomial or the local rational method"
    )]
    NotPeriodic {
        /// Index of the record, from 0.
        record: usize,
        /// Its name.
        name: String,
    },
    /// A stream cannot look ahead.
    #[error("`SkipRule::Auto` needs whole records; give the accumulator `SkipRule::Fixed`")]
    AutoSkipNeedsRecords,
    /// A block of an experiment that the layout does not have.
    #[error("block of experiment {experiment}: the layout has {experiments} experiments, counted from 0")]
    UnknownExperiment {
        /// Experiment of the block.
        experiment: usize,
        /// Experiments in the layout.
        experiments: usize,
    },
    /// A period out of order.
    #[error(
        "experiment {experiment}: period {found} came where period {expected} was due; push periods in order, each once"
    )]
    PeriodOrder {
        /// Experiment of the block.
        experiment: usize,
        /// The period that was due.
        expected: usize,
        /// The period of the block.
        found: usize,
    },
    /// A block or record with the wrong number of channels or samples.
    #[error("experiment {experiment}, {what}: expected {expected}, found {found}")]
    BlockShape {
        /// Experiment of the block.
        experiment: usize,
        /// What was counted.
        what: &'static str,
        /// What the layout asks for.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A sample that is NaN or infinite.
    #[error(
        "experiment {experiment}, {what} {channel}, sample {sample} of its period or record: not a finite number; remove or repair it"
    )]
    NotFinite {
        /// Experiment or record, from 0.
        experiment: usize,
        /// Output, input or reference.
        what: &'static str,
        /// Channel, from 0.
        channel: usize,
        /// Sample, from 0, within the period or record.
        sample: usize,
    },
    /// Fewer than two periods are left, so there is no noise estimate.
    #[error(
        "experiment {experiment}: {used} periods left after {skipped} were skipped; two are the least, record more or skip fewer"
    )]
    TooFewPeriods {
        /// The experiment.
        experiment: usize,
        /// Periods used.
        used: usize,
        /// Periods skipped.
        skipped: usize,
    },
    /// Fewer experiments than inputs.
    #[error(
        "{experiments} experiments cannot tell {inputs} inputs apart; record at least {inputs}, with independent excitation"
    )]
    TooFewExperiments {
        /// Experiments in the layout.
        experiments: usize,
        /// Inputs of the plant.
        inputs: usize,
    },
    /// References were asked for as instruments, but their number is not that of the inputs.
    #[error(
        "{references} references cannot be the instruments of {inputs} inputs; record as many, or use `Instrument::Inputs`"
    )]
    References {
        /// References recorded.
        references: usize,
        /// Inputs of the plant.
        inputs: usize,
    },
    /// No line carries excitation.
    #[error(
        "no excited line: {what} carries nothing above the threshold; check the channel, or list the lines"
    )]
    NoExcitation {
        /// The signal that was judged.
        what: &'static str,
    },
    /// A line outside the record, out of order, or a real one (zero and Nyquist).
    #[error(
        "line {line} (entry {entry} of the list): lines increase strictly from 1 to {last}; zero and Nyquist are left out"
    )]
    Line {
        /// Position in the list, from 0.
        entry: usize,
        /// The line.
        line: usize,
        /// The last line allowed.
        last: usize,
    },
    /// The experiments do not tell the inputs apart at a line.
    #[error(
        "line {line} ({frequency_hz} Hz): U R^H is singular (condition number {condition:.3e}); leave the line out or excite all inputs independently there"
    )]
    Singular {
        /// Index of the line.
        line: usize,
        /// Its frequency, Hz.
        frequency_hz: f64,
        /// Condition number of the scaled matrix.
        condition: f64,
    },
    /// A record too short for the window of a local method.
    #[error(
        "the record has {available} lines, a window of {window} lines with {unknowns} unknowns is needed; record longer or lower the degrees"
    )]
    WindowTooWide {
        /// Lines of the record without zero and Nyquist.
        available: usize,
        /// Lines in the window asked for.
        window: usize,
        /// Unknowns of the local model for one output.
        unknowns: usize,
    },
    /// The regressors of a local method are dependent.
    #[error(
        "line {line} ({frequency_hz} Hz): the local regressors are linearly dependent (condition number {condition:.3e}); excite all inputs, use more records or a wider window"
    )]
    LocalRank {
        /// Index of the line.
        line: usize,
        /// Its frequency, Hz.
        frequency_hz: f64,
        /// Ratio of the largest to the smallest diagonal entry of R.
        condition: f64,
    },
    /// The Fourier transform refused its buffers.
    #[error("Fourier transform: {0}")]
    Fft(#[from] realfft::FftError),
}
