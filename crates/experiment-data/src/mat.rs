//! MATLAB files, told apart by their content.
//!
//! Level 5 ("MAT-File Format", The MathWorks) is read and written here, because the crates at hand refuse files of common
//! programs or read numbers only. Version 7.3 is HDF5 with MATLAB's attributes; `hdf5-pure` reads it.
//!
//! Read of both: all numeric classes and logicals, and 1 x 1 structs by dotted names. Of level 5 also both byte orders,
//! compressed and small elements. Cells, objects, characters, sparse and opaque variables are passed over. Only wanted
//! variables are decoded.

mod catalog;
mod element;
mod hdf5;
mod level5;
mod value;
#[cfg_attr(not(feature = "hdf5"), path = "mat/no_hdf5.rs")]
mod version73;
mod writer;

use crate::RecordError;
use crate::contents::{ColumnInfo, Contents, MOST_SCALARS, Scalar};
use crate::response::numbers::{Entries, Numbers};
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub(crate) use hdf5::{contents as hdf5_contents, numbers as hdf5_numbers, read as hdf5_read};
pub use value::{Array, Value, write_values};
pub(crate) use writer::write;

/// Structs deeper than this are no measurement.
const DEEPEST: usize = 16;

/// The named variables, in the order of the names; `a.b` is the field `b` of the struct `a`, `a(2).b` that of the second
/// element of a struct array, `a[Name=x].b` that of the element whose `Name` is `x`, and `m(:,3)` a column of a matrix.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut places: Vec<String> = names.iter().map(ToString::to_string).collect();
    if names.iter().any(|n| n.contains('[')) {
        let items = survey(path)?;
        for place in places.iter_mut().filter(|p| p.contains('[')) {
            if let Some(found) = catalog::resolve(place, &items) {
                *place = found;
            }
        }
    }
    let parts: Vec<(&str, Option<catalog::Part>)> = places.iter().map(|p| catalog::part_of(p)).collect();
    let mut matrices: Vec<&str> = Vec::new();
    for (base, _) in parts.iter().filter(|(_, part)| part.is_some()) {
        if !matrices.contains(base) {
            matrices.push(base);
        }
    }
    let vectors: Vec<&str> = parts
        .iter()
        .filter(|(_, part)| part.is_none())
        .map(|(name, _)| *name)
        .collect();
    let mut found = read_vectors(path, &vectors)?.into_iter();
    if matrices.is_empty() {
        return Ok(found.collect());
    }
    let arrays = if is_hdf5(path)? {
        version73::read_arrays(path, &matrices)?
    } else {
        level5::read_arrays(path, &matrices, level5::Shape::Any)?
    };
    parts
        .iter()
        .zip(names)
        .map(|((base, part), name)| match part {
            None => Ok(found.next().unwrap_or_default()),
            Some(part) => {
                let at = matrices.iter().position(|m| m == base).unwrap_or(0);
                catalog::cut(name, &arrays[at], *part)
            }
        })
        .collect()
}

fn read_vectors(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    if names.is_empty() {
        return Ok(Vec::new());
    }
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

/// What is in a file by name, and the words of its short texts.
pub(crate) fn entries(path: &Path) -> Result<Entries, RecordError> {
    let mut entries = Entries {
        names: Vec::new(),
        texts: Vec::new(),
    };
    for item in survey(path)? {
        match item.kind {
            catalog::Kind::Text(words) => entries.texts.push((item.name, words)),
            _ => entries.names.push(item.name),
        }
    }
    Ok(entries)
}

/// An array of any shape, real or complex, that is there.
pub(crate) fn numbers(path: &Path, name: &str) -> Result<Numbers, RecordError> {
    if is_hdf5(path)? {
        version73::numbers(path, name)
    } else {
        level5::numbers(path, name)
    }
}

/// Every vector of real numbers, in the order of the file.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    if is_hdf5(path)? {
        version73::list(path)
    } else {
        level5::list(path)
    }
}

/// Everything in the file that may be a column, and what is none.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let mut contents = catalog::contents(&survey(path)?);
    let single = contents.columns.iter().filter(|c| c.rows == 1).take(MOST_SCALARS);
    let names: Vec<&str> = single.map(|c| c.source.as_deref().unwrap_or(&c.name)).collect();
    let values = read(path, &names)?;
    contents.scalars = names
        .iter()
        .zip(values)
        .filter_map(|(name, value)| {
            let value = value.first().copied().filter(|v| v.is_finite())?;
            Some(Scalar {
                name: (*name).to_owned(),
                value,
            })
        })
        .collect();
    Ok(contents)
}

fn survey(path: &Path) -> Result<Vec<catalog::Item>, RecordError> {
    if is_hdf5(path)? {
        version73::survey(path)
    } else {
        level5::survey(path)
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
