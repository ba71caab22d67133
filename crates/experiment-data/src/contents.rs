//! What a record file holds, whatever its format.

use crate::nearest::nearest;
use crate::{RecordError, ResponseQuantity, Text};

/// The endings that can be read.
pub(crate) const SUPPORTED: &str = match (cfg!(feature = "parquet"), cfg!(feature = "hdf5")) {
    (true, true) => {
        ".npz, .csv, .parquet, .mat (v5 and v7.3), text tables (.txt, .dat, .log, .asc, .tsv), .h5, .tdms, .mf4, .uff, .unv"
    }
    (false, true) => {
        ".npz, .csv, .mat (v5 and v7.3), text tables (.txt, .dat, .log, .asc, .tsv), .h5, .tdms, .mf4, .uff, .unv, and .parquet in a build with the feature `parquet`"
    }
    (true, false) => {
        ".npz, .csv, .parquet, .mat (v5), text tables (.txt, .dat, .log, .asc, .tsv), .tdms, .mf4, .uff, .unv, and .mat (v7.3) and .h5 in a build with the feature `hdf5`"
    }
    (false, false) => {
        ".npz, .csv, .mat (v5), text tables (.txt, .dat, .log, .asc, .tsv), .tdms, .mf4, .uff, .unv, and .parquet, .mat (v7.3) and .h5 in a build with the features `parquet` and `hdf5`"
    }
};

/// A column of a record file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Its name, as `columns` of a bundle's description would have it.
    pub name: String,
    /// Number of samples.
    pub rows: u64,
}

/// A column of a file that no description names yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Number of samples.
    pub rows: u64,
    /// Its unit where the file has one apart from the name, or nothing.
    pub unit: String,
    /// Where the file has it, as `columns` of a record has it, if not by its name.
    pub source: Option<String>,
    /// Whether its cells are dates or times of day, which are read as seconds.
    pub is_stamp: bool,
}

impl Column {
    /// One of which the file says its name and length alone.
    pub(crate) fn plain(info: ColumnInfo) -> Self {
        Self {
            name: info.name,
            rows: info.rows,
            unit: String::new(),
            source: None,
            is_stamp: false,
        }
    }
}

/// Something in a file that is no column of a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// Its name.
    pub name: String,
    /// What it is: class and size.
    pub what: String,
    /// How to use it all the same, or nothing.
    pub remedy: String,
}

/// A single number, as settings stand beside signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Scalar {
    /// Its name.
    pub name: String,
    /// Its value; finite.
    pub value: f64,
}

/// A measured frequency response of one output to one input.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseInfo {
    /// Where the output is, as `columns` of a record has it.
    pub output: String,
    /// Where the input is.
    pub input: String,
    /// What it is of, where the file says it.
    pub quantity: Option<ResponseQuantity>,
    /// Its highest line, Hz.
    pub highest_hz: f64,
}

/// Everything that a record file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contents {
    /// Every vector of real numbers.
    pub columns: Vec<Column>,
    /// Frequency responses, of a universal file.
    pub responses: Vec<ResponseInfo>,
    /// Whatever else is in it.
    pub passed_over: Vec<PassedOver>,
    /// Single numbers that are finite: the first ones of the file.
    pub scalars: Vec<Scalar>,
    /// Whether it is a text table.
    pub is_text: bool,
    /// What `[text]` of a description has to say about it; none where nothing need be said.
    pub text: Option<Text>,
    /// The fields of the lines above the names of a text table.
    pub notes: Vec<Vec<String>>,
}

/// More settings than this are not looked at.
pub(crate) const MOST_SCALARS: usize = 256;

/// The error of a column that is not among the names present.
pub(crate) fn missing(column: &str, present: &[String]) -> RecordError {
    RecordError::ColumnMissing {
        column: column.to_owned(),
        nearest: nearest(column, present),
        present: present.len(),
    }
}

/// The length of a row or column vector; anything that is wider in two directions is none.
pub(crate) fn vector_length(column: &str, shape: &[u64]) -> Result<u64, RecordError> {
    let long = shape.iter().filter(|n| **n != 1).count();
    if shape.is_empty() || (long > 1 && !shape.contains(&0)) {
        return Err(RecordError::NotAVector {
            column: column.to_owned(),
            shape: shape.to_vec(),
        });
    }
    if shape.contains(&0) {
        Ok(0)
    } else {
        Ok(shape.iter().copied().find(|n| *n != 1).unwrap_or(1))
    }
}
