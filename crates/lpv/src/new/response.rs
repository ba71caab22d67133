//! Files that hold frequency responses and no samples.

mod arrays;
mod part;
mod table;
mod universal;

use super::given::{UNNAMEABLE, common_folder, name_of};
use super::roles::is_frequency;
use super::write::{HEAD, list, quoted};
use super::{Draft, Known, position, refuse};
use crate::PipelineError;
use crate::responses::BELOW_RATE;
use experiment_data::{Contents, ResponseQuantity};
pub(super) use part::is_response;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
pub(super) use table::of_tables;

/// What files that each hold the responses of the same outputs to the same inputs tell.
#[derive(Debug, Default)]
pub(super) struct Found {
    outputs: Vec<String>,
    inputs: Vec<String>,
    /// Where a record has its parts: the names that a description gives them, and those of the file.
    columns: Vec<(String, String)>,
    quantity: Option<ResponseQuantity>,
    /// Unit of the outputs and of the inputs, and what takes the outputs of the file to theirs.
    units: Option<(String, String)>,
    scale: Option<f64>,
    highest_hz: f64,
    /// `[text]`, where files are laid out otherwise than usual.
    layout: String,
    guesses: Vec<String>,
}

/// Refuses a table without a time whose frequency goes one way: lines of a response under names that do not say so.
///
/// # Errors
/// With the column, and how to describe either.
pub(super) fn refuse_sweep<'a>(
    file: &Path,
    columns: &[String],
    column: &impl Fn(&str) -> Option<&'a [f64]>,
) -> Result<(), PipelineError> {
    let goes_one_way =
        |x: &[f64]| x.len() > 2 && (x.windows(2).all(|w| w[0] < w[1]) || x.windows(2).all(|w| w[0] > w[1]));
    // `omega` is a speed as often.
    let is_called = |name: &str| is_frequency(name) && !name.to_lowercase().contains("omega");
    let is_sweep = |name: &&String| is_called(name) && column(name).is_some_and(goes_one_way);
    columns.iter().find(is_sweep).map_or(Ok(()), |name| {
        let problem = format!(
            "no column tells the time, and `{name}` goes one way; give --output and --input if these are samples of a sweep; else {}",
            table::RESPONSE
        );
        Err(refuse(file, problem))
    })
}

/// The draft of such files, unless they are tables, which are looked at with those of samples; none of others.
///
/// # Errors
/// A file whose responses have gaps, or others than those of the first.
pub(super) fn draft(
    (files, paths): (&[PathBuf], &[PathBuf]),
    contents: &[Contents],
    known: &Known,
) -> Result<Option<Draft>, PipelineError> {
    let found = match universal::of_universal(files, paths, contents)? {
        Some(found) => Some(found),
        None => arrays::of_arrays(files, paths, contents)?,
    };
    found.map(|found| found.drafted(files, paths, known)).transpose()
}

impl Found {
    /// The description.
    pub(super) fn drafted(
        mut self,
        files: &[PathBuf],
        paths: &[PathBuf],
        known: &Known,
    ) -> Result<Draft, PipelineError> {
        let folder = common_folder(paths)
            .ok_or_else(|| refuse(&files[0], "the files have no common folder".to_owned()))?;
        let rate = known
            .sample_rate_hz
            .unwrap_or((BELOW_RATE * self.highest_hz).ceil());
        let own = folder.file_name().map(|n| n.to_string_lossy().into_owned());
        let name = known
            .name
            .clone()
            .or(own)
            .unwrap_or_else(|| "experiment".to_owned());
        let mut text = format!(
            "{HEAD}format = 2\nname = {}\nsample_rate = {rate:?}  # GUESS: that of the model, free to choose from {BELOW_RATE} times the \
             highest line on\n",
            quoted(&name)
        );
        for (role, names) in [("output", &self.outputs), ("input", &self.inputs)] {
            let _ = writeln!(text, "\n[channels.{role}]\ncolumns = {}", list(names));
            // Of an acceleration over a force a model has the displacement.
            let is_accelerance = self.quantity == Some(ResponseQuantity::AccelerationForce);
            match &self.units {
                Some(_) if is_accelerance && role == "output" => {
                    let _ = writeln!(
                        text,
                        "quantity = {}  # GUESS",
                        list(&vec!["position"; names.len()])
                    );
                }
                Some((output, input)) => {
                    let unit = if role == "output" { output } else { input };
                    let _ = writeln!(text, "units = {}", list(&vec![unit; names.len()]));
                }
                None => {}
            }
            if let (Some(scale), "output") = (self.scale, role) {
                let _ = writeln!(text, "scale = {:?}", vec![scale; names.len()]);
            }
        }
        text += &self.layout;
        let mut questions = Vec::new();
        let relative: Vec<String> = files
            .iter()
            .zip(paths)
            .map(|(file, path)| name_of(path, &folder).ok_or_else(|| refuse(file, UNNAMEABLE.to_owned())))
            .collect::<Result<_, _>>()?;
        let places = match relative.len() {
            1 => None,
            _ => position::in_names(&relative),
        };
        let columns: Vec<String> = self
            .columns
            .iter()
            .map(|(name, place)| format!("{} = {}", key(name), quoted(place)))
            .collect();
        for (k, file) in relative.iter().enumerate() {
            let held = known
                .validation
                .iter()
                .any(|v| v.canonicalize().is_ok_and(|v| v == paths[k]));
            let _ = write!(
                text,
                "\n[[records]]\nfile = {}\nkind = \"response\"\nuse = \"{}\"\n",
                quoted(file),
                if held { "validation" } else { "estimation" }
            );
            if !columns.is_empty() {
                let _ = writeln!(text, "columns = {{ {} }}", columns.join(", "));
            }
            match self.quantity {
                None => {
                    text += "# quantity = \"displacement/force\"  # FILL IN: displacement, velocity or acceleration over force or input\n";
                }
                Some(quantity) if self.units.is_some() => {
                    let _ = writeln!(text, "quantity = \"{}\"  # GUESS", quantity.name());
                }
                // The file says it.
                Some(_) => {}
            }
            if let Some(value) = places.as_ref().and_then(|p| p.get(k)) {
                let _ = writeln!(text, "# position = {value}  # FILL IN: the place, if it is one");
            }
        }
        let mut guesses = vec![format!(
            "sample_rate = {rate}, that of the model: the highest line is at {} Hz",
            self.highest_hz
        )];
        guesses.append(&mut self.guesses);
        match self.quantity {
            Some(quantity) => guesses.push(format!("a response of {}, as the file says", quantity.name())),
            None => questions.push("quantity: what the response is of; write it in each record".to_owned()),
        }
        if relative.len() > 1 {
            questions.push(
                "position: where each file was measured; write `position = ...` in each record".to_owned(),
            );
        }
        Ok(Draft {
            folder,
            text,
            guesses,
            questions,
            command: None,
        })
    }
}

/// A key of TOML, bare where it may be.
fn key(name: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    match !name.is_empty() && name.chars().all(is_bare) {
        true => name.to_owned(),
        false => quoted(name),
    }
}

/// Names of some channels: a letter with a number.
fn numbered(letter: &str, count: usize) -> Vec<String> {
    (1..=count).map(|k| format!("{letter}{k}")).collect()
}
