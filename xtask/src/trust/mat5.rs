//! Files of MATLAB level 5 with what the reader of this project never writes: structs, arrays of them, text, objects.

use super::TaskError;
use std::path::Path;

/// What a variable holds.
#[derive(Debug, Clone)]
pub(crate) enum Content {
    /// Rows, columns, values column by column.
    Doubles(usize, usize, Vec<f64>),
    /// A row of bytes.
    Bytes(Vec<u8>),
    /// A row of characters.
    Text(String),
    /// Names of the fields, and a row of structs.
    Structs(Vec<String>, Vec<Vec<Content>>),
    /// An object of this class, its content elsewhere.
    Opaque(String),
}

impl Content {
    pub(crate) fn scalar(value: f64) -> Self {
        Self::Doubles(1, 1, vec![value])
    }
    pub(crate) fn column(values: &[f64]) -> Self {
        Self::Doubles(values.len(), 1, values.to_vec())
    }
    pub(crate) fn row(values: &[f64]) -> Self {
        Self::Doubles(1, values.len(), values.to_vec())
    }
    /// Signals side by side, one a column.
    pub(crate) fn matrix(columns: &[&[f64]]) -> Self {
        Self::Doubles(columns[0].len(), columns.len(), columns.concat())
    }
    /// Signals on top of each other, one a row.
    pub(crate) fn rows(rows: &[&[f64]]) -> Self {
        let long = rows[0].len();
        let values = (0..long).flat_map(|k| rows.iter().map(move |r| r[k])).collect();
        Self::Doubles(rows.len(), long, values)
    }
    /// A row of structs.
    pub(crate) fn structs(names: &[&str], elements: Vec<Vec<Self>>) -> Self {
        Self::Structs(names.iter().map(ToString::to_string).collect(), elements)
    }
}

/// Writes a file of these variables.
pub(crate) fn write(file: &Path, variables: Vec<(&str, Content)>) -> Result<(), TaskError> {
    let mut bytes = b"MATLAB 5.0 MAT-file, made by the bench of this project".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0, 1]);
    bytes.extend(b"IM");
    for (name, content) in &variables {
        bytes.extend(variable(name, content));
    }
    Ok(std::fs::write(file, bytes)?)
}

/// A tagged element, padded to eight bytes.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = kind.to_le_bytes().to_vec();
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

fn integers(values: &[usize]) -> Vec<u8> {
    values.iter().flat_map(|v| (*v as i32).to_le_bytes()).collect()
}

/// Class and dimensions; then the name.
fn header(class: u8, name: &str, rows: usize, columns: usize) -> Vec<u8> {
    let mut out = element(6, &[class, 0, 0, 0, 0, 0, 0, 0]);
    out.extend(element(5, &integers(&[rows, columns])));
    out.extend(element(1, name.as_bytes()));
    out
}

fn variable(name: &str, content: &Content) -> Vec<u8> {
    let inside = match content {
        Content::Doubles(rows, columns, values) => {
            let mut out = header(6, name, *rows, *columns);
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            out.extend(element(9, &bytes));
            out
        }
        Content::Bytes(bytes) => {
            let mut out = header(9, name, 1, bytes.len());
            out.extend(element(2, bytes));
            out
        }
        Content::Text(text) => {
            let mut out = header(4, name, 1, text.chars().count());
            let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            out.extend(element(4, &wide));
            out
        }
        Content::Structs(names, elements) => {
            let mut out = header(2, name, 1, elements.len());
            let long = names.iter().map(String::len).max().unwrap_or(0) + 1;
            out.extend(element(5, &integers(&[long])));
            let mut table = Vec::new();
            for name in names {
                let mut padded = name.clone().into_bytes();
                padded.resize(long, 0);
                table.extend(padded);
            }
            out.extend(element(1, &table));
            for field in elements.iter().flatten() {
                out.extend(variable("", field));
            }
            out
        }
        Content::Opaque(class) => {
            let mut out = element(6, &[17, 0, 0, 0, 0, 0, 0, 0]);
            out.extend(element(1, name.as_bytes()));
            out.extend(element(1, b"MCOS"));
            out.extend(element(1, class.as_bytes()));
            let reference = [0xdd00_0000_u32, 2, 1, 1, 1, 1];
            let mut inside = header(13, "", 6, 1);
            inside.extend(element(
                6,
                &reference.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>(),
            ));
            out.extend(element(14, &inside));
            out
        }
    };
    element(14, &inside)
}
