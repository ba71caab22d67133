//! Files of arrays: `.npz`, `.mat`, `.h5`.

use super::{Found, numbered};
use crate::PipelineError;
use crate::new::refuse;
use experiment_data::{Contents, ResponseArrays, response_arrays};
use std::path::PathBuf;

/// What files tell that each hold the same arrays of a response; none of others.
pub(super) fn of_arrays(
    files: &[PathBuf],
    paths: &[PathBuf],
    contents: &[Contents],
) -> Result<Option<Found>, PipelineError> {
    let mut all: Vec<ResponseArrays> = Vec::new();
    for ((file, path), contents) in files.iter().zip(paths).zip(contents) {
        match response_arrays(path, contents).map_err(|e| refuse(file, e.to_string()))? {
            Some(found) => all.push(found),
            None if all.is_empty() => return Ok(None),
            None => return Err(refuse(file, OTHER.to_owned())),
        }
    }
    let Some(first) = all.first() else {
        return Ok(None);
    };
    let size = |r: &ResponseArrays| (r.outputs, r.inputs, r.columns.clone());
    if let Some(k) = all.iter().position(|r| size(r) != size(first)) {
        return Err(refuse(&files[k], OTHER.to_owned()));
    }
    let named: Vec<String> = first
        .columns
        .iter()
        .map(|(part, place)| format!("{part} = {place}"))
        .collect();
    let sizes = format!(
        "{} outputs and {} inputs, by the size of the response",
        first.outputs, first.inputs
    );
    Ok(Some(Found {
        guesses: std::iter::once(sizes)
            .chain((!named.is_empty()).then(|| named.join(", ")))
            .collect(),
        columns: first.columns.clone(),
        highest_hz: all.iter().map(|r| r.highest_hz).fold(0.0, f64::max),
        outputs: numbered("y", first.outputs),
        inputs: numbered("u", first.inputs),
        ..Found::default()
    }))
}

/// Of a file that is not as the first.
const OTHER: &str = "it has no frequency response with as many outputs and inputs, under the same names, as the first file; make one bundle \
    for each kind";
