//! A first `experiment.toml` from record files: what names and data tell is filled in, the rest is marked.

mod actual;
mod clock;
mod command;
mod gaps;
mod given;
mod lay;
mod motion;
mod names;
mod pairs;
mod period;
mod position;
mod rate;
mod response;
mod roles;
mod runs;
mod sampling;
mod see;
mod stated;
mod time_unit;
mod write;

use crate::PipelineError;
use crate::encode::visible;
pub use crate::output::Overwrite;
use experiment_data::Text;
use given::{UNNAMEABLE, common_folder, name_of};
use period::Repeats;
use position::Places;
use rate::TimeColumn;
pub use runs::GroupsAre;
use schemars::JsonSchema;
use see::Seen;
use serde::Serialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
pub(crate) use time_unit::seconds;

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
    /// What groups of a file are that hold the same signals, where the names do not tell.
    pub groups: Option<GroupsAre>,
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
    /// The command that completes the draft, with words in capitals for what only the user knows.
    pub command: Option<String>,
}

/// A draft that was written, for a program.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Drafted<'a> {
    /// The description.
    #[serde(serialize_with = "crate::account::path")]
    pub file: &'a Path,
    /// What was guessed, and from what.
    pub guesses: &'a [String],
    /// What could not be guessed, with the line to complete.
    pub questions: &'a [String],
    /// The command that completes the draft.
    pub command: Option<&'a str>,
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
        lines.push(match (&self.command, self.questions.as_slice()) {
            (Some(command), _) => format!("next: complete the lines marked FILL IN, or type: {command}"),
            (None, []) => format!(
                "next: look through it, then `lpv inspect {}`",
                self.folder.display()
            ),
            (None, _) => "next: complete the lines marked FILL IN".to_owned(),
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
    /// Where the file has a column, if not by its name.
    sources: Vec<(String, String)>,
    /// Rows of the file.
    rows: usize,
    /// The longest stretch of them without a gap: its first row, from 0, and the row behind its end.
    stretch: [usize; 2],
    /// After which rows how many samples are missing.
    gaps: Vec<(usize, usize)>,
    period: Option<usize>,
    /// Smallest value, mean and largest value of each column.
    ranges: HashMap<String, (f64, f64, f64)>,
    validation: bool,
}

impl RecordFile {
    fn rests(&self, name: &str) -> bool {
        self.ranges.get(name).is_some_and(is_constant)
    }
}

/// The columns of a bundle by role.
#[derive(Default)]
struct Groups {
    output: Vec<String>,
    input: Vec<String>,
    reference: Vec<String>,
    scheduling: Vec<String>,
    auxiliary: Vec<String>,
}

/// What goes into the text of a draft.
struct Plan<'a> {
    name: String,
    rate: Option<f64>,
    /// Rates that it may be, where it is asked for or in doubt.
    rates: Vec<f64>,
    /// Whether the files have several.
    rates_differ: bool,
    groups: Groups,
    /// Units by column, where they are known.
    units: Vec<(String, String)>,
    text: Option<Text>,
    records: Vec<RecordFile>,
    known: &'a Known,
    /// Where no column tells them.
    places: Option<Places>,
}

/// Looks at the files, of a folder at its record files, and drafts their description.
///
/// # Errors
/// A file that cannot be read, no file, a folder without record files, files without a common folder or without a common column, a known column that
/// no file has, a rate that no clock has.
pub fn draft(files: &[PathBuf], known: &Known) -> Result<Draft, PipelineError> {
    let Some(first) = files.first() else {
        return Err(refuse(Path::new(""), "give at least one record file".to_owned()));
    };
    if let Some(hz) = known.sample_rate_hz
        && !(hz.is_finite() && hz > 0.0)
    {
        return Err(PipelineError::Setting {
            name: "--sample-rate",
            value: hz,
            allowed: "the number of samples a second, finite and above zero",
        });
    }
    let named = files;
    let (files, paths) = given::files(named, &known.validation)?;
    let folder =
        common_folder(&paths).ok_or_else(|| refuse(first, "the files have no common folder".to_owned()))?;
    // Before anything is read: a name that cannot be written makes all other work vain.
    for (file, path) in files.iter().zip(&paths) {
        name_of(path, &folder).ok_or_else(|| refuse(file, UNNAMEABLE.to_owned()))?;
    }
    let contents = given::contents([named, &known.validation], &files, &paths)?;
    // Who gives roles has samples.
    let has_roles = !(known.output.is_empty() && known.input.is_empty());
    if !has_roles && let Some(draft) = response::draft((&files, &paths), &contents, known)? {
        return Ok(draft);
    }
    let mut guesses = Vec::new();
    let mut questions = Vec::new();
    let mut seen: Vec<Seen> = Vec::new();
    for ((file, path), contents) in files.iter().zip(&paths).zip(contents) {
        seen.extend(see::see(file, path, contents, known.groups, &mut guesses)?);
    }
    if known.groups == Some(GroupsAre::Runs) && seen.len() == files.len() {
        let problem = "--groups runs: it has no groups that hold the same signals; leave the option out";
        return Err(refuse(first, problem.to_owned()));
    }
    let common = see::common_columns(&mut seen);
    if common.is_empty() {
        return Err(refuse(
            first,
            "the files have no column in common; make one bundle for each kind of file".to_owned(),
        ));
    }
    if !has_roles && response::is_response(&common, |name| see::unit_of(&seen, name)) {
        return response::of_tables(&seen, &common)?.drafted(&files, &paths, known);
    }
    guesses.extend(see::passed_over(&seen, &common));
    check_known(first, known, &common)?;
    let places: HashMap<&str, usize> = common.iter().enumerate().map(|(k, n)| (n.as_str(), k)).collect();
    let mut groups = lay::by_name(&common, &seen, known);
    let mut records = Vec::new();
    let mut time: Option<TimeColumn> = None;
    let mut physics = None;
    for seen in &seen {
        let data = seen.read(&common)?;
        let column = |name: &str| Some(data[*places.get(name)?].as_slice());
        if records.is_empty() {
            groups.take_counters_out(known, &column, &mut guesses);
            time = groups.find_time(&common, known, seen, &column);
            physics = lay::speed_of_position(&common, seen, &column);
            if !has_roles && time.is_none() && known.sample_rate_hz.is_none() {
                response::refuse_sweep(&seen.file, &common, &column)?;
            }
        }
        let clock = time
            .as_ref()
            .and_then(|t| Some(clock::clock_of(column(&t.name)?, t.is_stamp)));
        let (from, to) = clock
            .as_ref()
            .map_or((0, seen.rows), |c| c.longest_stretch(seen.rows));
        // References repeat exactly; inputs of a closed loop only after its transient.
        let used = |name: &String| Some(&column(name)?[from..to]);
        let period_in = |names: &[String], repeats| {
            let all = names.iter().filter_map(used);
            let mut moving = all.filter(|x| !is_constant(&range_of(x)));
            moving.find_map(|x| period::period_of(x, repeats))
        };
        // Along moves a disturbance that repeats is in the command too.
        let goes_with = |period: &usize| {
            let mut outputs = groups.output.iter().filter_map(used);
            outputs.all(|y| period::goes_with(y, *period))
        };
        let of_data = || {
            // Where a reference moves, it is the excitation.
            match groups
                .reference
                .iter()
                .filter_map(used)
                .any(|x| !is_constant(&range_of(x)))
            {
                true => period_in(&groups.reference, Repeats::Exactly)
                    .or_else(|| period_in(&groups.input, Repeats::Exactly)),
                false => period_in(&groups.input, Repeats::Nearly).filter(goes_with),
            }
        };
        let period = known.period.or_else(of_data);
        records.push(RecordFile {
            file: name_of(&seen.path, &folder).ok_or_else(|| refuse(&seen.file, UNNAMEABLE.to_owned()))?,
            columns: common.clone(),
            sources: seen.sources(&common),
            rows: seen.rows,
            stretch: [from, to],
            gaps: clock.as_ref().map_or_else(Vec::new, |c| c.gaps().to_vec()),
            period,
            ranges: common
                .iter()
                .cloned()
                .zip(data.iter().map(|x| range_of(x)))
                .collect(),
            validation: seen.is_validation
                || known
                    .validation
                    .iter()
                    .any(|v| v.canonicalize().is_ok_and(|v| v == seen.path)),
        });
        if let (Some(time), Some(clock)) = (time.as_mut(), clock) {
            time.clocks.push((seen.file.display().to_string(), clock));
        }
    }
    guesses.extend(period::agree(&mut records));
    guesses.extend(
        records
            .iter()
            .zip(&seen)
            .filter_map(|(r, seen)| gaps::used(r, seen)),
    );
    groups.by_data(&records, known, &mut guesses);
    groups.keep_what_acts(known, |name| see::unit_of(&seen, name), &mut guesses);
    let mut units = see::units(&seen);
    let sampling = sampling::decide(time.as_ref(), known.sample_rate_hz, &see::hints(&seen, physics));
    if let (Some(time), Some(unit)) = (&time, sampling.unit) {
        units.push((time.name.clone(), unit));
    }
    guesses.extend(sampling.guess);
    questions.extend(sampling.question);
    // The time stays with the data, where it can be looked at again.
    groups.auxiliary.extend(time.map(|t| t.name));
    if known.groups.is_none() {
        questions.extend(runs::in_groups(&groups.output, &groups.input));
    }
    let names: Vec<String> = records.iter().map(|r| r.file.clone()).collect();
    let plan = Plan {
        name: known.name.clone().unwrap_or_else(|| {
            folder
                .file_name()
                .map_or("experiment".to_owned(), |n| n.to_string_lossy().into_owned())
        }),
        rate: sampling.hz,
        rates: sampling.others,
        rates_differ: sampling.rates_differ,
        places: position::of_files(&names, &seen).filter(|_| groups.scheduling.is_empty() && names.len() > 1),
        groups,
        units,
        text: see::text(&seen),
        records,
        known,
    };
    let text = write::text(&plan, &mut guesses, &mut questions);
    Ok(Draft {
        command: command::to_complete(&files, &plan),
        folder,
        text,
        guesses,
        questions,
    })
}

fn refuse(file: &Path, problem: String) -> PipelineError {
    PipelineError::RecordFile {
        file: file.to_owned(),
        problem,
    }
}

fn check_known(first: &Path, known: &Known, common: &[String]) -> Result<(), PipelineError> {
    let given = || {
        let groups = [&known.output, &known.input, &known.reference, &known.scheduling];
        groups.into_iter().flatten()
    };
    for (k, column) in given().enumerate() {
        if given().take(k).any(|earlier| earlier == column) {
            return Err(refuse(
                first,
                format!("column `{column}` is given twice; a column has one role"),
            ));
        }
        if !common.contains(column) {
            let nearest = crate::nearest_name(column, common.iter().map(String::as_str))
                .map_or(String::new(), |n| format!("; nearest: `{n}`"));
            return Err(refuse(
                first,
                format!("no column `{column}` that all files have{nearest}"),
            ));
        }
    }
    Ok(())
}

/// Smallest value, mean, largest value.
fn range_of(x: &[f64]) -> (f64, f64, f64) {
    let (low, high) = lpv_numerics::statistics::range(x);
    (low, lpv_numerics::statistics::mean(x), high)
}

fn is_constant(&(low, _, high): &(f64, f64, f64)) -> bool {
    // The tolerance of the format for a position at rest.
    high - low <= 1e-3 * low.abs().max(high.abs())
}
