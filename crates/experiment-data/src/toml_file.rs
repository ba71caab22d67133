//! `experiment.toml` as text: reading with positions, and writing.

use crate::description::{ChannelGroup, Channels, Description, RecordEntry};
use crate::description_check::{Fault, check_entries, check_head, fault};
use crate::key_path::{KeyPath, Step};
use crate::nearest::nearest;
use crate::{Controller, DataError, DescriptionError, Geometry, Place};
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Parses and checks; looks at no record file.
pub(crate) fn parse(file: &Path, text: &str) -> Result<Description, DataError> {
    let syntax = |e: &toml::de::Error| {
        let (line, column) = position(text, e.span().map_or(0, |s| s.start));
        DataError::Toml {
            file: file.to_owned(),
            line,
            column,
            message: e.message().to_owned(),
        }
    };
    let table = DeTable::parse(text).map_err(|e| syntax(&e))?;
    let located = |f: Fault| locate(file, text, table.get_ref(), f);

    // The version comes first: another format may well have other keys.
    if let Some(value) = table.get_ref().get("format")
        && !matches!(value.get_ref(), DeValue::Integer(i) if i.as_str() == "1" && i.radix() == 10)
    {
        let found = text.get(value.span()).unwrap_or_default().to_owned();
        return Err(located(fault(
            KeyPath::key("format"),
            DescriptionError::Format { found },
        )));
    }
    if let Some((offset, key, problem)) = unknown_key(table.get_ref(), "", "") {
        let place = Place {
            file: file.to_owned(),
            position: Some(position(text, offset)),
            key,
        };
        return Err(DataError::Description {
            place: Box::new(place),
            problem: Box::new(problem),
        });
    }
    let raw: DescriptionFile = toml::from_str(text).map_err(|e| syntax(&e))?;
    let description = raw.into_description();
    check_head(&description)
        .and_then(|()| check_entries(&description.records))
        .map_err(located)?;
    Ok(description)
}

/// The error of a fault, with the line and column of its key.
pub(crate) fn locate_in(file: &Path, text: &str, f: Fault) -> DataError {
    match DeTable::parse(text) {
        Ok(table) => locate(file, text, table.get_ref(), f),
        Err(_) => unlocated(file, f),
    }
}

/// The error of a fault in a description that is in no file yet.
pub(crate) fn unlocated(file: &Path, f: Fault) -> DataError {
    let place = Place {
        file: file.to_owned(),
        position: None,
        key: f.path.to_string(),
    };
    DataError::Description {
        place: Box::new(place),
        problem: Box::new(f.problem),
    }
}

/// The text of a checked description.
pub(crate) fn print(d: &Description) -> Result<String, toml::ser::Error> {
    toml::to_string(&DescriptionFile::from_description(d))
}

/// The file's own layout.
#[derive(Serialize, Deserialize)]
struct DescriptionFile {
    format: u32,
    name: String,
    sample_rate: f64,
    channels: ChannelsFile,
    #[serde(skip_serializing_if = "Option::is_none")]
    controller: Option<ControllerFile>,
    #[serde(skip_serializing_if = "Option::is_none")]
    geometry: Option<Geometry>,
    #[serde(default)]
    records: Vec<RecordEntry>,
}

#[derive(Serialize, Deserialize)]
struct ChannelsFile {
    output: ChannelGroup,
    input: ChannelGroup,
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    reference: ChannelGroup,
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    scheduling: ChannelGroup,
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    auxiliary: ChannelGroup,
}

#[derive(Serialize, Deserialize)]
struct ControllerFile {
    reference_numerator: Coefficients,
    feedback_numerator: Coefficients,
    denominator: Coefficients,
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<f64>,
}

/// One list for all loops, or one a loop.
#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a list of numbers, or one list of numbers a loop"
)]
enum Coefficients {
    Shared(Vec<f64>),
    PerLoop(Vec<Vec<f64>>),
}

impl Coefficients {
    fn expand(self, loops: usize) -> Vec<Vec<f64>> {
        match self {
            Self::Shared(list) => vec![list; loops],
            Self::PerLoop(lists) => lists,
        }
    }
    /// The short form where it says the same.
    fn collapse(lists: &[Vec<f64>]) -> Self {
        match lists {
            [first, rest @ ..] if rest.iter().all(|l| l == first) => Self::Shared(first.clone()),
            _ => Self::PerLoop(lists.to_vec()),
        }
    }
}

impl DescriptionFile {
    fn into_description(self) -> Description {
        let loops = self.channels.input.len();
        let c = self.channels;
        Description {
            name: self.name,
            sample_rate_hz: self.sample_rate,
            channels: Channels {
                output: c.output,
                input: c.input,
                reference: c.reference,
                scheduling: c.scheduling,
                auxiliary: c.auxiliary,
            },
            controller: self.controller.map(|c| Controller {
                reference_numerator: c.reference_numerator.expand(loops),
                feedback_numerator: c.feedback_numerator.expand(loops),
                denominator: c.denominator.expand(loops),
                limit: c.limit,
            }),
            geometry: self.geometry,
            records: self.records,
        }
    }

    fn from_description(d: &Description) -> Self {
        let c = d.channels.clone();
        Self {
            format: 1,
            name: d.name.clone(),
            sample_rate: d.sample_rate_hz,
            channels: ChannelsFile {
                output: c.output,
                input: c.input,
                reference: c.reference,
                scheduling: c.scheduling,
                auxiliary: c.auxiliary,
            },
            controller: d.controller.as_ref().map(|c| ControllerFile {
                reference_numerator: Coefficients::collapse(&c.reference_numerator),
                feedback_numerator: Coefficients::collapse(&c.feedback_numerator),
                denominator: Coefficients::collapse(&c.denominator),
                limit: c.limit,
            }),
            geometry: d.geometry.clone(),
            records: d.records.clone(),
        }
    }
}

/// The keys of each table; `*` stands for any index.
const KEYS: [(&str, &[&str]); 11] = [
    (
        "",
        &[
            "format",
            "name",
            "sample_rate",
            "channels",
            "controller",
            "geometry",
            "records",
        ],
    ),
    (
        "channels",
        &["output", "input", "reference", "scheduling", "auxiliary"],
    ),
    ("channels.output", GROUP),
    ("channels.input", GROUP),
    ("channels.reference", GROUP),
    ("channels.scheduling", GROUP),
    ("channels.auxiliary", GROUP),
    (
        "controller",
        &[
            "reference_numerator",
            "feedback_numerator",
            "denominator",
            "limit",
        ],
    ),
    ("geometry", &["force_from_input", "motor_from_output"]),
    (
        "records[*]",
        &["file", "kind", "period", "use", "position", "injection"],
    ),
    ("records[*].injection", GROUP),
];
const GROUP: &[&str] = &["columns", "units", "scale"];

/// The first unknown key in the order of the file: its offset, its full name, the problem.
fn unknown_key(table: &DeTable<'_>, pattern: &str, name: &str) -> Option<(usize, String, DescriptionError)> {
    let (_, known) = KEYS.iter().find(|(p, _)| *p == pattern)?;
    let mut found = Vec::new();
    for (key, value) in table {
        let join = |base: &str| {
            if base.is_empty() {
                key.to_string()
            } else {
                format!("{base}.{key}")
            }
        };
        let plain: &str = key.get_ref().as_ref();
        if !known.contains(&plain) {
            let problem = DescriptionError::UnknownKey {
                key: plain.to_owned(),
                nearest: nearest(plain, known),
                known: known.to_vec(),
            };
            found.push((key.span().start, join(name), problem));
            continue;
        }
        match value.get_ref() {
            DeValue::Table(inner) => found.extend(unknown_key(inner, &join(pattern), &join(name))),
            DeValue::Array(items) => {
                let pattern = format!("{}[*]", join(pattern));
                for (i, item) in items.iter().enumerate() {
                    if let DeValue::Table(inner) = item.get_ref() {
                        found.extend(unknown_key(inner, &pattern, &format!("{}[{i}]", join(name))));
                    }
                }
            }
            _ => {}
        }
    }
    found.into_iter().min_by_key(|(offset, ..)| *offset)
}

/// Points at the value, or at the nearest table around it that the file has.
fn locate(file: &Path, text: &str, table: &DeTable<'_>, f: Fault) -> DataError {
    let mut here: Option<&Spanned<DeValue<'_>>> = None;
    for step in &f.path.0 {
        let next = match (step, here.map(Spanned::get_ref)) {
            (Step::Key(key), None) => table.get(*key),
            (Step::Key(key), Some(DeValue::Table(t))) => t.get(*key),
            (Step::Index(i), Some(DeValue::Array(a))) => a.get(*i),
            _ => None,
        };
        if next.is_none() {
            break;
        }
        here = next;
    }
    let offset = here.map_or(0, |v| v.span().start);
    let place = Place {
        file: file.to_owned(),
        position: Some(position(text, offset)),
        key: f.path.to_string(),
    };
    DataError::Description {
        place: Box::new(place),
        problem: Box::new(f.problem),
    }
}

/// Line and column, both from 1, of a byte offset; columns count characters.
pub(crate) fn position(text: &str, offset: usize) -> (usize, usize) {
    let bytes = &text.as_bytes()[..offset.min(text.len())];
    let line = bytes.iter().filter(|b| **b == b'\n').count() + 1;
    let start = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let column = String::from_utf8_lossy(&bytes[start..]).chars().count() + 1;
    (line, column)
}
