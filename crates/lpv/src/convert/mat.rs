//! MATLAB 5 files: one struct `lpv` with the matrices, and `lpv.grid` with the frozen systems as `A(:,:,k)`, `B`, `C`, `D`
//! and the scheduling values `p(:,k)`, as `ss` takes them.

use super::exchange::Exchange;
use crate::PipelineError;
use experiment_data::mat::{Array, Value, read_arrays, write_values};
use lpv_core::nalgebra::DMatrix;
use std::path::Path;

pub(super) fn write(e: &Exchange) -> Result<Vec<u8>, PipelineError> {
    let mut fields = vec![
        ("description".to_owned(), Value::Text(e.description.clone())),
        ("kind".to_owned(), Value::Text(e.kind.clone())),
        (
            "Ts".to_owned(),
            matrix(&DMatrix::from_element(1, 1, e.sample_time)),
        ),
    ];
    if !e.note.is_empty() {
        fields.push(("note".to_owned(), Value::Text(e.note.clone())));
    }
    for (name, names) in [("inputs", &e.inputs), ("outputs", &e.outputs)] {
        fields.push((name.to_owned(), Value::Text(names.join(", "))));
    }
    fields.extend(e.blocks.iter().map(|(name, m)| (name.clone(), matrix(m))));
    if let Some((first, systems)) = e.grid.first() {
        let points = e.grid.iter().flat_map(|(p, _)| p.iter().copied()).collect();
        let mut grid = vec![("p".to_owned(), array(&[first.len(), e.grid.len()], points))];
        for (k, name) in ["A", "B", "C", "D"].into_iter().enumerate() {
            let (rows, columns) = systems[k].shape();
            let pages = e.grid.iter().flat_map(|(_, s)| s[k].iter().copied()).collect();
            grid.push((name.to_owned(), array(&[rows, columns, e.grid.len()], pages)));
        }
        fields.push(("grid".to_owned(), Value::Struct(grid)));
    }
    write_values(&[("lpv".to_owned(), Value::Struct(fields))])
        .map_err(|e| PipelineError::Format(e.to_string()))
}

fn matrix(m: &DMatrix<f64>) -> Value {
    array(&[m.nrows(), m.ncols()], m.as_slice().to_vec())
}

fn array(shape: &[usize], data: Vec<f64>) -> Value {
    Value::Array(Array {
        shape: shape.iter().map(|n| *n as u64).collect(),
        data,
    })
}

const LFR: [&str; 11] = [
    "A", "B1", "B2", "C1", "D11", "D12", "C2", "D21", "D22", "range", "deltas",
];
const INNOVATION: [&str; 8] = [
    "A",
    "B",
    "C",
    "D",
    "K",
    "innovation_covariance",
    "input_offset",
    "output_offset",
];
const RIGID_BODY: [&str; 5] = ["A", "B", "C", "D", "axes"];
const STATE_SPACE: [&str; 4] = ["A", "B", "C", "D"];

/// Rows or columns of an empty matrix cost nothing in a file, and time wherever they are counted.
const LARGEST: u64 = 1 << 20;

/// The matrices of the first kind of model whose matrices are all there.
pub(super) fn read(file: &Path) -> Result<Exchange, String> {
    let mut refused = String::new();
    for (kind, names) in [
        ("lfr", LFR.as_slice()),
        ("innovation", &INNOVATION),
        ("rigid-body", &RIGID_BODY),
        ("state-space", &STATE_SPACE),
    ] {
        let full: Vec<String> = ["Ts"].iter().chain(names).map(|n| format!("lpv.{n}")).collect();
        let full: Vec<&str> = full.iter().map(String::as_str).collect();
        let arrays = match read_arrays(file, &full) {
            Ok(arrays) => arrays,
            Err(e) => {
                refused = e.to_string();
                continue;
            }
        };
        let mut matrices = Vec::with_capacity(arrays.len());
        for (array, name) in arrays.into_iter().zip(&full) {
            let [rows, columns] = array.shape[..] else {
                return Err(format!(
                    "`{name}` has the shape {:?}, a matrix is needed",
                    array.shape
                ));
            };
            if rows.max(columns) > LARGEST {
                return Err(format!("`{name}` of {rows} x {columns} is no matrix of a model"));
            }
            matrices.push(DMatrix::from_vec(rows as usize, columns as usize, array.data));
        }
        let sample_time = matrices.remove(0);
        return Ok(Exchange {
            description: String::new(),
            kind: kind.to_owned(),
            sample_time: sample_time.iter().next().copied().unwrap_or(0.0),
            blocks: names.iter().map(ToString::to_string).zip(matrices).collect(),
            grid: Vec::new(),
            note: String::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
        });
    }
    Err(format!(
        "no model in a struct `lpv` with A, B, C, D or A, B1, ... D22: {refused}"
    ))
}
