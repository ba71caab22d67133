//! Measured or simulated signals; nothing here says which.

use crate::linalg::dimension;
use crate::{CoreError, Position};

/// Named columns of equal length, one a channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Signals {
    /// Channel names.
    pub names: Vec<String>,
    /// Units, one a channel; empty where unknown.
    pub units: Vec<String>,
    /// Samples, one vector a channel.
    pub columns: Vec<Vec<f64>>,
}

impl Signals {
    /// Columns with names and without units.
    pub fn new(names: &[&str], columns: Vec<Vec<f64>>) -> Self {
        Self {
            names: names.iter().map(ToString::to_string).collect(),
            units: Vec::new(),
            columns,
        }
    }
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.columns.len()
    }
    /// Samples a channel.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }
    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// What kind of excitation a record holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// Steady multisine at constant scheduling.
    Periodic {
        /// Samples a period.
        period: usize,
    },
    /// Anything else.
    Transient,
}

/// What a record may be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// To fit.
    Estimation,
    /// Held out: never used to fit anything.
    Validation,
}

/// One experiment: signals of equal length at one sample rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Name, usually the file's.
    pub name: String,
    /// Kind of excitation.
    pub kind: RecordKind,
    /// Use.
    pub purpose: Purpose,
    /// Constant scheduling values, where the experiment has them.
    pub position: Option<Position>,
    /// Plant outputs y.
    pub outputs: Signals,
    /// Plant inputs u.
    pub inputs: Signals,
    /// Excitation or setpoints r; may be empty.
    pub references: Signals,
    /// Scheduling p; may be empty.
    pub scheduling: Signals,
    /// Other measured signals; may be empty.
    pub auxiliary: Signals,
    /// Known signals that the test added to the controller's output; may be empty.
    pub injection: Signals,
}

impl Record {
    /// A record without signals, to be filled.
    pub fn empty(name: &str, kind: RecordKind, purpose: Purpose) -> Self {
        Self {
            name: name.to_owned(),
            kind,
            purpose,
            position: None,
            outputs: Signals::default(),
            inputs: Signals::default(),
            references: Signals::default(),
            scheduling: Signals::default(),
            auxiliary: Signals::default(),
            injection: Signals::default(),
        }
    }

    /// The groups of signals, each with its name in a description: output, input, reference, scheduling, auxiliary, injection.
    pub fn named_groups(&self) -> [(&'static str, &Signals); 6] {
        [
            ("output", &self.outputs),
            ("input", &self.inputs),
            ("reference", &self.references),
            ("scheduling", &self.scheduling),
            ("auxiliary", &self.auxiliary),
            ("injection", &self.injection),
        ]
    }

    /// The groups of signals, in that order.
    pub fn groups(&self) -> [&Signals; 6] {
        self.named_groups().map(|(_, group)| group)
    }

    /// Some of the samples, a range within the record, as a record.
    #[must_use]
    pub fn part(&self, samples: std::ops::Range<usize>) -> Self {
        let [outputs, inputs, references, scheduling, auxiliary, injection] =
            self.groups().map(|group| Signals {
                names: group.names.clone(),
                units: group.units.clone(),
                columns: group
                    .columns
                    .iter()
                    .map(|c| c[samples.clone()].to_vec())
                    .collect(),
            });
        Self {
            name: self.name.clone(),
            kind: self.kind,
            purpose: self.purpose,
            position: self.position.clone(),
            outputs,
            inputs,
            references,
            scheduling,
            auxiliary,
            injection,
        }
    }

    /// Keeps the first samples.
    pub fn truncate(&mut self, samples: usize) {
        let groups = [
            &mut self.outputs,
            &mut self.inputs,
            &mut self.references,
            &mut self.scheduling,
            &mut self.auxiliary,
            &mut self.injection,
        ];
        let columns = groups.into_iter().flat_map(|group| &mut group.columns);
        columns.for_each(|column| column.truncate(samples));
    }

    /// Samples of the record.
    pub fn len(&self) -> usize {
        self.outputs.len()
    }
    /// Whether the record has no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks that all channels have one length, that all numbers and the position are finite, and that a periodic record holds at
    /// least two whole periods.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`] (row: sample, column: channel).
    pub fn check(&self) -> Result<(), CoreError> {
        for (what, signals) in self.named_groups() {
            for (column, samples) in signals.columns.iter().enumerate() {
                dimension("record: samples of a channel", self.len(), samples.len())?;
                if let Some(row) = samples.iter().position(|v| !v.is_finite()) {
                    return Err(CoreError::NotFinite { what, row, column });
                }
            }
        }
        if self.position.iter().any(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(CoreError::NotFinite {
                what: "record: position",
                row: 0,
                column: 0,
            });
        }
        if let RecordKind::Periodic { period } = self.kind
            && (period == 0 || self.len() < period.saturating_mul(2) || !self.len().is_multiple_of(period))
        {
            return Err(CoreError::Dimension {
                what: "periodic record: samples (a whole number of periods, at least two)",
                expected: period.max(1).saturating_mul(2),
                found: self.len(),
            });
        }
        Ok(())
    }
}

/// One period of a closed-loop experiment as it is produced or read: the unit that streams.
#[derive(Debug, Clone, Copy)]
pub struct PeriodBlock<'a> {
    /// Which experiment at this position, from 0.
    pub experiment: usize,
    /// Which period, from 0.
    pub period: usize,
    /// Plant outputs, one slice a channel.
    pub outputs: &'a [Vec<f64>],
    /// Plant inputs, one slice a channel.
    pub inputs: &'a [Vec<f64>],
    /// References, one slice a channel; may be empty.
    pub references: &'a [Vec<f64>],
}
