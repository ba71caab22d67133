//! `experiment.toml` as text: reading with positions, and writing.

mod geometry;
mod keys;

use self::geometry::GeometryTable;
pub(crate) use self::keys::KEYS;
use self::keys::{OF_SECOND, UNREAD, listed, needs_second, value_of_second};
use crate::description::{ChannelGroup, Channels, Description, RecordEntry};
use crate::description_check::{Fault, check_entries, check_head, check_places, fault};
use crate::key_path::{KeyPath, Step};
use crate::nearest::nearest;
use crate::{DataError, DescriptionError, Place, Text};
use lpv_core::{Controller, Geometry};
use schemars::JsonSchema;
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
            message: plain_words(e.message()),
        }
    };
    let table = DeTable::parse(text).map_err(|e| syntax(&e))?;
    let located = |f: Fault| locate(file, text, table.get_ref(), f);

    // The version comes first: another format may well have other keys.
    let is_format = |value: &Spanned<DeValue<'_>>, number: &str| matches!(value.get_ref(), DeValue::Integer(i) if i.as_str() == number && i.radix() == 10);
    let version = table.get_ref().get("format");
    let second = version.is_some_and(|value| is_format(value, "2"));
    if let Some(value) = version
        && !second
        && !is_format(value, "1")
    {
        let found = text.get(value.span()).unwrap_or_default().to_owned();
        return Err(located(fault(
            KeyPath::key("format"),
            DescriptionError::Format { found },
        )));
    }
    if let Some((offset, key, problem)) = unknown_key(table.get_ref(), second, "", "") {
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
    if let Some(fault) = raw.too_many_coefficients() {
        return Err(located(fault));
    }
    if let Some(fault) = value_of_second(&raw.records).filter(|_| !second) {
        return Err(located(fault));
    }
    let description = raw.into_description();
    check_head(&description)
        .and_then(|()| check_entries(&description.records))
        .and_then(|()| check_places(&description))
        .map_err(located)?;
    Ok(description)
}

/// What the parser says about types, for readers who do not know Rust.
fn plain_words(message: &str) -> String {
    [
        ("missing field", "missing key"),
        ("unknown variant", "unknown value"),
        ("a sequence", "a list"),
        ("expected usize", "expected a whole number, not negative"),
        ("expected u32", "expected a whole number, not negative"),
        ("expected f64", "expected a number"),
        ("floating point", "fraction"),
        ("invalid type: ", "found "),
        ("invalid value: ", "found "),
    ]
    .iter()
    .fold(message.to_owned(), |text, (from, to)| text.replace(from, to))
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

/// An experiment bundle: what the record files hold, and how they were measured.
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "experiment.toml, formats 1 and 2", deny_unknown_fields)]
pub(crate) struct DescriptionFile {
    /// Version of the format.
    #[schemars(extend("enum" = [1, 2]))]
    format: u32,
    /// Name of the experiment.
    name: String,
    /// Samples a second, Hz.
    #[schemars(extend("exclusiveMinimum" = 0))]
    sample_rate: f64,
    /// The columns and their roles.
    channels: ChannelsFile,
    /// The loop that was closed; needed for closed-loop simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    controller: Option<ControllerFile>,
    /// What lies between the logged channels and the motors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<GeometryTable>")]
    geometry: Option<Geometry>,
    /// How text files are laid out, as far as it is not found by looking. Format 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<Text>,
    /// The record files.
    // The reader has a clearer word for a bundle without records.
    #[serde(default)]
    #[schemars(required, length(min = 1))]
    records: Vec<RecordEntry>,
}

/// Columns by role.
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Channels", deny_unknown_fields)]
struct ChannelsFile {
    /// Plant outputs y.
    output: ChannelGroup,
    /// Plant inputs u.
    input: ChannelGroup,
    /// Excitation or setpoints r.
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    reference: ChannelGroup,
    /// Scheduling p; absent means that the machine is treated as LTI.
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    scheduling: ChannelGroup,
    /// Other measured signals.
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    auxiliary: ChannelGroup,
}

/// Digital controller, one loop an input: u = sat(B_r/A r - B_y/A y) + injection, coefficients of z^0, z^-1, ...
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Controller", deny_unknown_fields)]
struct ControllerFile {
    /// B_r.
    reference_numerator: Coefficients,
    /// B_y.
    feedback_numerator: Coefficients,
    /// A; its first coefficient is not zero.
    denominator: Coefficients,
    /// Saturation of |u| in scaled input units.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    limit: Option<f64>,
}

/// One list for all loops, or one a loop.
#[derive(Serialize, Deserialize, JsonSchema)]
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

/// Coefficients of all loops together, of each polynomial of the controller.
const MOST_COEFFICIENTS: usize = 1 << 20;

impl DescriptionFile {
    /// One polynomial for all loops is copied for each of them.
    fn too_many_coefficients(&self) -> Option<Fault> {
        let controller = self.controller.as_ref()?;
        let loops = self.channels.input.len();
        let lists = [
            ("reference_numerator", &controller.reference_numerator),
            ("feedback_numerator", &controller.feedback_numerator),
            ("denominator", &controller.denominator),
        ];
        let (key, coefficients) = lists.into_iter().find_map(|(key, list)| match list {
            Coefficients::Shared(list) if list.len().saturating_mul(loops) > MOST_COEFFICIENTS => {
                Some((key, list.len()))
            }
            _ => None,
        })?;
        let problem = DescriptionError::ManyCoefficients {
            coefficients,
            loops,
            most: MOST_COEFFICIENTS,
        };
        Some(fault(KeyPath::key("controller").then(key), problem))
    }

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
            text: self.text,
            records: self.records,
        }
    }

    fn from_description(d: &Description) -> Self {
        let c = d.channels.clone();
        Self {
            format: if needs_second(d) { 2 } else { 1 },
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
            text: d.text.clone(),
            records: d.records.clone(),
        }
    }
}

/// The first unknown key in the order of the file: its offset, its full name, the problem.
fn unknown_key(
    table: &DeTable<'_>,
    second: bool,
    pattern: &str,
    name: &str,
) -> Option<(usize, String, DescriptionError)> {
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
        let of_second = listed(&OF_SECOND, pattern, plain);
        let unread = listed(&UNREAD, pattern, plain);
        if !known.contains(&plain) || (of_second && !second) {
            let own = plain.to_owned();
            let problem = if (of_second || unread) && !second {
                DescriptionError::OfFormat2 { key: own }
            } else if unread {
                DescriptionError::NotRead { key: own }
            } else {
                let of_first = |k: &&str| second || !listed(&OF_SECOND, pattern, k);
                let known: Vec<&'static str> = known.iter().copied().filter(of_first).collect();
                DescriptionError::UnknownKey {
                    nearest: nearest(&own, &known),
                    key: own,
                    known,
                }
            };
            found.push((key.span().start, join(name), problem));
            continue;
        }
        match value.get_ref() {
            DeValue::Table(inner) => found.extend(unknown_key(inner, second, &join(pattern), &join(name))),
            DeValue::Array(items) => {
                let pattern = format!("{}[*]", join(pattern));
                for (i, item) in items.iter().enumerate() {
                    if let DeValue::Table(inner) = item.get_ref() {
                        found.extend(unknown_key(
                            inner,
                            second,
                            &pattern,
                            &format!("{}[{i}]", join(name)),
                        ));
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
    for (k, step) in f.path.0.iter().enumerate() {
        // A list that serves all loops has no lists for each, which the key counts all the same.
        if let (Step::Index(_), Some(Step::Index(_)), Some(DeValue::Array(items))) =
            (step, f.path.0.get(k + 1), here.map(Spanned::get_ref))
            && !items.iter().any(|v| matches!(v.get_ref(), DeValue::Array(_)))
        {
            continue;
        }
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
