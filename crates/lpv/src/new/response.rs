//! Files that hold frequency responses and no samples.

use super::write::{HEAD, list, quoted};
use super::{Draft, Known, common_folder, name_of, position, refuse};
use crate::PipelineError;
use crate::responses::BELOW_RATE;
use experiment_data::{RecordFormat, ResponseInfo, look_into};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The draft of files that each hold the responses of the same outputs to the same inputs, and nothing else; none of others.
///
/// # Errors
/// A file whose responses have gaps, or others than those of the first.
pub(super) fn draft(
    files: &[PathBuf],
    paths: &[PathBuf],
    known: &Known,
) -> Result<Option<Draft>, PipelineError> {
    let is_universal = |path: &PathBuf| RecordFormat::of(&path.to_string_lossy()) == Ok(RecordFormat::Uff);
    if !paths.iter().all(is_universal) {
        return Ok(None);
    }
    let mut all: Vec<Vec<ResponseInfo>> = Vec::new();
    for (file, path) in files.iter().zip(paths) {
        let contents = look_into(path).map_err(|e| refuse(file, e.to_string()))?;
        if !contents.columns.is_empty() || contents.responses.is_empty() {
            return Ok(None);
        }
        all.push(contents.responses);
    }
    let Some(folder) = common_folder(paths) else {
        return Ok(None);
    };
    let first = &all[0];
    let [outputs, inputs] = [
        distinct(first.iter().map(|r| r.output.as_str())),
        distinct(first.iter().map(|r| r.input.as_str())),
    ];
    for (file, found) in files.iter().zip(&all) {
        check(file, found, (&outputs, &inputs))?;
    }
    let highest = all.iter().flatten().map(|r| r.highest_hz).fold(0.0, f64::max);
    let rate = known.sample_rate_hz.unwrap_or((BELOW_RATE * highest).ceil());
    let names = |letter: &str, places: &[&str]| -> Vec<String> {
        (1..=places.len()).map(|k| format!("{letter}{k}")).collect()
    };
    let (y, u) = (names("y", &outputs), names("u", &inputs));
    let of = |names: &[String], places: &[&str]| -> Vec<String> {
        let each = names.iter().zip(places);
        each.map(|(name, place)| format!("{name} = {}", quoted(place)))
            .collect()
    };
    let columns = [of(&y, &outputs), of(&u, &inputs)].concat();
    let own = folder.file_name().map(|n| n.to_string_lossy().into_owned());
    let name = known
        .name
        .clone()
        .or(own)
        .unwrap_or_else(|| "experiment".to_owned());
    let mut text = format!(
        "{HEAD}format = 2\nname = {}\nsample_rate = {rate:?}  # GUESS: that of the model, free to choose from {BELOW_RATE} times the highest line on\n\
         \n[channels.output]\ncolumns = {}\n\n[channels.input]\ncolumns = {}\n",
        quoted(&name),
        list(&y),
        list(&u)
    );
    let mut guesses = vec![
        format!("sample_rate = {rate}, that of the model: the highest line is at {highest} Hz"),
        format!("output: {}", of(&y, &outputs).join(", ")),
        format!("input: {}", of(&u, &inputs).join(", ")),
    ];
    let mut questions = Vec::new();
    let relative: Vec<String> = files
        .iter()
        .zip(paths)
        .map(|(file, path)| name_of(path, &folder).ok_or_else(|| refuse(file, super::UNNAMEABLE.to_owned())))
        .collect::<Result<_, _>>()?;
    let places = match relative.len() {
        1 => None,
        _ => position::in_names(&relative),
    };
    for (k, (file, found)) in relative.iter().zip(&all).enumerate() {
        let _ = write!(
            text,
            "\n[[records]]\nfile = {}\nkind = \"response\"\nuse = \"estimation\"\ncolumns = {{ {} }}\n",
            quoted(file),
            columns.join(", ")
        );
        if found.iter().any(|r| r.quantity.is_none()) {
            text += "# quantity = \"displacement/force\"  # FILL IN: displacement, velocity or acceleration over force or input\n";
        }
        if let Some(value) = places.as_ref().and_then(|p| p.get(k)) {
            let _ = writeln!(text, "# position = {value}  # FILL IN: the place, if it is one");
        }
    }
    match first[0].quantity {
        Some(quantity) => guesses.push(format!("a response of {}, as the file says", quantity.name())),
        None => questions.push("quantity: what the response is of; write it in each record".to_owned()),
    }
    if relative.len() > 1 {
        questions
            .push("position: where each file was measured; write `position = ...` in each record".to_owned());
    }
    Ok(Some(Draft {
        folder,
        text,
        guesses,
        questions,
        command: None,
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
