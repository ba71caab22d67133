//! Text tables: a line of names, fields between commas, semicolons, tabs or blanks, decimal points or commas. `[text]` of a
//! description says how a file is laid out, or it is found by looking where only one way makes a table of it. A byte
//! order mark in front is tolerated.

mod blocks;
mod cell;
mod look;
mod rows;
mod split;
#[cfg(test)]
mod tests;
mod units;
mod writer;

use super::Sink;
use crate::RecordError;
use crate::contents::{Column, ColumnInfo, Contents, MOST_SCALARS, PassedOver, Scalar, missing};
use crate::text::{Decimal, Text};
use look::{Layout, look};
use rows::{Table, refuse_words};
use std::collections::HashMap;
use std::path::Path;

pub(crate) use writer::write;

pub(crate) fn read(path: &Path, names: &[&str], text: Option<&Text>) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut columns = vec![Vec::new(); names.len()];
    each_block(path, names, text, usize::MAX, &mut |all| columns = all)?;
    Ok(columns)
}

pub(crate) fn each_block(
    path: &Path,
    names: &[&str],
    text: Option<&Text>,
    rows: usize,
    sink: Sink<'_>,
) -> Result<(), RecordError> {
    let (layout, mut table) = open(path, text)?;
    let header = table.header().to_vec();
    let places = places(&header, names, &layout)?;
    let mut wanted = places.clone();
    wanted.sort_unstable();
    wanted.dedup();
    let order: Vec<usize> = places
        .iter()
        .map(|place| wanted.partition_point(|w| w < place))
        .collect();
    let empty = || vec![Vec::new(); names.len()];
    let (mut columns, mut filled): (Vec<Vec<f64>>, usize) = (empty(), 0);
    let refuse = &mut refuse_words(&header, layout.decimal);
    table.each_row(&wanted, refuse, |_, values| {
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

fn open(path: &Path, text: Option<&Text>) -> Result<(Layout, Table), RecordError> {
    // What is no text at all, the blocks refuse first.
    blocks::Blocks::open(path)?;
    let layout = look(path, text)?;
    let table = Table::open(path, layout.clone())?;
    Ok((layout, table))
}

/// The columns whose first row is a number.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    let (layout, mut table) = open(path, None)?;
    let header = table.header().to_vec();
    let decimal = layout.decimal.unwrap_or(Decimal::Point);
    let names: Vec<String> = match table.peek()? {
        None => Vec::new(),
        Some(row) => header
            .iter()
            .zip(row.fields())
            .filter(|(name, field)| !name.is_empty() && cell::number(field, decimal).is_some())
            .map(|(name, _)| name.clone())
            .collect(),
    };
    let wanted: Vec<&str> = names.iter().map(String::as_str).collect();
    if !wanted.is_empty() {
        places(&header, &wanted, &layout)?;
    }
    let mut rows = 0;
    table.each_row(&[], &mut refuse_words(&header, layout.decimal), |_, _| rows += 1)?;
    Ok(names.into_iter().map(|name| ColumnInfo { name, rows }).collect())
}

/// What a column holds besides numbers.
#[derive(Clone, Default)]
struct Holes {
    count: u64,
    first_line: u64,
    text: String,
}

/// Every column, by all of its rows.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let (layout, mut table) = open(path, None)?;
    let text = layout.text();
    let mut header = table.header().to_vec();
    if let Some(text) = text.as_ref().filter(|t| t.header == Some(0)) {
        header.clone_from(&text.names);
    }
    let decimal = layout.decimal.unwrap_or(Decimal::Point);
    let mut stamps = vec![false; header.len()];
    let mut first = vec![None; header.len()];
    if let Some(row) = table.peek()? {
        for ((stamp, first), field) in stamps.iter_mut().zip(&mut first).zip(row.fields()) {
            *first = cell::number(field, decimal);
            // A number in two words is a duration.
            let is_told = field.contains(&b':') || field.trim_ascii().contains(&b' ');
            *stamp = is_told && first.is_some();
        }
    }
    let wanted: Vec<usize> = (0..header.len()).filter(|k| !header[*k].is_empty()).collect();
    let mut holes = vec![Holes::default(); header.len()];
    let mut rows = 0;
    let mut note = |line: u64, place: usize, field: &[u8]| {
        let own = &mut holes[place];
        if own.count == 0 {
            own.first_line = line;
            own.text = String::from_utf8_lossy(field.trim_ascii())
                .chars()
                .take(40)
                .collect();
        }
        own.count += 1;
        Ok(f64::NAN)
    };
    table.each_row(&wanted, &mut note, |_, _| rows += 1)?;
    let mut times: HashMap<&str, usize> = HashMap::new();
    header.iter().for_each(|h| *times.entry(h).or_default() += 1);
    let (mut columns, mut passed_over, mut scalars) = (Vec::new(), Vec::new(), Vec::new());
    for place in wanted {
        let (name, own) = (&header[place], &holes[place]);
        if times[name.as_str()] > 1 {
            places(&header, &[name], &layout)?;
        }
        if own.count > 0 {
            passed_over.push(passed(name, own, rows));
            // A setting in the first row, nothing below.
            let is_alone = own.text.is_empty() && own.count + 1 == rows;
            if let Some(value) = first[place].filter(|v: &f64| v.is_finite() && is_alone)
                && scalars.len() < MOST_SCALARS
            {
                scalars.push(Scalar {
                    name: name.clone(),
                    value,
                });
            }
            continue;
        }
        columns.push(Column {
            name: name.clone(),
            rows,
            unit: layout.units.get(place).cloned().unwrap_or_default(),
            source: None,
            is_stamp: stamps[place],
        });
    }
    Ok(Contents {
        columns,
        passed_over,
        scalars,
        is_text: true,
        text,
        notes: layout.preamble,
        ..Contents::default()
    })
}

fn passed(name: &str, own: &Holes, rows: u64) -> PassedOver {
    let (count, line) = (own.count, own.first_line);
    let what = match own.text.as_str() {
        "" if count == rows => "empty".to_owned(),
        "" => format!("no value in {count} of {rows} rows, the first in line {line}"),
        words if count == rows => format!("words (`{words}`)"),
        words => format!("no number in {count} of {rows} rows, the first `{words}` in line {line}"),
    };
    PassedOver {
        name: name.to_owned(),
        what,
        remedy: if count == rows {
            String::new()
        } else {
            "complete the rows to use it".to_owned()
        },
    }
}

/// The lines of the given data rows (from 1, ascending) of a text table, as far as the file still has them; none of other
/// files.
pub fn lines_of_rows(path: &Path, text: Option<&Text>, rows: &[usize]) -> Vec<u64> {
    let (mut lines, mut row) = (Vec::new(), 0);
    if !super::is_csv(path) {
        return lines;
    }
    let found = open(path, text).and_then(|(_, mut table)| {
        table.each_row(&[], &mut |_, _, _| Ok(f64::NAN), |line, _| {
            row += 1;
            if rows.get(lines.len()) == Some(&row) {
                lines.push(line);
            }
        })
    });
    // A file that changed since it was read has no lines to tell.
    if found.is_ok() { lines } else { Vec::new() }
}

fn places(header: &[String], names: &[&str], layout: &Layout) -> Result<Vec<usize>, RecordError> {
    if header.iter().all(String::is_empty) {
        return Err(RecordError::TextLayout {
            problem: format!(
                "no line has the names of the {} columns; write header = 0 and their names",
                header.len()
            ),
        });
    }
    let mut found: HashMap<&str, (usize, usize)> = HashMap::new();
    for (place, name) in header.iter().enumerate() {
        found.entry(name).or_insert((place, 0)).1 += 1;
    }
    let place = |name: &&str| match found.get(name) {
        None => Err(missing(name, header)),
        Some(&(place, 1)) => Ok(place),
        Some(&(_, times)) => Err(RecordError::CsvDuplicate {
            line: layout.header.max(1),
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
