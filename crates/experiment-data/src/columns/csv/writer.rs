use crate::RecordError;
use std::fs::File;
use std::io::{BufWriter, Write};

/// A header and rows; every number is the shortest text that reads back to the same bits.
pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    for name in names {
        writable(name)?;
    }
    let mut out = BufWriter::new(file);
    content(&mut out, names, columns).map_err(RecordError::io("write"))?;
    out.into_inner()
        .map_err(|e| RecordError::io("write")(e.into_error()))
}

fn content(out: &mut impl Write, names: &[&str], columns: &[&[f64]]) -> std::io::Result<()> {
    for (k, name) in names.iter().enumerate() {
        let comma = if k == 0 { "" } else { "," };
        if name.contains([',', '"']) {
            write!(out, "{comma}\"{}\"", name.replace('"', "\"\""))?;
        } else {
            write!(out, "{comma}{name}")?;
        }
    }
    writeln!(out)?;
    for row in 0..columns.first().map_or(0, |c| c.len()) {
        for (k, column) in columns.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            write!(out, "{comma}{:?}", column[row])?;
        }
        writeln!(out)?;
    }
    out.flush()
}

/// Names that the reader would not give back.
fn writable(name: &str) -> Result<(), RecordError> {
    let reason = if name.trim() != name {
        "spaces around a name are lost"
    } else if name.contains(['\n', '\r', '\0', '\u{feff}']) {
        "a name is one line of text"
    } else if name.contains([';', '\t']) {
        "a semicolon or a tab in the header looks like a separator"
    } else {
        return Ok(());
    };
    Err(RecordError::Unwritable {
        column: name.to_owned(),
        format: "CSV",
        reason,
    })
}
