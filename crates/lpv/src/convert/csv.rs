//! One matrix entry a line: `matrix,p,row,column,value`, rows and columns from 1; `p` only for the frozen systems.

use super::exchange::Exchange;
use crate::PipelineError;
use crate::encode::cell;
use lpv_core::nalgebra::DMatrix;
use std::path::Path;

pub(crate) const HEAD: [&str; 5] = ["matrix", "p", "row", "column", "value"];

pub(super) fn write(e: &Exchange) -> Result<Vec<u8>, PipelineError> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let text = |v: f64| format!("{v:?}");
    let failed = |e: csv::Error| PipelineError::Format(e.to_string());
    out.write_record(HEAD).map_err(failed)?;
    if !e.note.is_empty() {
        out.write_record(["note", "", "", "", &cell(&e.note)])
            .map_err(failed)?;
    }
    out.write_record(["kind", "", "", "", &cell(&e.kind)])
        .map_err(failed)?;
    out.write_record(["sample_time", "", "", "", &text(e.sample_time)])
        .map_err(failed)?;
    let mut matrix = |name: &str, p: &str, m: &DMatrix<f64>| -> Result<(), csv::Error> {
        // The shape is needed where a dimension is zero.
        out.write_record([
            &format!("size {name}"),
            p,
            &m.nrows().to_string(),
            &m.ncols().to_string(),
            "",
        ])?;
        for i in 0..m.nrows() {
            for j in 0..m.ncols() {
                out.write_record([
                    name,
                    p,
                    &(i + 1).to_string(),
                    &(j + 1).to_string(),
                    &text(m[(i, j)]),
                ])?;
            }
        }
        Ok(())
    };
    for (name, m) in &e.blocks {
        matrix(name, "", m).map_err(failed)?;
    }
    for (p, system) in &e.grid {
        let p: Vec<String> = p.iter().map(|v| text(*v)).collect();
        for (name, m) in ["A", "B", "C", "D"].iter().zip(system) {
            matrix(&format!("frozen {name}"), &p.join(" "), m).map_err(failed)?;
        }
    }
    out.write_record(["end", "", "", "", ""]).map_err(failed)?;
    out.into_inner().map_err(|e| PipelineError::Format(e.to_string()))
}

/// `A,,1,1,0` with its end.
const SHORTEST_LINE: u64 = 9;
/// More than any model has, its parameters included.
const MOST_MATRICES: usize = 1000;

/// The matrices of the model; the frozen systems follow from them.
pub(super) fn read(file: &Path) -> Result<Exchange, String> {
    let mut reader = csv::Reader::from_path(file).map_err(|e| e.to_string())?;
    if reader.headers().map_err(|e| e.to_string())? != &csv::StringRecord::from(HEAD.to_vec()) {
        return Err(format!("line 1: the header is not `{}`", HEAD.join(",")));
    }
    let mut e = Exchange {
        description: String::new(),
        kind: String::new(),
        sample_time: 0.0,
        blocks: Vec::new(),
        grid: Vec::new(),
        note: String::new(),
        inputs: Vec::new(),
        outputs: Vec::new(),
    };
    let mut whole = false;
    // Every entry has a line of its own, so that the length of the file bounds what it may claim.
    let mut room = file.metadata().map_or(0, |m| m.len()) / SHORTEST_LINE;
    for row in reader.records() {
        let row = row.map_err(|e| e.to_string())?;
        let line = row.position().map_or(0, csv::Position::line);
        let at = |problem: String| format!("line {line}: {problem}");
        let (name, p, value) = (&row[0], &row[1], &row[4]);
        let number = |v: &str| {
            v.trim()
                .parse::<f64>()
                .map_err(|_| at(format!("`{v}` is not a number")))
        };
        let index = |v: &str| {
            v.trim()
                .parse::<usize>()
                .map_err(|_| at(format!("`{v}` is no count")))
        };
        match name {
            "end" => whole = true,
            "note" => value.clone_into(&mut e.note),
            "kind" => value.clone_into(&mut e.kind),
            "sample_time" => e.sample_time = number(value)?,
            _ if !p.is_empty() => {}
            _ => match name.strip_prefix("size ") {
                Some(name) => {
                    const LARGEST: usize = 1 << 20;
                    let (rows, columns) = (index(&row[2])?, index(&row[3])?);
                    if rows.max(columns) > LARGEST || e.blocks.len() == MOST_MATRICES {
                        return Err(at(format!("a matrix of {rows} x {columns} is no model")));
                    }
                    room = room
                        .checked_sub((rows as u64).saturating_mul(columns as u64))
                        .ok_or_else(|| {
                            at(format!(
                                "a matrix of {rows} x {columns}, which is more than the file has lines"
                            ))
                        })?;
                    e.blocks
                        .push((name.to_owned(), DMatrix::from_element(rows, columns, f64::NAN)));
                }
                None => {
                    let (i, j) = (index(&row[2])?, index(&row[3])?);
                    let value = number(value)?;
                    let entry = e
                        .blocks
                        .iter_mut()
                        .find(|(n, _)| n == name)
                        .and_then(|(_, m)| m.get_mut((i.wrapping_sub(1), j.wrapping_sub(1))))
                        .ok_or_else(|| {
                            at(format!(
                                "`{name}` has no entry ({i}, {j}); its size must stand before its entries"
                            ))
                        })?;
                    *entry = value;
                }
            },
        }
    }
    if whole {
        Ok(e)
    } else {
        Err("the file is cut off: its last line is not `end`".to_owned())
    }
}
