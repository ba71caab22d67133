//! Columns of one record file, by name.

mod csv;
mod npz;

use crate::nearest::nearest;
use crate::{DescriptionError, RecordError, mat};
use std::path::Path;

pub(crate) use csv::lines_of_rows as csv_lines;
pub(crate) use csv::write as write_csv;
pub(crate) use npz::write as write_npz;

pub(crate) const SUPPORTED: &str = ".npz, .csv, .mat (v5)";

/// Kinds of record files, told apart by their ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordFormat {
    /// NumPy archive, one 1-D array a column; written uncompressed.
    Npz,
    /// Header line, comma separated, decimal points.
    Csv,
    /// MATLAB level 5, one vector a column; written uncompressed.
    Mat,
}

impl RecordFormat {
    /// The ending with its dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Npz => ".npz",
            Self::Csv => ".csv",
            Self::Mat => ".mat",
        }
    }

    /// The kind of a file by its name; upper and lower case are the same.
    ///
    /// # Errors
    /// [`DescriptionError::UnsupportedFormat`] with the ending and the supported ones.
    pub fn of(file: &str) -> Result<Self, DescriptionError> {
        let ending = Path::new(file)
            .extension()
            .map(|e| format!(".{}", e.to_string_lossy()));
        let ending = ending.unwrap_or_default();
        [Self::Npz, Self::Csv, Self::Mat]
            .into_iter()
            .find(|f| f.ending().eq_ignore_ascii_case(&ending))
            .ok_or(DescriptionError::UnsupportedFormat {
                ending,
                supported: SUPPORTED,
            })
    }
}

/// The named columns, in the order of the names.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    match RecordFormat::of(&path.to_string_lossy()) {
        Ok(RecordFormat::Npz) => npz::read(path, names),
        Ok(RecordFormat::Csv) => csv::read(path, names),
        Ok(RecordFormat::Mat) => mat::read(path, names),
        Err(_) => Err(RecordError::UnsupportedFormat {
            found: path
                .extension()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            supported: SUPPORTED,
        }),
    }
}

pub(crate) fn is_csv(path: &Path) -> bool {
    RecordFormat::of(&path.to_string_lossy()) == Ok(RecordFormat::Csv)
}

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
