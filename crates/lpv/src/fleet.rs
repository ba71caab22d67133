//! Many bundles: one task on each, in shards on as many machines as there are, and one table of all.
//!
//! Each shard takes its part of the same list, and writes the results of a bundle into a folder of their own, the row of the table last:
//! what was killed is done again by the same command, and only that. [`merge`] needs the folders alone, not the bundles.

mod error;
mod inputs;
mod merge;
mod shard;

pub use error::FleetError;
pub(crate) use merge::HEAD as TABLE_HEAD;
pub use merge::{Table, TableRow, merge, reads};
pub use shard::Shard;

use crate::diagnose::{Diagnosed, FoundEffect, Given, ResultFiles, diagnose, read_effects};
use crate::output::{Inputs, Kind, Overwrite, Place, write_all};
use crate::{IdentifyConfig, ModelFile, PipelineError, Progress, convert, identify_bundle};
use experiment_data::Bundle;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Name of the list in a folder of results.
const LIST: &str = "fleet.json";

/// Name of the row in the folder of a bundle.
const ROW: &str = "row.json";

/// Version of both files.
const VERSION: u32 = 1;

/// What is done with each bundle.
#[derive(Debug, Clone)]
pub enum Task {
    /// `lpv diagnose`, with the model file and the file of effects where they are given.
    Diagnose {
        /// The model that effects are added to.
        model: Option<PathBuf>,
        /// Effects of the user.
        effects: Option<PathBuf>,
    },
    /// `lpv identify`.
    Identify(Box<IdentifyConfig>),
}

impl Task {
    /// In a word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Diagnose { .. } => "diagnose",
            Self::Identify(_) => "identify",
        }
    }
}

/// The list of a fleet, as each shard writes it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct List {
    fleet: u32,
    task: String,
    bundles: Vec<String>,
}

/// What one bundle gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Row {
    /// Version of this file.
    pub fleet: u32,
    /// `diagnose` or `identify`.
    pub task: String,
    /// The bundle, as it was given.
    pub bundle: String,
    /// What the row was made from, in a number of 16 digits; empty where that cannot be read.
    pub inputs: String,
    /// The judgement in a sentence; none where the bundle was refused.
    pub verdict: Option<String>,
    /// The judgement in a word.
    pub worth: Option<String>,
    /// Effects that were found.
    pub effects: Vec<FoundEffect>,
    /// Why there is no result, as the program says it.
    pub error: Option<String>,
    /// What the program would have ended with.
    pub exit_code: u8,
    /// Time that it took, s.
    pub seconds: f64,
}

/// What a run did.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Account {
    /// The rows of this shard, in the order of the list.
    pub rows: Vec<Row>,
    /// How many of them were there already, made from the same inputs.
    pub kept: usize,
}

/// Does the task on the bundles of a shard, one after the other, and writes what comes out into a folder; other files that stand there
/// in the way of a result are replaced or refused as asked. A bundle that is refused has a row that says so, and the others go on. Rows
/// that are there and were made from the same inputs are kept, unless the machine was at fault for what they say.
///
/// # Errors
/// [`FleetError::OtherList`] for a folder whose list has bundles that are not named here; [`FleetError::Twice`] for a bundle that is
/// named twice; a model file that cannot be read; a result that cannot be written.
pub fn run(
    bundles: &[PathBuf],
    task: &Task,
    shard: Shard,
    (folder, overwrite): (&Path, Overwrite),
    progress: Progress<'_>,
) -> Result<Account, PipelineError> {
    let names: Vec<String> = bundles.iter().map(|b| b.to_string_lossy().into_owned()).collect();
    if let Some(twice) = (0..names.len()).find(|&i| names[..i].contains(&names[i])) {
        let bundle = names[twice].clone();
        return Err(FleetError::Twice { bundle }.into());
    }
    let (model, effects) = match task {
        Task::Diagnose { model, effects } => (
            model.as_deref().map(convert::import).transpose()?,
            effects
                .as_deref()
                .map(read_effects)
                .transpose()?
                .unwrap_or_default(),
        ),
        Task::Identify(_) => (None, Vec::new()),
    };
    let given = Given {
        model: model.as_ref(),
        effects: &effects,
    };
    let list = List {
        fleet: VERSION,
        task: task.name().to_owned(),
        bundles: names.clone(),
    };
    let before = read::<List>(&folder.join(LIST)).ok();
    let left_out = before.and_then(|l| l.bundles.into_iter().find(|b| !names.contains(b)));
    if let Some(bundle) = left_out {
        let folder = folder.to_owned();
        return Err(FleetError::OtherList { folder, bundle }.into());
    }
    let place = Place::check(&folder.join(LIST), Kind::Fleet, &Inputs::none(), overwrite)?;
    write_all(&[(&place, serde_json::to_string_pretty(&list)?.as_bytes())])?;
    let mut account = Account::default();
    for (name, path) in names
        .iter()
        .zip(bundles)
        .enumerate()
        .filter(|(i, _)| shard.takes(*i))
        .map(|(_, b)| b)
    {
        let place = folder.join(inputs::folder_name(path));
        let tell = |step: &str, done: usize, of: usize| progress(&format!("{name}: {step}"), done, of);
        let from = inputs::fingerprint(path, task).unwrap_or_default();
        let known = read::<Row>(&place.join(ROW)).ok();
        if let Some(row) = known.filter(|r| r.is_of(name, task, &from)) {
            account.rows.push(row);
            account.kept += 1;
            continue;
        }
        let start = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| {
            one(path, task, given, (&place, overwrite), &tell)
        }));
        let row = Row {
            seconds: start.elapsed().as_secs_f64(),
            task: task.name().to_owned(),
            bundle: name.clone(),
            inputs: from,
            ..match found {
                Ok(Ok(row)) => row,
                // The place is at fault, and it is the same for the next one.
                Ok(Err(error @ (PipelineError::Write { .. } | PipelineError::Place { .. }))) => {
                    return Err(error);
                }
                Ok(Err(error)) => Row::refused(error.to_string(), error.exit_code()),
                Err(_) => Row::refused(FleetError::Panic.to_string(), 1),
            }
        };
        if row.error.is_some() {
            remove_results(&place);
        }
        let at = Place::check(&place.join(ROW), Kind::Fleet, &Inputs::none(), overwrite)?;
        write_all(&[(&at, serde_json::to_string_pretty(&row)?.as_bytes())])?;
        account.rows.push(row);
    }
    Ok(account)
}

impl Row {
    fn refused(error: String, exit_code: u8) -> Self {
        Self {
            fleet: VERSION,
            task: String::new(),
            bundle: String::new(),
            inputs: String::new(),
            verdict: None,
            worth: None,
            effects: Vec::new(),
            error: Some(error),
            exit_code,
            seconds: 0.0,
        }
    }

    fn judged(verdict: String, worth: String, usable: bool) -> Self {
        Self {
            verdict: Some(verdict),
            worth: Some(worth),
            error: None,
            ..Self::refused(String::new(), if usable { 0 } else { 3 })
        }
    }

    /// Whether it is what this task gives on these inputs. What the machine was at fault for is tried again.
    fn is_of(&self, bundle: &str, task: &Task, inputs: &str) -> bool {
        let same = self.bundle == bundle && self.task == task.name() && self.inputs == inputs;
        same && !inputs.is_empty() && self.exit_code != 1
    }
}

/// One bundle, with its results on disk.
fn one(
    path: &Path,
    task: &Task,
    given: Given<'_>,
    (place, overwrite): (&Path, Overwrite),
    progress: Progress<'_>,
) -> Result<Row, PipelineError> {
    let bundle = Bundle::open(path)?;
    let inputs = Inputs::none().bundle(&bundle);
    match task {
        Task::Diagnose { model, effects } => {
            let inputs = inputs.beside(model.as_deref(), effects.as_deref());
            let files = ResultFiles::check(place, &inputs, overwrite)?;
            let found = diagnose(&bundle, given, progress).map_err(|e| e.at(path))?;
            files.write(&found, &bundle)?;
            let Diagnosed { diagnosis, .. } = found;
            let is_usable = diagnosis.contradictions.is_empty();
            let worth = if is_usable {
                diagnosis.verdict
            } else {
                "contradictory-data".to_owned()
            };
            Ok(Row {
                effects: diagnosis.effects,
                ..Row::judged(diagnosis.verdict_in_words, worth, is_usable)
            })
        }
        Task::Identify(config) => {
            let file = place.join("model.json");
            let to = Place::check(&file, Kind::Model, &inputs, overwrite)?;
            let outcome = identify_bundle(&bundle, config, progress).map_err(|e| e.at(path))?;
            let verdict = outcome.summary.verdict.clone();
            let written = ModelFile::of(outcome, &bundle, (**config).clone(), &file)?;
            write_all(&[(&to, written.to_json()?.as_bytes())])?;
            let word = serde_json::to_value(&verdict)?["worth"]
                .as_str()
                .unwrap_or("unjudged")
                .to_owned();
            let usable = verdict.as_ref().is_none_or(|v| v.worth.is_usable());
            let sentence = verdict.map_or_else(String::new, |v| v.sentence);
            Ok(Row::judged(sentence, word, usable))
        }
    }
}

/// Takes away what an earlier run left of a bundle that is refused now.
fn remove_results(place: &Path) {
    for (name, kind) in [
        ("diagnosis.json", Kind::Diagnosis),
        ("diagnosis.html", Kind::Page),
        ("model.json", Kind::Model),
    ] {
        let file = place.join(name);
        if Place::is_result(&file, kind) {
            std::fs::remove_file(file).ok();
        }
    }
}

/// A file of a fleet.
fn read<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T, PipelineError> {
    let refuse = |problem: String| FleetError::File {
        file: file.to_owned(),
        problem,
    };
    let text = std::fs::read_to_string(file).map_err(|e| refuse(e.to_string()))?;
    Ok(serde_json::from_str(&text).map_err(|e| refuse(e.to_string()))?)
}

#[cfg(test)]
mod tests;
