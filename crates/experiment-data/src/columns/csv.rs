//! CSV: a header line, commas, decimal points. A byte order mark in front is tolerated; semicolons, tabs and decimal
//! commas are refused, because guessing them wrong would shift columns silently.

mod blocks;
mod rows;
#[cfg(test)]
mod tests;
mod writer;

use super::{ColumnInfo, Sink, missing};
use crate::RecordError;
use rows::Table;
use std::collections::HashMap;
use std::path::Path;

pub(crate) use writer::write;

pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut columns = vec![Vec::new(); names.len()];
    each_block(path, names, usize::MAX, &mut |all| columns = all)?;
    Ok(columns)
}

pub(crate) fn each_block(
    path: &Path,
    names: &[&str],
    rows: usize,
    sink: Sink<'_>,
) -> Result<(), RecordError> {
    let mut table = Table::open(path)?;
    let places = places(table.header(), names)?;
    let mut wanted = places.clone();
    wanted.sort_unstable();
    wanted.dedup();
    let order: Vec<usize> = places
        .iter()
        .map(|place| wanted.partition_point(|w| w < place))
        .collect();
    let empty = || vec![Vec::new(); names.len()];
    let (mut columns, mut filled): (Vec<Vec<f64>>, usize) = (empty(), 0);
    table.each_row(&wanted, |_, values| {
        for (column, &at) in columns.iter_mut().zip(&order) {
            column.push(values[at]);
        }
        filled += 1;
        if filled == rows {
            sink(std::mem::replace(&mut columns, empty()));
            filled = 0;
        }
    })?;
    if filled > 0 {
        sink(columns);
    }
    Ok(())
}

/// The columns whose first row is a number.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    let mut table = Table::open(path)?;
    let numeric = table.numeric_in_first_row()?;
    let names: Vec<String> = numeric
        .into_iter()
        .map(|place| table.header()[place].clone())
        .filter(|name| !name.is_empty())
        .collect();
    let wanted: Vec<&str> = names.iter().map(String::as_str).collect();
    places(table.header(), &wanted)?;
    let mut rows = 0;
    table.each_row(&[], |_, _| rows += 1)?;
    Ok(names.into_iter().map(|name| ColumnInfo { name, rows }).collect())
}

/// The lines of the given data rows (from 1, ascending), as far as the file still has them.
pub(crate) fn lines_of_rows(path: &Path, rows: &[usize]) -> Vec<u64> {
    let (mut lines, mut row) = (Vec::new(), 0);
    let found = Table::open(path).and_then(|mut table| {
        table.each_row(&[], |line, _| {
            row += 1;
            if rows.get(lines.len()) == Some(&row) {
                lines.push(line);
            }
        })
    });
    // A file that changed since it was read has no lines to tell.
    if found.is_ok() { lines } else { Vec::new() }
}

fn places(header: &[String], names: &[&str]) -> Result<Vec<usize>, RecordError> {
    let mut found: HashMap<&str, (usize, usize)> = HashMap::new();
    for (place, name) in header.iter().enumerate() {
        found.entry(name).or_insert((place, 0)).1 += 1;
    }
    let place = |name: &&str| match found.get(name) {
        None => Err(missing(name, header)),
        Some(&(place, 1)) => Ok(place),
        Some(&(_, times)) => Err(RecordError::CsvDuplicate {
            column: (*name).to_owned(),
            times,
        }),
    };
    names.iter().map(place).collect()
}

fn malformed(line: u64, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "CSV",
        variable: String::new(),
        problem: format!("line {line}: {problem}"),
    }
}
