//! Universal files.

use super::{Found, numbered};
use crate::PipelineError;
use crate::new::refuse;
use crate::new::write::quoted;
use experiment_data::{Contents, RecordFormat, ResponseInfo};
use std::path::{Path, PathBuf};

/// What universal files tell that each hold the same responses and nothing else; none of others.
pub(super) fn of_universal(
    files: &[PathBuf],
    paths: &[PathBuf],
    contents: &[Contents],
) -> Result<Option<Found>, PipelineError> {
    let is_universal = |path: &PathBuf| RecordFormat::of(&path.to_string_lossy()) == Ok(RecordFormat::Uff);
    let is_of_responses = |c: &Contents| c.columns.is_empty() && !c.responses.is_empty();
    if !paths.iter().all(is_universal) || !contents.iter().all(is_of_responses) {
        return Ok(None);
    }
    let all: Vec<&[ResponseInfo]> = contents.iter().map(|c| c.responses.as_slice()).collect();
    let first = all[0];
    let [outputs, inputs] = [
        distinct(first.iter().map(|r| r.output.as_str())),
        distinct(first.iter().map(|r| r.input.as_str())),
    ];
    for (file, found) in files.iter().zip(&all) {
        check(file, found, (&outputs, &inputs))?;
    }
    let (y, u) = (numbered("y", outputs.len()), numbered("u", inputs.len()));
    let of = |names: &[String], places: &[&str]| -> Vec<(String, String)> {
        let each = names.iter().zip(places);
        each.map(|(name, place)| (name.clone(), (*place).to_owned()))
            .collect()
    };
    let said = |pairs: &[(String, String)]| {
        let each: Vec<String> = pairs
            .iter()
            .map(|(name, place)| format!("{name} = {}", quoted(place)))
            .collect();
        each.join(", ")
    };
    let (own_y, own_u) = (of(&y, &outputs), of(&u, &inputs));
    let is_known = all.iter().copied().flatten().all(|r| r.quantity.is_some());
    Ok(Some(Found {
        guesses: vec![
            format!("output: {}", said(&own_y)),
            format!("input: {}", said(&own_u)),
        ],
        columns: [own_y, own_u].concat(),
        quantity: first[0].quantity.filter(|_| is_known),
        highest_hz: all
            .iter()
            .copied()
            .flatten()
            .map(|r| r.highest_hz)
            .fold(0.0, f64::max),
        outputs: y,
        inputs: u,
        ..Found::default()
    }))
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut all = Vec::new();
    for name in names {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// Refuses what is no response of each of these outputs to each of these inputs.
fn check(
    file: &Path,
    found: &[ResponseInfo],
    (outputs, inputs): (&[&str], &[&str]),
) -> Result<(), PipelineError> {
    for output in outputs {
        for input in inputs {
            let count = found
                .iter()
                .filter(|r| r.output == *output && r.input == *input)
                .count();
            if count != 1 {
                let problem = format!(
                    "{count} frequency responses of {output} to {input}, where the files have the outputs {} and the inputs {}: write a \
                     description by hand, see docs/experiment-format.md, with the channels of one bundle",
                    outputs.join(", "),
                    inputs.join(", ")
                );
                return Err(refuse(file, problem));
            }
        }
    }
    match found.len() == outputs.len() * inputs.len() {
        true => Ok(()),
        false => Err(refuse(
            file,
            "it has other channels than the first file; make one bundle for each kind".to_owned(),
        )),
    }
}
