use super::element::MATRIX;
use crate::RecordError;
use std::fs::File;
use std::io::{BufWriter, Write};

/// Columns as N x 1 doubles, little endian, uncompressed, without a date: the same columns give the same bytes.
pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    for (name, column) in names.iter().zip(columns) {
        writable(name, column.len())?;
    }
    let mut out = BufWriter::new(file);
    content(&mut out, names, columns).map_err(RecordError::io("write"))?;
    out.flush().map_err(RecordError::io("write"))?;
    out.into_inner()
        .map_err(|e| RecordError::io("write")(e.into_error()))
}

fn content(out: &mut impl Write, names: &[&str], columns: &[&[f64]]) -> std::io::Result<()> {
    header(out)?;
    for (name, column) in names.iter().zip(columns) {
        let padded = name.len().next_multiple_of(8);
        let data = 8 * column.len();
        // Flags 16, dimensions 16, name, numbers, each with its tag.
        element(out, MATRIX, 16 + 16 + 8 + padded + 8 + data)?;
        element(out, 6, 8)?;
        out.write_all(&6u32.to_le_bytes())?;
        out.write_all(&0u32.to_le_bytes())?;
        element(out, 5, 8)?;
        out.write_all(&(column.len() as u32).to_le_bytes())?;
        out.write_all(&1u32.to_le_bytes())?;
        element(out, 1, name.len())?;
        out.write_all(name.as_bytes())?;
        out.write_all(&[0; 8][..padded - name.len()])?;
        element(out, 9, data)?;
        for value in *column {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

/// The 128 bytes in front of a file.
pub(super) fn header(out: &mut impl Write) -> std::io::Result<()> {
    let mut header = [b' '; 128];
    let text = b"MATLAB 5.0 MAT-file";
    header[..text.len()].copy_from_slice(text);
    header[116..124].fill(0);
    header[124..].copy_from_slice(&[0x00, 0x01, b'I', b'M']);
    out.write_all(&header)
}

pub(super) fn element(out: &mut impl Write, kind: u32, bytes: usize) -> std::io::Result<()> {
    out.write_all(&kind.to_le_bytes())?;
    out.write_all(&(bytes as u32).to_le_bytes())
}

/// Names and sizes that the format can hold.
pub(super) fn writable(name: &str, rows: usize) -> Result<(), RecordError> {
    let letters = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let reason = if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || !name.chars().all(letters) {
        "a MATLAB name starts with a letter and has letters, digits and `_` only"
    } else if name.len() > 63 {
        "a MATLAB name has at most 63 characters"
    } else if rows > (1 << 28) {
        "a variable holds less than 2 GiB"
    } else {
        return Ok(());
    };
    Err(RecordError::Unwritable {
        column: name.to_owned(),
        format: "MAT",
        reason,
    })
}
