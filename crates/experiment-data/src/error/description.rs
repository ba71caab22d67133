use crate::nearest::hint;

/// What can be wrong with a value of `experiment.toml`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// Another version of the format.
    #[error("format {found} is not known; this program reads formats 1 and 2")]
    Format {
        /// What the file says.
        found: String,
    },
    /// A key that the format does not have.
    #[error("unknown key `{key}`{}; known here: {}", hint(nearest), known.join(", "))]
    UnknownKey {
        /// The last part of the key.
        key: String,
        /// Known keys that look like it.
        nearest: Vec<String>,
        /// All keys known at that place.
        known: Vec<&'static str>,
    },
    /// A key that format 1 does not have.
    #[error("`{key}` is a key of format 2; write format = 2 to use it")]
    OfFormat2 {
        /// The key.
        key: String,
    },
    /// A position with too few or too many numbers.
    #[error(
        "a position of {found} numbers where p has {signals}; write one number a scheduling signal: position = [0.1, -0.05]"
    )]
    PositionLength {
        /// Scheduling signals there are.
        signals: usize,
        /// Numbers of the position.
        found: usize,
    },
    /// A key of format 2 that this version does not know how to follow.
    #[error("`{key}` of format 2 is not read by this version; take the line out, its meaning would be lost")]
    NotRead {
        /// The key.
        key: String,
    },
    /// A key of records of samples on a measured frequency response.
    #[error(
        "`{key}` is for records of samples; a record with kind = \"response\" has none: take the line out"
    )]
    KeyOfSamples {
        /// The key.
        key: &'static str,
    },
    /// A quantity of a response on a record of samples.
    #[error(
        "`quantity` of a record says what a measured frequency response is of (kind = \"response\"); what a signal is stands in [channels.output]"
    )]
    QuantityOfSamples,
    /// A measured frequency response that does not say where.
    #[error(
        "a measured frequency response has no scheduling signal; say where it was measured: position = 0.1 (a number a scheduling signal)"
    )]
    PositionMissing,
    /// Keys of `[text]` that contradict each other.
    #[error("{problem}")]
    Text {
        /// What contradicts what.
        problem: &'static str,
    },
    /// Rows that are no part of a record.
    #[error("rows = [{}, {}]; write the first and the last row, counted from 1", rows[0], rows[1])]
    Rows {
        /// What the file says.
        rows: [usize; 2],
    },
    /// A place for a column that the record does not have.
    #[error("`{column}` is no channel of this bundle{}", hint(nearest))]
    Unasked {
        /// The name.
        column: String,
        /// Channels that look like it.
        nearest: Vec<String>,
    },
    /// A sample rate that no clock can have.
    #[error("sample rate {value:?} Hz; it must be finite and above zero")]
    SampleRate {
        /// What the file says.
        value: f64,
    },
    /// A group that must have columns has none.
    #[error("no columns; a record needs at least one output and one input")]
    NoColumns,
    /// A column without a name.
    #[error("a column name is empty; write the name that the record files use")]
    EmptyName,
    /// One column in two roles. Only scheduling may repeat a column of another group, and a reference may repeat an
    /// input (open loop).
    #[error("column `{column}` is already listed under {first}; a column has one role")]
    DuplicateColumn {
        /// The column.
        column: String,
        /// Key of its first listing.
        first: String,
    },
    /// A list with another length than `columns`.
    #[error("a list of {found} for {expected} columns; give one a column, or leave the list out")]
    ListLength {
        /// Number of columns.
        expected: usize,
        /// Length of the list.
        found: usize,
    },
    /// A scale that loses the signal.
    #[error("scale {value} of column `{column}`; it must be finite and not zero")]
    Scale {
        /// The column.
        column: String,
        /// What the file says.
        value: f64,
    },
    /// A number that is NaN or infinite.
    #[error("{value} is not a finite number")]
    NotFinite {
        /// What the file says.
        value: f64,
    },
    /// A bundle without records.
    #[error("the bundle lists no record; add a [[records]] table")]
    NoRecords,
    /// A periodic record that does not say its period.
    #[error("a periodic record needs `period`, the number of samples a period")]
    PeriodMissing,
    /// A period on a record that has none.
    #[error("`period` = {period} on a transient record; remove it or set kind = \"periodic\"")]
    PeriodOfTransient {
        /// What the file says.
        period: usize,
    },
    /// A period that holds no oscillation.
    #[error("`period` = {period}; a period has at least 2 samples")]
    PeriodShort {
        /// What the file says.
        period: usize,
    },
    /// A file ending that this program does not read.
    #[error("{} not supported; supported: {supported}", ending_text(ending))]
    UnsupportedFormat {
        /// The ending, with its dot.
        ending: String,
        /// The endings that are.
        supported: &'static str,
    },
    /// A record file that is not there.
    #[error(
        "the record file `{file}` does not exist or is no regular file{}",
        hint(nearest)
    )]
    FileMissing {
        /// The file as written.
        file: String,
        /// Files beside it that look like it.
        nearest: Vec<String>,
    },
    /// A record file outside the bundle's folder.
    #[error("the record file `{file}` is outside the bundle: {reason}; move it into the folder")]
    Outside {
        /// The file as written.
        file: String,
        /// Why it is outside.
        reason: &'static str,
    },
    /// The same samples listed twice: they could be fitted and held out at once.
    #[error(
        "the file `{file}` is already records[{first}]; list a file once, or other rows or columns of it"
    )]
    DuplicateRecord {
        /// The file as written.
        file: String,
        /// Index of its first listing.
        first: usize,
    },
    /// More records of one file than are told apart.
    #[error("more than {most} records are parts of the file `{file}`; cut it into several files")]
    ManyParts {
        /// The file as written.
        file: String,
        /// Most records of one file.
        most: usize,
    },
    /// Coefficients that are no controller.
    #[error(transparent)]
    Controller(#[from] lpv_core::ControllerProblem),
    /// More coefficients than any controller has.
    #[error(
        "a polynomial of {coefficients} coefficients for each of {loops} loops; a controller has at most {most} in all"
    )]
    ManyCoefficients {
        /// Coefficients of the polynomial.
        coefficients: usize,
        /// Number of loops.
        loops: usize,
        /// Most coefficients of all loops.
        most: usize,
    },
    /// Loops without signals to close them.
    #[error("{loops} loops (one an input) need as many {signal}s; the bundle has {found}")]
    LoopSignals {
        /// Number of loops.
        loops: usize,
        /// `output` or `reference`.
        signal: &'static str,
        /// Signals of the bundle.
        found: usize,
    },
    /// A matrix of another size.
    #[error("a {rows} x {columns} matrix is needed here; found {found} in {place}")]
    MatrixSize {
        /// Rows needed.
        rows: usize,
        /// Columns needed.
        columns: usize,
        /// What was counted.
        found: usize,
        /// Where it was counted: `rows` or a row.
        place: String,
    },
    /// A number of matrices that is no polynomial of degree 0 to 2.
    #[error("{found} matrices; give [T0], [T0, T1] or [T0, T1, T2]")]
    MatrixCount {
        /// Matrices found.
        found: usize,
    },
    /// A geometry that depends on p where p is no single signal.
    #[error("a force that depends on p needs exactly one scheduling signal; the bundle has {found}")]
    GeometryScheduling {
        /// Scheduling signals.
        found: usize,
    },
}

fn ending_text(ending: &str) -> String {
    if ending.is_empty() {
        "a record file without an ending is".to_owned()
    } else {
        format!("record files with the ending `{ending}` are")
    }
}
