//! A first `experiment.toml` from record files: what names and data tell is filled in, the rest is marked.

mod period;
mod rate;
mod roles;
mod write;

pub use crate::output::Overwrite;

use crate::PipelineError;
use crate::encode::visible;
use experiment_data::{ColumnInfo, list_columns, read_columns};
use rate::{clock_of, sample_rate};
use roles::{Role, role_of};
use std::path::{Path, PathBuf};

/// What the user knows better than the guess.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Known {
    /// Name of the bundle.
    pub name: Option<String>,
    /// Samples per unit of time.
    pub sample_rate_hz: Option<f64>,
    /// Samples a period of all files.
    pub period: Option<usize>,
    /// Columns by role; where any is given, no other column gets that role.
    pub output: Vec<String>,
    /// Inputs.
    pub input: Vec<String>,
    /// References.
    pub reference: Vec<String>,
    /// Scheduling.
    pub scheduling: Vec<String>,
    /// Files, by name, that are held out.
    pub validation: Vec<PathBuf>,
}

/// A description that waits to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    /// The folder of the bundle.
    pub folder: PathBuf,
    /// The text of `experiment.toml`.
    pub text: String,
    /// What was guessed, and from what.
    pub guesses: Vec<String>,
    /// What could not be guessed, with the line to complete.
    pub questions: Vec<String>,
}

impl Draft {
    /// Writes `experiment.toml` into the folder.
    ///
    /// # Errors
    /// [`PipelineError::RecordFile`] if there is one; [`PipelineError::Write`].
    pub fn write(&self, overwrite: Overwrite) -> Result<PathBuf, PipelineError> {
        let file = self.folder.join("experiment.toml");
        if overwrite == Overwrite::Refuse && file.symlink_metadata().is_ok() {
            return Err(PipelineError::RecordFile {
                file,
                problem: "there is a description already; edit it, or use --force to replace it".to_owned(),
            });
        }
        crate::write_whole(&file, self.text.as_bytes())?;
        Ok(file)
    }

    /// The draft in words, with what to do next.
    pub fn text_for(&self, file: &Path) -> String {
        let mut lines = vec![format!("written: {}", file.display())];
        lines.extend(self.guesses.iter().map(|g| format!("guess: {g}")));
        lines.extend(self.questions.iter().map(|q| format!("fill in: {q}")));
        lines.push(if self.questions.is_empty() {
            format!(
                "next: look through it, then `lpv inspect {}`",
                self.folder.display()
            )
        } else {
            "next: complete the lines marked FILL IN".to_owned()
        });
        let lines: Vec<String> = lines.iter().map(|l| visible(l)).collect();
        lines.join("\n")
    }
}

/// One file, as far as the guess needs it.
struct RecordFile {
    /// Relative to the folder, with forward slashes.
    file: String,
    columns: Vec<String>,
    rows: usize,
    period: Option<usize>,
    /// Columns that hold one value.
    constant: Vec<(String, f64)>,
    validation: bool,
}

/// The columns of a bundle by role.
struct Groups {
    output: Vec<String>,
    input: Vec<String>,
    reference: Vec<String>,
    scheduling: Vec<String>,
    auxiliary: Vec<String>,
    time: Option<String>,
}

/// Looks at the files and drafts their description.
///
/// # Errors
/// A file that cannot be read, no file, files without a common folder or without a common column, a known column that
/// no file has.
pub fn draft(files: &[PathBuf], known: &Known) -> Result<Draft, PipelineError> {
    let refuse = |file: &Path, problem: String| PipelineError::RecordFile {
        file: file.to_owned(),
        problem,
    };
    let Some(first) = files.first() else {
        return Err(refuse(Path::new(""), "give at least one record file".to_owned()));
    };
    let mut paths: Vec<PathBuf> = Vec::new();
    for file in files {
        let path = file.canonicalize().map_err(|e| refuse(file, e.to_string()))?;
        if paths.contains(&path) {
            return Err(refuse(file, "this file is given twice".to_owned()));
        }
        paths.push(path);
    }
    let folder =
        common_folder(&paths).ok_or_else(|| refuse(first, "the files have no common folder".to_owned()))?;
    // Before anything is read: a name that cannot be written makes all other work vain.
    for (file, path) in files.iter().zip(&paths) {
        name_of(path, &folder).ok_or_else(|| refuse(file, UNNAMEABLE.to_owned()))?;
    }
    let mut guesses = Vec::new();
    let mut questions = Vec::new();
    let mut common: Option<Vec<String>> = None;
    let mut listed = Vec::new();
    for (file, path) in files.iter().zip(&paths) {
        let columns = list_columns(path).map_err(|e| refuse(file, e.to_string()))?;
        // The columns of a record have one length: that of most; a scalar beside them is a setting and no signal.
        let rows = usual_rows(&columns);
        let (columns, others): (Vec<ColumnInfo>, Vec<ColumnInfo>) =
            columns.into_iter().partition(|c| c.rows == rows);
        if !others.is_empty() {
            let names: Vec<String> = others.into_iter().map(|c| c.name).collect();
            guesses.push(format!(
                "{}: left out, of other length than the {rows} rows of the signals: {}",
                file.display(),
                names.join(", ")
            ));
        }
        let names: Vec<String> = columns.iter().map(|c| c.name.clone()).collect();
        if names.is_empty() {
            return Err(refuse(file, "no column of numbers".to_owned()));
        }
        if names.iter().all(|n| n.trim().parse::<f64>().is_ok()) {
            return Err(refuse(
                file,
                "the first line holds numbers and no names; put a header line with the names of the columns on top"
                    .to_owned(),
            ));
        }
        common = Some(match common {
            None => names,
            Some(before) => before.into_iter().filter(|n| names.contains(n)).collect(),
        });
        listed.push(columns);
    }
    let common = common.unwrap_or_default();
    if common.is_empty() {
        return Err(refuse(
            first,
            "the files have no column in common; make one bundle for each kind of file".to_owned(),
        ));
    }
    for column in [&known.output, &known.input, &known.reference, &known.scheduling]
        .into_iter()
        .flatten()
    {
        if !common.contains(column) {
            let nearest = crate::nearest_name(column, common.iter().map(String::as_str))
                .map_or(String::new(), |n| format!("; nearest: `{n}`"));
            return Err(refuse(
                first,
                format!("no column `{column}` that all files have{nearest}"),
            ));
        }
    }
    let mut groups = by_name(&common, known);
    let mut records = Vec::new();
    let mut clocks = Vec::new();
    for ((file, path), columns) in files.iter().zip(&paths).zip(&listed) {
        let rows = usual_rows(columns);
        let names: Vec<&str> = common.iter().map(String::as_str).collect();
        let data = read_columns(path, &names).map_err(|e| refuse(file, e.to_string()))?;
        let column = |name: &String| {
            let at = names.iter().position(|n| n == name)?;
            Some(data[at].as_slice())
        };
        if let Some(time) = groups.time.as_ref().and_then(column) {
            clocks.push((file.display().to_string(), clock_of(time)));
        }
        // References repeat exactly; inputs of a closed loop only after its transient.
        let exciting = groups.reference.iter().chain(&groups.input);
        let period = known.period.or_else(|| {
            exciting
                .filter_map(column)
                .filter(|x| !is_constant(x))
                .find_map(period::period_of)
        });
        let constant = names
            .iter()
            .zip(&data)
            .filter(|(_, x)| is_constant(x))
            .map(|(n, x)| ((*n).to_owned(), crate::signal::mean(x)))
            .collect();
        records.push(RecordFile {
            file: name_of(path, &folder).ok_or_else(|| refuse(file, UNNAMEABLE.to_owned()))?,
            columns: columns.iter().map(|c| c.name.clone()).collect(),
            rows: rows as usize,
            period,
            constant,
            validation: known
                .validation
                .iter()
                .any(|v| v.canonicalize().is_ok_and(|v| v == *path)),
        });
    }
    by_data(&mut groups, &records, known, &mut guesses);
    let rate = sample_rate(known, &clocks, &groups, &mut guesses, &mut questions);
    let name = known.name.clone().unwrap_or_else(|| {
        folder
            .file_name()
            .map_or("experiment".to_owned(), |n| n.to_string_lossy().into_owned())
    });
    let text = write::text(
        &name,
        rate,
        &groups,
        &records,
        known,
        &mut guesses,
        &mut questions,
    );
    Ok(Draft {
        folder,
        text,
        guesses,
        questions,
    })
}

/// Why a file cannot be a record.
const UNNAMEABLE: &str =
    "the name is no UTF-8 text, so an experiment.toml, which is, cannot name it; rename the file";

/// A file as the description names it: relative to the folder, with forward slashes; none for a name that is no text.
fn name_of(path: &Path, folder: &Path) -> Option<String> {
    let name = path.strip_prefix(folder).unwrap_or(path).to_str()?;
    Some(match std::path::MAIN_SEPARATOR {
        '/' => name.to_owned(),
        other => name.replace(other, "/"),
    })
}

/// The length that most columns have; the longer one where two are as frequent.
fn usual_rows(columns: &[ColumnInfo]) -> u64 {
    let count = |rows: u64| columns.iter().filter(|c| c.rows == rows).count();
    columns
        .iter()
        .map(|c| (count(c.rows), c.rows))
        .max()
        .map_or(0, |(_, rows)| rows)
}

/// The deepest folder that holds all files.
fn common_folder(paths: &[PathBuf]) -> Option<PathBuf> {
    let mut folder = paths.first()?.parent()?.to_owned();
    while !paths.iter().all(|p| p.starts_with(&folder)) {
        folder = folder.parent()?.to_owned();
    }
    // Records often stand in a folder of their own below the bundle.
    if folder.file_name().is_some_and(|n| n == "records") {
        folder = folder.parent()?.to_owned();
    }
    Some(folder)
}

fn by_name(columns: &[String], known: &Known) -> Groups {
    let taken = |name: &String| {
        [&known.output, &known.input, &known.reference, &known.scheduling]
            .into_iter()
            .any(|group| group.contains(name))
    };
    let pick = |given: &Vec<String>, role: Role| -> Vec<String> {
        if given.is_empty() {
            columns
                .iter()
                .filter(|c| !taken(c) && role_of(c) == Some(role))
                .cloned()
                .collect()
        } else {
            given.clone()
        }
    };
    let mut groups = Groups {
        output: pick(&known.output, Role::Output),
        input: pick(&known.input, Role::Input),
        reference: pick(&known.reference, Role::Reference),
        scheduling: pick(&known.scheduling, Role::Scheduling),
        auxiliary: Vec::new(),
        time: columns
            .iter()
            .find(|c| !taken(c) && role_of(c) == Some(Role::Time))
            .cloned(),
    };
    let used = |name: &String| {
        [
            &groups.output,
            &groups.input,
            &groups.reference,
            &groups.scheduling,
        ]
        .into_iter()
        .any(|group| group.contains(name))
    };
    groups.auxiliary = columns
        .iter()
        .filter(|c| !used(c) && groups.time.as_ref() != Some(c))
        .cloned()
        .collect();
    groups
}

/// A column that rests in every periodic file at another value is the position, whatever its name; dead columns go.
fn by_data(groups: &mut Groups, records: &[RecordFile], known: &Known, guesses: &mut Vec<String>) {
    if groups.scheduling.is_empty() && known.scheduling.is_empty() {
        let values = |name: &String| -> Vec<f64> {
            records
                .iter()
                .filter(|r| r.period.is_some())
                .filter_map(|r| r.constant.iter().find(|(n, _)| n == name).map(|(_, v)| *v))
                .collect()
        };
        let periodic = records.iter().filter(|r| r.period.is_some()).count();
        let found = groups.auxiliary.iter().position(|name| {
            let v = values(name);
            periodic > 1 && v.len() == periodic && v.iter().any(|x| *x != v[0])
        });
        if let Some(i) = found {
            let name = groups.auxiliary.remove(i);
            guesses.push(format!(
                "`{name}` is the scheduling signal: it rests in every periodic file, at different values"
            ));
            groups.scheduling.push(name);
        }
    }
    let dead = |name: &String| records.iter().all(|r| r.constant.iter().any(|(n, _)| n == name));
    for (role, given, group) in [
        ("input", &known.input, &mut groups.input),
        ("output", &known.output, &mut groups.output),
    ] {
        if given.is_empty() {
            group.retain(|name| {
                if dead(name) {
                    guesses.push(format!("`{name}` is constant in every file: not taken as {role}"));
                }
                !dead(name)
            });
        }
    }
}

fn is_constant(x: &[f64]) -> bool {
    let (low, high) = crate::signal::range(x);
    // The tolerance of the format for a position at rest.
    high - low <= 1e-3 * low.abs().max(high.abs())
}
