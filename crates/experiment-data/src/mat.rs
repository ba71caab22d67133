//! MATLAB files, told apart by their content.
//!
//! Level 5 ("MAT-File Format", The MathWorks) is read and written here, because the crates at hand refuse files of common
//! programs or read numbers only. Version 7.3 is HDF5 with MATLAB's attributes; `hdf5-pure` reads it.
//!
//! Read of both: all numeric classes and logicals, and 1 x 1 structs by dotted names. Of level 5 also both byte orders,
//! compressed and small elements. Cells, objects, characters, sparse and opaque variables are passed over. Only wanted
//! variables are decoded.

mod element;
mod level5;
mod value;
mod version73;
mod writer;

use crate::RecordError;
use crate::columns::ColumnInfo;
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use value::{Array, Value, write_values};
pub(crate) use writer::write;

/// Structs deeper than this are no measurement.
const DEEPEST: usize = 16;

/// The named variables, in the order of the names; `a.b` is the field `b` of the struct `a`.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    if is_hdf5(path)? {
        version73::read(path, names)
    } else {
        level5::read(path, names)
    }
}

/// The named arrays of a level 5 file with their shapes, in the order of the names.
///
/// # Errors
/// [`RecordError::ColumnMissing`], [`RecordError::NotNumeric`], [`RecordError::Malformed`],
/// [`RecordError::UnsupportedFormat`] for version 7.3.
pub fn read_arrays(path: &Path, names: &[&str]) -> Result<Vec<Array>, RecordError> {
    if is_hdf5(path)? {
        return Err(RecordError::UnsupportedFormat {
            found: "a MAT file of version 7.3 with matrices (save it with `-v7`)".to_owned(),
            supported: "level 5",
        });
    }
    level5::read_arrays(path, names, level5::Shape::Any)
}

/// Every vector of real numbers, in the order of the file.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    if is_hdf5(path)? {
        version73::list(path)
    } else {
        level5::list(path)
    }
}

/// HDF5 starts at byte 0 or, behind MATLAB's own header, at byte 512.
fn is_hdf5(path: &Path) -> Result<bool, RecordError> {
    const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
    let file = File::open(path).map_err(RecordError::io("open"))?;
    let mut start = Vec::new();
    file.take(520)
        .read_to_end(&mut start)
        .map_err(RecordError::io("read"))?;
    Ok(start.starts_with(SIGNATURE)
        || start.get(512..) == Some(SIGNATURE)
        || start.starts_with(b"MATLAB 7.3"))
}
