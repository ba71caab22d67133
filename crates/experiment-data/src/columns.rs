//! Columns of one record file, by name.

mod csv;
mod mdf;
mod npz;
pub(crate) mod number;
#[cfg_attr(not(feature = "parquet"), path = "columns/no_parquet.rs")]
mod parquet;
mod tdms;
mod uff;

use crate::text::Text;
use crate::{DescriptionError, RecordError, mat};
use std::path::Path;

use crate::contents::{Column, ColumnInfo, Contents, SUPPORTED};
pub use csv::lines_of_rows;
pub(crate) use csv::write as write_csv;
pub(crate) use npz::{entries as npz_entries, numbers as npz_numbers, write as write_npz};
pub(crate) use parquet::write as write_parquet;
pub(crate) use uff::responses as uff_responses;

/// Takes the columns of a block of rows.
pub(crate) type Sink<'a> = &'a mut dyn FnMut(Vec<Vec<f64>>);

/// Kinds of record files, told apart by their ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordFormat {
    /// NumPy archive, one 1-D array a column; written uncompressed.
    Npz,
    /// Text: a line of names and rows of numbers. Written with commas and decimal points.
    Csv,
    /// MATLAB, one vector a column; read in level 5 and version 7.3, written in level 5, uncompressed.
    Mat,
    /// One column of doubles each, packed with snappy; in a build with the feature `parquet`.
    Parquet,
    /// HDF5 as other programs than MATLAB write it, one data set a column; read only, in a build with the feature `hdf5`.
    Hdf5,
    /// TDMS of National Instruments, one channel a column; read only.
    Tdms,
    /// MDF 4 of ASAM, one channel a column; read only.
    Mdf,
    /// Universal file, data sets 58; read only.
    Uff,
}

/// All kinds, with their endings; the first is the usual one.
const ENDINGS: [(RecordFormat, &[&str]); 8] = [
    (RecordFormat::Npz, &[".npz"]),
    (
        RecordFormat::Csv,
        &[".csv", ".txt", ".dat", ".log", ".asc", ".tsv"],
    ),
    (RecordFormat::Mat, &[".mat"]),
    (RecordFormat::Parquet, &[".parquet"]),
    (RecordFormat::Hdf5, &[".h5", ".hdf5", ".hdf"]),
    (RecordFormat::Tdms, &[".tdms"]),
    (RecordFormat::Mdf, &[".mf4", ".mdf"]),
    (RecordFormat::Uff, &[".uff", ".unv", ".uf", ".u58"]),
];

impl RecordFormat {
    /// The usual ending with its dot.
    pub fn ending(self) -> &'static str {
        let own = ENDINGS.iter().find(|(format, _)| *format == self);
        own.and_then(|(_, endings)| endings.first()).unwrap_or(&"")
    }

    /// Whether this build reads it.
    pub fn is_built_in(self) -> bool {
        match self {
            Self::Parquet => cfg!(feature = "parquet"),
            Self::Hdf5 => cfg!(feature = "hdf5"),
            _ => true,
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
        let fits = |endings: &[&str]| endings.iter().any(|e| e.eq_ignore_ascii_case(&ending));
        ENDINGS
            .iter()
            .find(|(format, endings)| format.is_built_in() && fits(endings))
            .map(|(format, _)| *format)
            .ok_or(DescriptionError::UnsupportedFormat {
                ending,
                supported: SUPPORTED,
            })
    }
}

/// The columns that a record file offers, in the order of the file: every vector of real numbers.
///
/// In `.mat` files the fields of structs have dotted names. Whatever else a file holds is left out: matrices, complex
/// numbers, texts, cells, objects. A column of text counts as numbers by its first row.
///
/// # Errors
/// [`RecordError`] for a file that cannot be read or is damaged; the text does not repeat the path.
pub fn list_columns(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    match format(path)? {
        RecordFormat::Npz => npz::list(path),
        RecordFormat::Csv => csv::list(path),
        RecordFormat::Mat => mat::list(path),
        RecordFormat::Parquet => parquet::list(path),
        RecordFormat::Hdf5 | RecordFormat::Tdms | RecordFormat::Mdf | RecordFormat::Uff => {
            let columns = look_into(path)?.columns.into_iter();
            Ok(columns
                .map(|c| ColumnInfo {
                    name: c.name,
                    rows: c.rows,
                })
                .collect())
        }
    }
}

/// Everything that a record file holds, in its order. Of a text table all cells are looked at: a column with a cell that is no
/// number is passed over.
///
/// # Errors
/// As [`list_columns`].
pub fn look_into(path: &Path) -> Result<Contents, RecordError> {
    match format(path)? {
        RecordFormat::Csv => csv::contents(path),
        RecordFormat::Mat => mat::contents(path),
        RecordFormat::Hdf5 => mat::hdf5_contents(path),
        RecordFormat::Tdms => tdms::contents(path),
        RecordFormat::Mdf => mdf::contents(path),
        RecordFormat::Uff => uff::contents(path),
        RecordFormat::Npz => npz::contents(path),
        RecordFormat::Parquet => Ok(Contents {
            columns: parquet::list(path)?.into_iter().map(Column::plain).collect(),
            ..Contents::default()
        }),
    }
}

/// The named columns of a record file, in the order of the names, as they are in the file: no scale is applied, and
/// nothing is asked of the samples.
///
/// # Errors
/// [`RecordError`] for a file or column that cannot be read; the text does not repeat the path.
pub fn read_columns(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    read_columns_as(path, names, None)
}

/// The same of a text table that is laid out as `text` says; other kinds of files do not ask.
///
/// # Errors
/// As [`read_columns`]; [`RecordError::TextLayout`] where the file is not as `text` says.
pub fn read_columns_as(
    path: &Path,
    names: &[&str],
    text: Option<&Text>,
) -> Result<Vec<Vec<f64>>, RecordError> {
    match format(path)? {
        RecordFormat::Npz => npz::read(path, names),
        RecordFormat::Csv => csv::read(path, names, text),
        RecordFormat::Mat => mat::read(path, names),
        RecordFormat::Parquet => parquet::read(path, names),
        RecordFormat::Hdf5 => mat::hdf5_read(path, names),
        RecordFormat::Tdms => tdms::read(path, names),
        RecordFormat::Mdf => mdf::read(path, names),
        RecordFormat::Uff => uff::read(path, names),
    }
}

/// The same, so many rows at a time in the order of the file; the last block may be shorter, also in single columns. NPZ and
/// text are never in memory as a whole.
pub(crate) fn each_block(
    path: &Path,
    names: &[&str],
    text: Option<&Text>,
    rows: usize,
    sink: Sink<'_>,
) -> Result<(), RecordError> {
    match format(path)? {
        RecordFormat::Npz => npz::each_block(path, names, rows, sink),
        RecordFormat::Csv => csv::each_block(path, names, text, rows, sink),
        _ => {
            let columns = read_columns(path, names)?;
            let longest = columns.iter().map(Vec::len).max().unwrap_or(0);
            for first in (0..longest).step_by(rows) {
                let part = |c: &Vec<f64>| c[first.min(c.len())..(first + rows).min(c.len())].to_vec();
                sink(columns.iter().map(part).collect());
            }
            Ok(())
        }
    }
}

pub(crate) fn format(path: &Path) -> Result<RecordFormat, RecordError> {
    RecordFormat::of(&path.to_string_lossy()).map_err(|_| {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        RecordError::UnsupportedFormat {
            found: format!("`.{ending}`"),
            supported: SUPPORTED,
        }
    })
}

fn is_csv(path: &Path) -> bool {
    RecordFormat::of(&path.to_string_lossy()) == Ok(RecordFormat::Csv)
}
