//! HDF5 as h5py and others write it: vectors and matrices of real numbers in groups, whose names are parted by dots here. Rows come
//! first: of a data set of the shape (N, 3), `x(:,2)` is the second column.
//!
//! Attributes of single numbers are scalars, such as `fs`; the attribute `units` of a data set is its unit.

use super::catalog::{self, Item, Part};
use super::{Array, version73};
use crate::RecordError;
use crate::contents::{Contents, MOST_SCALARS, Scalar};
use crate::response::numbers::Numbers;
use std::path::Path;

/// The named columns, in the order of the names.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    named(of_file(path, names))
}

fn of_file(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let parts: Vec<(&str, Option<Part>)> = names.iter().map(|n| catalog::part_of(n)).collect();
    let mut bases: Vec<&str> = Vec::new();
    for (base, part) in &parts {
        if part.is_some() && !bases.contains(base) {
            bases.push(base);
        }
    }
    let whole: Vec<&str> = parts.iter().filter(|p| p.1.is_none()).map(|p| p.0).collect();
    let mut vectors = version73::read(path, &whole)?.into_iter();
    let matrices: Vec<Array> = version73::read_arrays(path, &bases)?;
    parts
        .iter()
        .zip(names)
        .map(|((base, part), name)| {
            // MATLAB's order of the indices is the other way round.
            let part = match part {
                None => return Ok(vectors.next().unwrap_or_default()),
                Some(Part::Column(k)) => Part::Row(*k),
                Some(Part::Row(k)) => Part::Column(*k),
            };
            let at = bases.iter().position(|b| b == base).unwrap_or(0);
            catalog::cut(name, &matrices[at], part)
        })
        .collect()
}

/// An array of any shape, real or complex, its last index the fastest.
pub(crate) fn numbers(path: &Path, name: &str) -> Result<Numbers, RecordError> {
    let mut numbers = named(version73::numbers(path, name))?;
    numbers.shape.reverse();
    numbers.last_fastest = true;
    Ok(numbers)
}

/// Everything in the file that may be a column, and what is none.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    named(look(path))
}

fn look(path: &Path) -> Result<Contents, RecordError> {
    let mut items: Vec<Item> = version73::survey(path)?;
    items.iter_mut().for_each(|item| item.shape.reverse());
    let attributes = version73::attributes(path)?;
    let mut contents = catalog::contents(&items);
    for column in &mut contents.columns {
        let base = catalog::part_of(&column.name).0;
        if let Some(unit) = attributes.units.get(base) {
            column.unit.clone_from(unit);
        }
    }
    let single: Vec<&str> = contents
        .columns
        .iter()
        .filter(|c| c.rows == 1)
        .map(|c| c.name.as_str())
        .take(MOST_SCALARS)
        .collect();
    let values = of_file(path, &single)?;
    let own = single.iter().zip(values).filter_map(|(name, value)| {
        let value = value.first().copied().filter(|v| v.is_finite())?;
        Some(Scalar {
            name: (*name).to_owned(),
            value,
        })
    });
    contents.scalars = own.collect();
    contents.scalars.extend(attributes.scalars);
    Ok(contents)
}

/// The reader is that of MATLAB's files; its messages are of HDF5.
fn named<T>(found: Result<T, RecordError>) -> Result<T, RecordError> {
    found.map_err(|problem| match problem {
        // What HDF5 2.0 writes when asked for its latest version.
        RecordError::Malformed { problem, .. } if problem.contains("invalid data layout version") => {
            RecordError::UnsupportedFormat {
                found: "the newest layout of HDF5".to_owned(),
                supported: "those up to HDF5 1.14; in Python: h5py.File(name, 'w', libver=('earliest', 'v114'))",
            }
        }
        RecordError::Malformed {
            variable, problem, ..
        } => RecordError::Malformed {
            format: "HDF5",
            variable,
            problem,
        },
        other => other,
    })
}
