//! What the files hold, before anything is guessed from it.

use super::rate::{Hints, Physics};
use super::runs::{self, GroupsAre, Run};
use super::{pairs, refuse, stated};
use crate::PipelineError;
use experiment_data::{
    Column, Contents, PassedOver, Scalar, Separator, Text, lines_of_rows, read_columns_as,
};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Things that are named of one file; more are counted.
const MOST_NAMED: usize = 12;

/// Rows of a record beside objects.
const SHORTEST_BESIDE_OBJECTS: u64 = 16;

/// One file.
pub(super) struct Seen {
    /// As the user gave it.
    pub(super) file: PathBuf,
    pub(super) path: PathBuf,
    /// The columns of a record: those of one length.
    pub(super) columns: Vec<Column>,
    /// Where each column stands in the list.
    places: HashMap<String, usize>,
    pub(super) rows: usize,
    pub(super) text: Option<Text>,
    is_text: bool,
    /// Columns of another length, and what is no column at all.
    others: Vec<PassedOver>,
    notes: Vec<Vec<String>>,
    /// Single numbers beside the signals.
    pub(super) scalars: Vec<Scalar>,
    /// Whether its names say that it is held out.
    pub(super) is_validation: bool,
}

/// The records of a file: one, or two where it has its signals once to fit and once to judge, or one for each run.
pub(super) fn see(
    file: &Path,
    path: &Path,
    contents: Contents,
    groups: Option<GroupsAre>,
    guesses: &mut Vec<String>,
) -> Result<Vec<Seen>, PipelineError> {
    if let Some(runs) = runs::split(&contents.columns, groups) {
        return records_of_runs(file, path, &contents, runs, guesses);
    }
    let Some(pair) = pairs::split(&contents.columns) else {
        return Ok(vec![record_of(file, path, contents)?]);
    };
    guesses.push(format!(
        "{}: {} are held out, to judge what is fitted to the others",
        file.display(),
        pair.held_out.join(", ")
    ));
    let held_out = Contents {
        columns: pair.validation,
        passed_over: Vec::new(),
        ..contents.clone()
    };
    let fitted = Contents {
        columns: pair.estimation,
        ..contents
    };
    let mut both = vec![record_of(file, path, fitted)?, record_of(file, path, held_out)?];
    both[1].is_validation = true;
    Ok(both)
}

/// A record for each run of a file.
fn records_of_runs(
    file: &Path,
    path: &Path,
    contents: &Contents,
    runs: Vec<Run>,
    guesses: &mut Vec<String>,
) -> Result<Vec<Seen>, PipelineError> {
    let names: Vec<&str> = runs.iter().map(|r| r.group.as_str()).collect();
    guesses.push(format!(
        "{}: {} are runs of one machine, a record each",
        file.display(),
        names.join(", ")
    ));
    let mut all = Vec::new();
    for (k, run) in runs.into_iter().enumerate() {
        let prefix = format!("{}.", run.group);
        let number = |s: &Scalar| {
            let name = s.name.strip_prefix(&prefix).unwrap_or(&s.name).to_owned();
            (!name.contains('.')).then_some(Scalar { name, value: s.value })
        };
        let own = Contents {
            columns: run.columns,
            scalars: contents.scalars.iter().filter_map(number).collect(),
            // What is no column is told once.
            passed_over: if k == 0 {
                contents.passed_over.clone()
            } else {
                Vec::new()
            },
            ..contents.clone()
        };
        let mut record = record_of(file, path, own)?;
        record.is_validation = run.is_validation;
        all.push(record);
    }
    Ok(all)
}

fn record_of(file: &Path, path: &Path, contents: Contents) -> Result<Seen, PipelineError> {
    let mut rows = rows_of_record(&contents.columns);
    // Beside objects that hold the signals, a short table is a setting.
    let objects = contents.passed_over.iter().any(|p| p.what.contains("object"));
    if objects && rows < SHORTEST_BESIDE_OBJECTS {
        rows = 0;
    }
    let (columns, short): (Vec<Column>, Vec<Column>) = contents
        .columns
        .into_iter()
        .partition(|c| c.rows == rows && rows > 1);
    let mut others: Vec<PassedOver> = short
        .into_iter()
        .map(|c| PassedOver {
            name: c.name,
            what: match c.rows {
                1 => "a single number".to_owned(),
                n if rows == 0 => format!("{n} rows"),
                n => format!("{n} rows, the record has {rows}"),
            },
            remedy: String::new(),
        })
        .collect();
    others.extend(contents.passed_over);
    if columns.is_empty() {
        let mut problem = "no column of numbers that could be a record".to_owned();
        if !others.is_empty() {
            problem += &format!("; passed over: {}", list(&others));
        }
        return Err(refuse(file, problem));
    }
    Ok(Seen {
        file: file.to_owned(),
        path: path.to_owned(),
        places: places_of(&columns),
        columns,
        rows: usize::try_from(rows).unwrap_or(usize::MAX),
        is_text: contents.is_text,
        text: contents.text,
        others,
        notes: contents.notes,
        scalars: contents.scalars,
        is_validation: false,
    })
}

/// The length of the record: the one that most columns have of those that are not much shorter than the longest; the longer one
/// where two are as frequent. Settings and short tables beside the signals are none.
fn rows_of_record(columns: &[Column]) -> u64 {
    let longest = columns.iter().map(|c| c.rows).max().unwrap_or(0);
    let mut counts: HashMap<u64, usize> = HashMap::new();
    for c in columns.iter().filter(|c| 10 * c.rows > longest) {
        *counts.entry(c.rows).or_default() += 1;
    }
    counts
        .into_iter()
        .map(|(rows, count)| (count, rows))
        .max()
        .map_or(0, |(_, rows)| rows)
}

fn places_of(columns: &[Column]) -> HashMap<String, usize> {
    columns
        .iter()
        .enumerate()
        .map(|(k, c)| (c.name.clone(), k))
        .collect()
}

impl Seen {
    fn column(&self, name: &str) -> Option<&Column> {
        Some(&self.columns[*self.places.get(name)?])
    }

    pub(super) fn is_stamp(&self, name: &str) -> bool {
        self.column(name).is_some_and(|c| c.is_stamp)
    }

    pub(super) fn unit(&self, name: &str) -> &str {
        self.column(name).map_or("", |c| c.unit.as_str())
    }

    /// The columns of these names.
    pub(super) fn read(&self, names: &[String]) -> Result<Vec<Vec<f64>>, PipelineError> {
        let places: Vec<&str> = names
            .iter()
            .map(|name| {
                let source = self.column(name).and_then(|c| c.source.as_deref());
                source.unwrap_or(name)
            })
            .collect();
        read_columns_as(&self.path, &places, self.text.as_ref())
            .map_err(|e| refuse(&self.file, e.to_string()))
    }

    /// Where the file has these columns, if not by their names.
    pub(super) fn sources(&self, names: &[String]) -> Vec<(String, String)> {
        names
            .iter()
            .filter_map(|name| Some((name.clone(), self.column(name)?.source.clone()?)))
            .collect()
    }

    /// The line of a row, from 1, in a text file.
    pub(super) fn line_of_row(&self, row: usize) -> Option<u64> {
        lines_of_rows(&self.path, self.text.as_ref(), &[row])
            .first()
            .copied()
    }
}

/// The columns that all files have. Where there are none because each file has its own name in front (`exp1.u`, `exp2.u`), the
/// files are matched by the part behind it.
pub(super) fn common_columns(seen: &mut [Seen]) -> Vec<String> {
    let common = in_all(seen);
    if !common.is_empty() || seen.len() < 2 {
        return common;
    }
    for file in seen.iter_mut() {
        let Some(prefix) = file
            .columns
            .first()
            .and_then(|c| c.name.split_once('.'))
            .map(|(p, _)| format!("{p}."))
        else {
            return common;
        };
        if !file.columns.iter().all(|c| c.name.starts_with(&prefix)) {
            return common;
        }
        for column in &mut file.columns {
            let short = column.name[prefix.len()..].to_owned();
            let long = std::mem::replace(&mut column.name, short);
            column.source.get_or_insert(long);
        }
        file.places = places_of(&file.columns);
    }
    in_all(seen)
}

fn in_all(seen: &[Seen]) -> Vec<String> {
    let Some((first, rest)) = seen.split_first() else {
        return Vec::new();
    };
    first
        .columns
        .iter()
        .filter(|c| rest.iter().all(|s| s.places.contains_key(&c.name)))
        .map(|c| c.name.clone())
        .collect()
}

/// What no record of the draft has, by file; files that pass over the same are named once.
pub(super) fn passed_over(seen: &[Seen], common: &[String]) -> Vec<String> {
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    let common: HashSet<&String> = common.iter().collect();
    for file in seen {
        let mut others = file.others.clone();
        let own = |c: &&Column| !common.contains(&c.name);
        others.extend(file.columns.iter().filter(own).map(|c| PassedOver {
            name: c.name.clone(),
            what: "not in all files".to_owned(),
            remedy: String::new(),
        }));
        if others.is_empty() {
            continue;
        }
        let what = list(&others);
        let name = file.file.display().to_string();
        match said.iter_mut().find(|(w, _)| *w == what) {
            Some((_, files)) => files.push(name),
            None => said.push((what, vec![name])),
        }
    }
    said.into_iter()
        .map(|(what, files)| match files.as_slice() {
            [one] => format!("{one}: passed over: {what}"),
            [one, more @ ..] => format!("{one} and {} more: passed over: {what}", more.len()),
            [] => what,
        })
        .collect()
}

fn list(others: &[PassedOver]) -> String {
    let mut named: Vec<String> = others
        .iter()
        .take(MOST_NAMED)
        .map(|o| {
            let remedy = match o.remedy.as_str() {
                "" => String::new(),
                remedy => format!("; {remedy}"),
            };
            format!("`{}` ({}{remedy})", o.name, o.what)
        })
        .collect();
    if others.len() > MOST_NAMED {
        named.push(format!("and {} more", others.len() - MOST_NAMED));
    }
    named.join(", ")
}

/// The unit of a column of the first file, apart from its name or in it.
pub(super) fn unit_of(seen: &[Seen], name: &str) -> String {
    match seen.first().map_or("", |s| s.unit(name)) {
        "" => super::names::unit_of(name).unwrap_or("").to_owned(),
        unit => unit.to_owned(),
    }
}

/// Units that the files have apart from the names.
pub(super) fn units(seen: &[Seen]) -> Vec<(String, String)> {
    let first = seen.first().map_or(&[][..], |s| s.columns.as_slice());
    first
        .iter()
        .filter(|c| !c.unit.is_empty() && seen.iter().all(|s| s.unit(&c.name) == c.unit))
        .map(|c| (c.name.clone(), c.unit.clone()))
        .collect()
}

/// What the files state about their clocks beside their samples.
pub(super) fn hints(seen: &[Seen], physics: Option<Physics>) -> Hints {
    let mut all = Vec::new();
    for file in seen {
        for one in stated::stated(&file.notes, &file.scalars) {
            if !all.contains(&one) {
                all.push(one);
            }
        }
    }
    Hints {
        physics,
        in_seconds: seen.first().is_some_and(|s| stated::has_seconds(&s.notes)),
        stated: all,
    }
}

/// What one `[text]` can say about all files; what differs between them is left to the look at each.
pub(super) fn text(seen: &[Seen]) -> Option<Text> {
    let texts: Vec<&Seen> = seen.iter().filter(|s| s.is_text).collect();
    if texts.iter().all(|s| s.text.is_none()) {
        return None;
    }
    let of = |s: &Seen| {
        s.text.clone().unwrap_or_else(|| Text {
            separator: Some(Separator::Comma),
            header: Some(1),
            ..Text::default()
        })
    };
    let mut all = texts.iter().map(|s| of(s));
    let mut text = all.next()?;
    for other in all {
        if text.separator != other.separator {
            text.separator = None;
        }
        if text.decimal != other.decimal {
            text.decimal = None;
        }
        let lines_differ = text.header != other.header
            || text.units_row != other.units_row
            || text.skip != other.skip
            || text.names != other.names;
        if lines_differ {
            if text.header != Some(0) || other.header != Some(0) || text.names != other.names {
                text.header = None;
                text.names.clear();
            }
            text.units_row = None;
            text.skip.clear();
        }
    }
    (text != Text::default()).then_some(text)
}
