//! CSV: a header line, commas, decimal points. A byte order mark is tolerated; semicolons, tabs and decimal commas are
//! refused, because guessing them wrong would shift columns silently.

use super::missing;
use crate::RecordError;
use csv::{ByteRecord, Reader, ReaderBuilder};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut reader = open(path)?;
    let mut row = ByteRecord::new();
    if !reader.read_byte_record(&mut row).map_err(damaged)? {
        return Err(RecordError::Malformed {
            format: "CSV",
            variable: String::new(),
            problem: "the file is empty; the first line must name the columns".to_owned(),
        });
    }
    let header: Vec<String> = header(&row);
    separators(&header)?;
    let places = places(&header, names)?;
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
    while reader.read_byte_record(&mut row).map_err(damaged)? {
        if row.len() != header.len() {
            return Err(RecordError::CsvRagged {
                line: line(&row),
                expected: header.len() as u64,
                found: row.len() as u64,
            });
        }
        for (column, &place) in columns.iter_mut().zip(&places) {
            let field = row.get(place).unwrap_or_default();
            column.push(number(field).ok_or_else(|| RecordError::CsvNumber {
                line: line(&row),
                column: header[place].clone(),
                text: String::from_utf8_lossy(field).chars().take(40).collect(),
            })?);
        }
    }
    Ok(columns)
}

/// The lines of the given data rows (from 1), as far as the file still has them.
pub(crate) fn lines_of_rows(path: &Path, rows: &[usize]) -> Vec<u64> {
    let Ok(mut reader) = open(path) else {
        return Vec::new();
    };
    let mut lines = Vec::new();
    // The header is number 0, so data rows count from 1.
    for (number, row) in reader.byte_records().enumerate() {
        let Ok(row) = row else { break };
        if rows.contains(&number) {
            lines.push(line(&row));
        }
        if lines.len() == rows.len() {
            break;
        }
    }
    lines
}

pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    let to_error = |e: csv::Error| RecordError::io("write")(e.into());
    let mut writer = csv::Writer::from_writer(BufWriter::new(file));
    writer.write_record(names).map_err(to_error)?;
    let rows = columns.first().map_or(0, |c| c.len());
    let mut text = String::new();
    for k in 0..rows {
        for column in columns {
            use std::fmt::Write as _;
            text.clear();
            // `{:?}` is the shortest text that reads back to the same bits.
            let _ = write!(text, "{:?}", column[k]);
            writer.write_field(&text).map_err(to_error)?;
        }
        writer.write_record(None::<&[u8]>).map_err(to_error)?;
    }
    let mut buffer = writer
        .into_inner()
        .map_err(|e| RecordError::io("write")(std::io::Error::other(e.error().to_string())))?;
    buffer.flush().map_err(RecordError::io("write"))?;
    buffer
        .into_inner()
        .map_err(|e| RecordError::io("write")(e.into_error()))
}

fn open(path: &Path) -> Result<Reader<File>, RecordError> {
    let file = File::open(path).map_err(RecordError::io("open"))?;
    Ok(ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(file))
}

fn damaged(e: csv::Error) -> RecordError {
    RecordError::io("read")(e.into())
}

fn line(row: &ByteRecord) -> u64 {
    row.position().map_or(0, csv::Position::line)
}

fn header(row: &ByteRecord) -> Vec<String> {
    row.iter()
        .enumerate()
        .map(|(i, field)| {
            let text = String::from_utf8_lossy(field);
            let text = if i == 0 {
                text.trim_start_matches('\u{feff}')
            } else {
                &text
            };
            text.trim().to_owned()
        })
        .collect()
}

/// One field that holds a foreign separator is a header that nobody split.
fn separators(header: &[String]) -> Result<(), RecordError> {
    let found = match header {
        [one] if one.contains(';') => "semicolons",
        [one] if one.contains('\t') => "tabs",
        // Semicolons between fields and commas inside them, or the other way round.
        many if many.iter().any(|f| f.contains(';')) => "semicolons",
        _ => return Ok(()),
    };
    Err(RecordError::CsvSeparator { found })
}

fn places(header: &[String], names: &[&str]) -> Result<Vec<usize>, RecordError> {
    names
        .iter()
        .map(|name| {
            let times = header.iter().filter(|h| h == name).count();
            match header.iter().position(|h| h == name) {
                None => Err(missing(name, header)),
                Some(_) if times > 1 => Err(RecordError::CsvDuplicate {
                    column: (*name).to_owned(),
                    times,
                }),
                Some(place) => Ok(place),
            }
        })
        .collect()
}

fn number(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field.trim_ascii()).ok()?.parse().ok()
}
