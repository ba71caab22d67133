//! The clauses of the format that need samples.

use crate::RecordError;
use crate::clipping::{self, Clipped, Ends};
use crate::rest::{REST, SCALE, Travel};
use lpv_core::{Position, Record, RecordKind, Signals};

/// What the checks need to know beside the record.
pub(crate) struct Expectation<'a> {
    /// `position` of the description.
    pub(crate) declared_position: Option<Position>,
    /// Range of a scheduling column over the bundle, by its index; asked only in doubt, because it may read other records.
    pub(crate) scheduling_range: Box<dyn Fn(usize) -> f64 + 'a>,
}

/// Checks every clause; gives the position, declared or, for a periodic record with scheduling signals, measured.
pub(crate) fn check(record: &Record, expected: &Expectation<'_>) -> Result<Option<Position>, RecordError> {
    if let RecordKind::Periodic { period } = record.kind {
        let mut check = PeriodicCheck::new(record, period);
        check.push(record);
        return check.finish(expected);
    }
    lengths(
        record
            .groups()
            .into_iter()
            .flat_map(named)
            .map(|(n, x)| (n, x.len())),
    )?;
    for (name, samples) in record.groups().into_iter().flat_map(named) {
        let mut finite = Finite::default();
        finite.push(samples);
        finite.finish(name)?;
    }
    for (name, samples) in named(&record.outputs).chain(named(&record.inputs)) {
        constant(name, samples.iter().all(|v| *v == samples[0]), samples[0])?;
    }
    // An input at its limit is what acted on the machine; nothing of it is lost.
    for (name, samples) in named(&record.outputs) {
        clipped(name, clipping::transient(samples), samples.len())?;
    }
    Ok(expected.declared_position.clone())
}

/// The clauses of a periodic record, which may come in parts.
pub(crate) struct PeriodicCheck {
    period: usize,
    columns: Vec<Column>,
}

/// What is known of a column so far.
struct Column {
    name: String,
    samples: usize,
    finite: Finite,
    what: What,
}

enum What {
    /// An output or an input, with its first sample and whether all others equal it; only an output can be clipped.
    Signal {
        first: f64,
        constant: bool,
        ends: Option<Ends>,
    },
    Scheduling(Travel),
    Other,
}

impl PeriodicCheck {
    /// For records with these channels.
    pub(crate) fn new(record: &Record, period: usize) -> Self {
        let what = |group: usize| match group {
            0 | 1 => What::Signal {
                first: f64::NAN,
                constant: true,
                ends: (group == OUTPUTS).then(Ends::default),
            },
            SCHEDULING => What::Scheduling(Travel::default()),
            _ => What::Other,
        };
        let groups = record.groups().into_iter().enumerate();
        let columns = groups.flat_map(|(group, signals)| signals.names.iter().map(move |n| (group, n)));
        Self {
            period,
            columns: columns
                .map(|(group, name)| Column {
                    name: name.clone(),
                    samples: 0,
                    finite: Finite::default(),
                    what: what(group),
                })
                .collect(),
        }
    }

    /// Takes the next part.
    pub(crate) fn push(&mut self, part: &Record) {
        let samples = part.groups().into_iter().flat_map(named);
        for (column, (_, samples)) in self.columns.iter_mut().zip(samples) {
            column.finite.push(samples);
            match &mut column.what {
                What::Signal {
                    first,
                    constant,
                    ends,
                } => {
                    if let (0, Some(v)) = (column.samples, samples.first()) {
                        *first = *v;
                    }
                    *constant &= samples.iter().all(|v| v == first);
                    if let Some(ends) = ends {
                        ends.push(samples);
                    }
                }
                What::Scheduling(travel) => travel.push(samples),
                What::Other => {}
            }
            column.samples += samples.len();
        }
    }

    /// Judges all parts; gives the position as [`check`] does.
    pub(crate) fn finish(&self, expected: &Expectation<'_>) -> Result<Option<Position>, RecordError> {
        lengths(self.columns.iter().map(|c| (c.name.as_str(), c.samples)))?;
        for column in &self.columns {
            column.finite.finish(&column.name)?;
        }
        periods(self.columns.first().map_or(0, |c| c.samples), self.period)?;
        let mut means = Vec::new();
        for column in &self.columns {
            if let What::Scheduling(travel) = &column.what {
                means.push(constant_scheduling(&column.name, means.len(), travel, expected)?);
            }
        }
        for column in &self.columns {
            if let What::Signal {
                first,
                constant: all_equal,
                ends,
            } = &column.what
            {
                constant(&column.name, *all_equal, *first)?;
                clipped(
                    &column.name,
                    ends.as_ref().and_then(Ends::clipped),
                    column.samples,
                )?;
            }
        }
        let measured = (!means.is_empty()).then(|| means.into());
        Ok(expected.declared_position.clone().or(measured))
    }
}

fn constant(name: &str, all_equal: bool, value: f64) -> Result<(), RecordError> {
    match all_equal {
        false => Ok(()),
        true => Err(RecordError::Constant {
            column: name.to_owned(),
            value,
        }),
    }
}

fn clipped(name: &str, found: Option<Clipped>, of: usize) -> Result<(), RecordError> {
    match found {
        None => Ok(()),
        Some(Clipped { extreme, samples }) => Err(RecordError::Clipped {
            column: name.to_owned(),
            extreme,
            samples,
            of,
        }),
    }
}

/// Places of the outputs and of the scheduling among the groups of a record.
const OUTPUTS: usize = 0;
const SCHEDULING: usize = 3;

fn named(signals: &Signals) -> impl Iterator<Item = (&str, &[f64])> {
    signals
        .names
        .iter()
        .map(String::as_str)
        .zip(signals.columns.iter().map(Vec::as_slice))
}

fn lengths<'a>(columns: impl Iterator<Item = (&'a str, usize)>) -> Result<(), RecordError> {
    let mut first: Option<(&str, usize)> = None;
    for (name, found) in columns {
        match first {
            None if found == 0 => {
                return Err(RecordError::Empty {
                    column: name.to_owned(),
                });
            }
            None => first = Some((name, found)),
            Some((first, expected)) if found != expected => {
                return Err(RecordError::UnequalLengths {
                    column: name.to_owned(),
                    found,
                    first: first.to_owned(),
                    expected,
                });
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// Rows of a column whose sample is no finite number.
#[derive(Default)]
struct Finite {
    samples: usize,
    count: usize,
    rows: Vec<usize>,
}

impl Finite {
    fn push(&mut self, samples: &[f64]) {
        for (k, _) in samples.iter().enumerate().filter(|(_, v)| !v.is_finite()) {
            self.count += 1;
            if self.rows.len() < 10 {
                self.rows.push(self.samples + k + 1);
            }
        }
        self.samples += samples.len();
    }

    fn finish(&self, name: &str) -> Result<(), RecordError> {
        if self.count == 0 {
            return Ok(());
        }
        Err(RecordError::NotFinite {
            column: name.to_owned(),
            rows: self.rows.clone(),
            lines: Vec::new(),
            count: self.count,
        })
    }
}

fn periods(samples: usize, period: usize) -> Result<(), RecordError> {
    if period == 0 || samples / period < 2 {
        return Err(RecordError::FewPeriods { samples, period });
    }
    match samples % period {
        0 => Ok(()),
        rest => Err(RecordError::PartialPeriod {
            samples,
            period,
            rest,
        }),
    }
}

/// The mean of a scheduling signal that does not move. Nothing but differences of p counts: its zero may lie anywhere.
fn constant_scheduling(
    name: &str,
    column: usize,
    travel: &Travel,
    expected: &Expectation<'_>,
) -> Result<f64, RecordError> {
    /// Part of the range of p by which a declared position may differ from the measured one.
    const SAME_POSITION: f64 = 1e-2;
    let (from, to, mean) = (travel.low(), travel.high(), travel.mean());
    let own = from.abs().max(to.abs());
    let range = || (expected.scheduling_range)(column);
    // With one position in the bundle nothing but its size gives a scale, and whoever declares it says that it rests.
    let declared = |p: f64| to - from <= REST * own.max(p.abs());
    let position = expected
        .declared_position
        .as_ref()
        .and_then(|p| p.get(column).copied());
    if !travel.rests(range) && !position.is_some_and(declared) {
        return Err(RecordError::SchedulingMoves {
            column: name.to_owned(),
            from,
            to,
            tolerance: REST * range(),
        });
    }
    if let Some(declared) = position {
        let range = range();
        let scale = if range > SCALE * (to - from) {
            range
        } else {
            own.max(declared.abs())
        };
        if (declared - mean).abs() > SAME_POSITION * scale + (to - from) {
            return Err(RecordError::PositionMismatch {
                column: name.to_owned(),
                declared,
                measured: mean,
            });
        }
    }
    Ok(mean)
}
