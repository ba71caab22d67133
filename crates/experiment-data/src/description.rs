//! What an engineer writes down next to a measurement.

use crate::{Quantity, ResponseQuantity, Text};
use lpv_core::{Controller, Geometry, Position, Purpose, RecordKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The content of `experiment.toml`, formats 1 and 2.
///
/// | field | key | required | meaning, range |
/// |---|---|---|---|
/// | `name` | `name` | yes | any text |
/// | `sample_rate_hz` | `sample_rate` | yes | Hz, finite, above zero |
/// | `channels` | `[channels.*]` | output, input | see [`Channels`] |
/// | `controller` | `[controller]` | no | see [`Controller`] |
/// | `geometry` | `[geometry]` | no | see [`Geometry`] |
/// | `text` | `[text]` | no | see [`Text`] |
/// | `records` | `[[records]]` | at least one | see [`RecordEntry`] |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Name of the experiment.
    pub name: String,
    /// Samples a second (or a unit of time), above zero.
    pub sample_rate_hz: f64,
    /// The columns and their roles.
    pub channels: Channels,
    /// The loop that was closed, where there was one.
    #[serde(default)]
    pub controller: Option<Controller>,
    /// What lies between the logged channels and the motors, where known.
    #[serde(default)]
    pub geometry: Option<Geometry>,
    /// How its text files are laid out, as far as that is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text: Option<Text>,
    /// The records, in the file's order.
    #[serde(default)]
    pub records: Vec<RecordEntry>,
}

impl Description {
    /// A description with names only; add units, a controller or a geometry through the public fields. Record entries
    /// come from [`crate::BundleWriter::write`].
    pub fn new(name: &str, sample_rate_hz: f64, output: &[&str], input: &[&str]) -> Self {
        Self {
            name: name.to_owned(),
            sample_rate_hz,
            channels: Channels {
                output: ChannelGroup::new(output),
                input: ChannelGroup::new(input),
                ..Channels::default()
            },
            controller: None,
            geometry: None,
            text: None,
            records: Vec::new(),
        }
    }
}

/// Columns by role. An absent group is an empty one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Channels {
    /// Plant outputs y, at least one.
    pub output: ChannelGroup,
    /// Plant inputs u, at least one.
    pub input: ChannelGroup,
    /// Excitation or setpoints r.
    #[serde(skip_serializing_if = "ChannelGroup::is_empty")]
    pub reference: ChannelGroup,
    /// Scheduling p; empty means that the machine is treated as LTI.
    #[serde(skip_serializing_if = "ChannelGroup::is_empty")]
    pub scheduling: ChannelGroup,
    /// Other measured signals.
    #[serde(skip_serializing_if = "ChannelGroup::is_empty")]
    pub auxiliary: ChannelGroup,
}

/// Columns of one role.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ChannelGroup {
    /// Column or variable names in the record files.
    pub columns: Vec<String>,
    /// Units, one a column, or none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub units: Vec<String>,
    /// Factors applied on reading, one a column, or none for 1; finite, not zero.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scale: Vec<f64>,
    /// Subtracted after the scale, one a column, or none for 0; finite. Format 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offset: Vec<f64>,
    /// What the signals are, one a column, or none: then their units say it, and where they do not, they are positions. Format 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub quantity: Vec<Quantity>,
}

impl ChannelGroup {
    /// Columns without units and scales.
    pub fn new(columns: &[&str]) -> Self {
        Self {
            columns: columns.iter().map(ToString::to_string).collect(),
            ..Self::default()
        }
    }
    /// Some of the columns, by their indices; those that there are.
    #[must_use]
    pub fn only(&self, indices: &[usize]) -> Self {
        fn some<T: Clone>(all: &[T], indices: &[usize]) -> Vec<T> {
            indices.iter().filter_map(|i| all.get(*i).cloned()).collect()
        }
        Self {
            columns: some(&self.columns, indices),
            units: some(&self.units, indices),
            scale: some(&self.scale, indices),
            offset: some(&self.offset, indices),
            quantity: some(&self.quantity, indices),
        }
    }
    /// What a column is, as `quantity` or else its unit says.
    pub fn quantity_of(&self, column: usize) -> Quantity {
        let by_unit = || Quantity::of_unit(self.units.get(column).map_or("", String::as_str));
        self.quantity.get(column).copied().unwrap_or_else(by_unit)
    }
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns.len()
    }
    /// Whether there is no column.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }
}

/// `kind` of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EntryKind {
    /// Steady multisine, p constant.
    Periodic,
    /// Anything else.
    Transient,
    /// A measured frequency response at one position. Format 2.
    Response,
}

/// One `[[records]]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct RecordEntry {
    /// File, relative to the bundle folder, inside it.
    pub file: String,
    /// Kind of excitation.
    pub kind: EntryKind,
    /// Samples a period: at least 2 for a periodic record, absent for a transient one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 2))]
    pub period: Option<usize>,
    /// Whether it may be fitted or is held out.
    #[serde(rename = "use", with = "PurposeName")]
    pub purpose: Purpose,
    /// The constant p, one number a scheduling signal (several: format 2), else the means of the scheduling columns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<NumberOrList>")]
    pub position: Option<Position>,
    /// Known signals that this test added to the controller's output.
    #[serde(default, skip_serializing_if = "ChannelGroup::is_empty")]
    pub injection: ChannelGroup,
    /// Where this file has a column, if not by its name: `"u" = "exp1.Y[Name=input (V)].Data"`. Format 2.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, String>,
    /// First and last row that are used, counted from 1. Format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<[usize; 2]>,
    /// What a measured frequency response is of, and over; else of the outputs over samples of the inputs that are held. Format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantity: Option<ResponseQuantity>,
}

impl RecordEntry {
    /// The kind with its period; a periodic entry without a period, which no checked description has, counts as
    /// transient, and so does a response, which is no record of samples.
    pub fn record_kind(&self) -> RecordKind {
        match (self.kind, self.period) {
            (EntryKind::Periodic, Some(period)) => RecordKind::Periodic { period },
            _ => RecordKind::Transient,
        }
    }

    /// Where the file has a column.
    pub(crate) fn source_of<'a>(&'a self, column: &'a str) -> &'a str {
        self.columns.get(column).map_or(column, String::as_str)
    }

    /// Whether it has samples of an output or input in common with another entry of the same file.
    pub(crate) fn shares_samples(&self, other: &Self, channels: &Channels) -> bool {
        let overlap = match (self.rows, other.rows) {
            (Some([a, b]), Some([c, d])) => a <= d && c <= b,
            _ => true,
        };
        let mut signals = channels.output.columns.iter().chain(&channels.input.columns);
        if self.is_response() || other.is_response() {
            return overlap && self.kind == other.kind && self.columns == other.columns;
        }
        overlap && signals.any(|c| self.source_of(c) == other.source_of(c))
    }

    /// Whether it holds samples without a period.
    pub fn is_transient(&self) -> bool {
        self.kind != EntryKind::Response && !self.is_periodic()
    }

    /// Whether it is a measured frequency response.
    pub fn is_response(&self) -> bool {
        self.kind == EntryKind::Response
    }

    /// Whether [`RecordEntry::record_kind`] is periodic.
    pub fn is_periodic(&self) -> bool {
        matches!(self.record_kind(), RecordKind::Periodic { .. })
    }
}

/// `use` of a record.
/// How a position is written.
#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "it describes the schema alone")]
enum NumberOrList {
    One(f64),
    Several(Vec<f64>),
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(remote = "Purpose", rename_all = "lowercase")]
#[schemars(rename = "Use")]
enum PurposeName {
    /// May be fitted.
    Estimation,
    /// Held out: never used to fit anything.
    Validation,
}
