use super::ResponseFault;
use crate::nearest::hint;
use crate::size::size_text;

/// What can be wrong with a record's file or samples. Rows count samples from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The system refused to read or write.
    #[error("cannot {action} the file: {source}")]
    Io {
        /// The operation.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A kind of file that this program does not read.
    #[error("{found} is not supported; supported: {supported}")]
    UnsupportedFormat {
        /// What the file is.
        found: String,
        /// What could be read instead.
        supported: &'static str,
    },
    /// A measured frequency response that cannot be one.
    #[error(transparent)]
    Response(Box<ResponseFault>),
    /// A file that breaks its own format.
    #[error("damaged {format} file{}: {problem}", at(variable))]
    Malformed {
        /// The file format.
        format: &'static str,
        /// The array or variable, where known.
        variable: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A packed file whose columns would take far more memory than a file of its size can mean.
    #[error(
        "column `{column}` claims {numbers} numbers: with it {} of memory would be needed for {} of files, which get {} at most; the file is damaged, or, if it is right, save it without compression or cut it into shorter records",
        size_text(*bytes), size_text(*file_bytes), size_text(*most)
    )]
    Unpacks {
        /// The column that is too much.
        column: String,
        /// Its numbers.
        numbers: u64,
        /// Memory of the columns up to it, bytes.
        bytes: u64,
        /// Size of the file, or of all files that stay in memory, bytes.
        file_bytes: u64,
        /// Most memory for a file of its size, bytes.
        most: u64,
    },
    /// A record that is too long for the memory of this machine.
    #[error(
        "column `{column}` has {numbers} numbers: with it {} of memory would be needed, more than half of the {} that are free here; cut the records shorter, list fewer of them, or use a machine with more memory",
        size_text(*bytes), size_text(*free)
    )]
    Memory {
        /// The column that is too much.
        column: String,
        /// Its numbers.
        numbers: u64,
        /// Memory of the columns up to it, bytes.
        bytes: u64,
        /// Free memory, bytes.
        free: u64,
    },
    /// A text table whose layout cannot be told.
    #[error(
        "{problem}; [text] of experiment.toml (format = 2) says how a file is laid out: separator, decimal, header, units_row, skip"
    )]
    TextLayout {
        /// What is seen.
        problem: String,
    },
    /// A row with another number of fields than the header.
    #[error(
        "line {line}: {found} fields, the header has {expected}; complete the row (decimal commas also look like this)"
    )]
    CsvRagged {
        /// Line, from 1.
        line: u64,
        /// Fields of the header.
        expected: u64,
        /// Fields of the row.
        found: u64,
    },
    /// A field that is no number.
    #[error("line {line}, column `{column}`: {}", cell_text(text, *comma))]
    CsvNumber {
        /// Line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// The field.
        text: String,
        /// Whether the numbers of the file have decimal commas.
        comma: bool,
    },
    /// A name that the header has twice.
    #[error("line {line}: the header has the column `{column}` {times} times; rename all but one")]
    CsvDuplicate {
        /// Line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// How often it occurs.
        times: usize,
    },
    /// A column that the file does not have.
    #[error(
        "no column `{column}` among the {present} of the file{}; correct `columns` or the file",
        hint(nearest)
    )]
    ColumnMissing {
        /// The column.
        column: String,
        /// Names that look like it.
        nearest: Vec<String>,
        /// Number of columns in the file.
        present: usize,
    },
    /// A variable that holds no real numbers.
    #[error("column `{column}` holds {found}; a vector of real numbers is needed")]
    NotNumeric {
        /// The column.
        column: String,
        /// What it holds.
        found: String,
    },
    /// An array that is neither a row nor a column.
    #[error("column `{column}` has the shape {shape:?}; store each signal as a vector of its own")]
    NotAVector {
        /// The column.
        column: String,
        /// Its shape.
        shape: Vec<u64>,
    },
    /// Columns of different lengths.
    #[error(
        "column `{column}` has {found} rows, `{first}` has {expected}; all columns of a record have one length"
    )]
    UnequalLengths {
        /// The column.
        column: String,
        /// Its rows.
        found: usize,
        /// The first column.
        first: String,
        /// Its rows.
        expected: usize,
    },
    /// Rows that are asked for and are not there.
    #[error("rows = [{}, {}], but column `{column}` has {found} rows", rows[0], rows[1])]
    RowsMissing {
        /// The column.
        column: String,
        /// What the description asks for.
        rows: [usize; 2],
        /// Rows of the column.
        found: usize,
    },
    /// A record without samples.
    #[error("column `{column}` has no rows; a record needs samples")]
    Empty {
        /// The first column.
        column: String,
    },
    /// Rows without a value.
    #[error(
        "column `{column}` has no value (null) in {}, {count} in all; fill or cut these rows (some programs write NaN so)",
        rows_text(rows, &[], *count)
    )]
    Null {
        /// The column.
        column: String,
        /// The first rows concerned.
        rows: Vec<usize>,
        /// How many there are.
        count: usize,
    },
    /// NaN or infinity, after scaling.
    #[error(
        "column `{column}` is NaN or infinite in {}, {count} in all; cut the record or repair these rows",
        rows_text(rows, lines, *count)
    )]
    NotFinite {
        /// The column.
        column: String,
        /// The first rows concerned.
        rows: Vec<usize>,
        /// Their lines in a CSV file; empty otherwise.
        lines: Vec<u64>,
        /// How many there are.
        count: usize,
    },
    /// Less than two periods.
    #[error("{samples} samples are fewer than two periods of {period}; measure at least two")]
    FewPeriods {
        /// Samples of the record.
        samples: usize,
        /// Samples a period.
        period: usize,
    },
    /// A last period that is not complete.
    #[error(
        "{samples} samples are no multiple of the period {period}: {rest} left over; cut the record or correct `period`"
    )]
    PartialPeriod {
        /// Samples of the record.
        samples: usize,
        /// Samples a period.
        period: usize,
        /// Samples after the last whole period.
        rest: usize,
    },
    /// A scheduling signal that is not constant in a periodic record.
    ///
    /// It is constant if its peak-to-peak value is at most 1/1000 of the range of p over the bundle; where no record shows a larger
    /// range, also if it looks like white noise (von Neumann ratio above 1).
    #[error(
        "scheduling column `{column}` moves from {from} to {to} during a periodic record; at most {tolerance:e}, a thousandth of its range in the bundle, is taken as constant; a record that moves is \"transient\", and one that is held at its place may say so with `position`"
    )]
    SchedulingMoves {
        /// The column.
        column: String,
        /// Its smallest value.
        from: f64,
        /// Its largest value.
        to: f64,
        /// Largest difference that passes.
        tolerance: f64,
    },
    /// A declared position that the scheduling column contradicts by more than 1/100 of the range of p in the bundle.
    #[error(
        "`position` = {declared}, but the scheduling column `{column}` has the mean {measured}; correct one of them"
    )]
    PositionMismatch {
        /// The column.
        column: String,
        /// `position` of the description.
        declared: f64,
        /// Mean of the column.
        measured: f64,
    },
    /// An output or input that holds one value in every row.
    ///
    /// Asked of outputs and inputs, in periodic and transient records. References may be zero, scheduling is constant
    /// in a periodic record, an auxiliary signal may rest and an injection may be absent in one test.
    #[error(
        "column `{column}` is constant, {value} in every row: a dead channel or the wrong column; remove it or measure again"
    )]
    Constant {
        /// The column.
        column: String,
        /// Its value.
        value: f64,
    },
    /// An output that stays at its extreme value. An input at its limit is what acted on the machine, and is taken as it is.
    ///
    /// Not judged: signals with fewer than 16 different values (switching signals).
    ///
    /// - Periodic records: clipped if more than 0.1 % of the samples, and at least 5, equal the extreme exactly, and more
    ///   than four times as many as equal the next value (a coarse but unclipped converter fills both alike), and is reached by steps
    ///   larger than from there to the next value (a rounded peak is reached by single steps of the rounding).
    /// - Transient records rest at their ends and in between, so only plateaus of three samples or more that are entered
    ///   and left at speed count (slope on both sides above 0.3 times the rms slope, and above three converter steps);
    ///   clipped if there are such samples in more than 0.2 % of the record, and at least 5. Piecewise linear profiles
    ///   (trapezoids) and signals that jump between held levels are not judged.
    #[error(
        "column `{column}` is clipped: {samples} of {of} samples stay at its extreme value {extreme}; lower the amplitude or change the range, and measure again"
    )]
    Clipped {
        /// The column.
        column: String,
        /// The extreme value.
        extreme: f64,
        /// Samples on plateaus at it.
        samples: usize,
        /// Samples of the record.
        of: usize,
    },
    /// A record to write whose channels are not those of the description.
    #[error("the {group} channels are {found:?}, the description says {expected:?}")]
    Channels {
        /// The channel group.
        group: &'static str,
        /// Names in the description.
        expected: Vec<String>,
        /// Names in the record.
        found: Vec<String>,
    },
    /// A record to write with more or fewer units than channels.
    #[error("the {group} channels: {columns} columns, {names} names, {units} units")]
    SignalLists {
        /// The channel group.
        group: &'static str,
        /// Columns of samples.
        columns: usize,
        /// Names.
        names: usize,
        /// Units; none is allowed too.
        units: usize,
    },
    /// A record to write in which one name stands for two different signals.
    #[error(
        "column `{column}` of the {group} channels has other samples than the column of that name before it; rename one"
    )]
    TwoContents {
        /// The column.
        column: String,
        /// The channel group of its second use.
        group: &'static str,
    },
    /// A column name that the file format to write cannot hold.
    #[error("column `{column}` cannot be written to a {format} file: {reason}")]
    Unwritable {
        /// The column.
        column: String,
        /// The file format.
        format: &'static str,
        /// Why not.
        reason: &'static str,
    },
}

impl RecordError {
    pub(crate) fn io(action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Io { action, source }
    }
}

fn at(variable: &str) -> String {
    if variable.is_empty() {
        String::new()
    } else {
        format!(", `{variable}`")
    }
}

fn rows_text(rows: &[usize], lines: &[u64], count: usize) -> String {
    let list = |numbers: Vec<String>| numbers.join(", ");
    let more = if count > rows.len() { ", ..." } else { "" };
    let rows = list(rows.iter().map(ToString::to_string).collect());
    if lines.is_empty() {
        format!("rows {rows}{more}")
    } else {
        format!(
            "rows {rows}{more} (lines {}{more})",
            list(lines.iter().map(ToString::to_string).collect())
        )
    }
}

fn cell_text(text: &str, comma: bool) -> String {
    let sample = if comma { "-1,5e-3" } else { "-1.5e-3" };
    if text.is_empty() {
        "the cell is empty; every row needs a value".to_owned()
    } else {
        format!("`{text}` is not a number; write numbers like {sample}")
    }
}
