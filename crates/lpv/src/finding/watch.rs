//! One look at a record while it is read, whole or a period at a time, and what all looks say together.

use super::clock::{Uneven, is_clock, other_rate, uneven};
use super::copies::Prints;
use super::dead_time::{dead_time, trend};
use super::held::held;
use super::jump::jump;
use super::loop_only::is_feedback_only;
use super::periods::Periods;
use super::replay::mismatches;
use super::transient::{Spectrum, spectrum};
use super::wrap::wrap;
use super::{Finding, Paths};
use crate::signal::moves;
use experiment_data::{Bundle, ChannelGroup, Quantity};
use lpv_core::{Controller, Purpose, Record, RecordKind, Signals};

/// Samples of a record that are looked at for patterns within it.
const HEAD: usize = 50_000;
/// Parts of a record that comes in parts whose samples are looked at.
const PARTS: usize = 2;

/// Looks at a record.
#[derive(Debug, Clone)]
pub(crate) struct Watch<'a> {
    controller: Option<&'a Controller>,
    /// What the outputs are; positions where nobody says.
    outputs: Option<&'a ChannelGroup>,
    /// The sample rate, and the group in which columns of times are.
    times: Option<(f64, &'a ChannelGroup)>,
    parts: usize,
    record: String,
    findings: Vec<Finding>,
    /// Outputs, inputs, references.
    groups: [Group; 3],
    scheduling: [f64; 2],
    prints: Prints,
    spectrum: Option<Spectrum>,
}

#[derive(Debug, Clone, Default)]
struct Group {
    names: Vec<String>,
    periods: Vec<Periods>,
    /// Sums of the periods but the first, and their number.
    sums: Vec<Vec<f64>>,
    count: usize,
}

/// What is known of a record once it was read.
#[derive(Debug, Clone)]
pub(crate) struct Look {
    pub(crate) record: String,
    pub(crate) findings: Vec<Finding>,
    /// Smallest and largest value of the first scheduling signal.
    pub(crate) scheduling: Option<[f64; 2]>,
    /// Rise over a period of the outputs and of the inputs, where it matters; else zero.
    pub(crate) rises: [Vec<f64>; 2],
    pub(super) prints: Prints,
    /// The response of a transient record.
    pub(super) spectrum: Option<Spectrum>,
    /// Mean periods of outputs, inputs, references; empty for a transient record.
    pub(super) means: [Vec<Vec<f64>>; 3],
}

impl<'a> Watch<'a> {
    pub(crate) fn new(bundle: &'a Bundle) -> Self {
        let description = bundle.description();
        Self {
            outputs: Some(&description.channels.output),
            times: Some((description.sample_rate_hz, &description.channels.auxiliary)),
            ..Self::with(description.controller.as_ref())
        }
    }

    pub(super) fn with(controller: Option<&'a Controller>) -> Self {
        Self {
            controller,
            outputs: None,
            times: None,
            parts: 0,
            record: String::new(),
            findings: Vec::new(),
            groups: Default::default(),
            scheduling: [f64::INFINITY, f64::NEG_INFINITY],
            prints: Prints::default(),
            spectrum: None,
        }
    }

    /// Takes the whole record, or the next of its parts: a period.
    pub(crate) fn push(&mut self, part: &Record) {
        if self.parts == 0 {
            self.record.clone_from(&part.name);
            self.prints.record.clone_from(&part.name);
            self.prints.held_out = part.purpose == Purpose::Validation;
        }
        if self.parts < PARTS {
            self.samples(part);
        }
        self.parts += 1;
        for p in part.scheduling.columns.first().into_iter().flatten() {
            self.scheduling = [self.scheduling[0].min(*p), self.scheduling[1].max(*p)];
        }
        if let RecordKind::Periodic { period } = part.kind {
            let signals = [&part.outputs, &part.inputs, &part.references];
            for (group, signals) in self.groups.iter_mut().zip(signals) {
                group.push(signals, period);
            }
        }
    }

    fn add(&mut self, finding: Finding) {
        let same = |f: &Finding| {
            std::mem::discriminant(f) == std::mem::discriminant(&finding) && f.column() == finding.column()
        };
        if !self.findings.iter().any(same) {
            self.findings.push(finding);
        }
    }

    fn samples(&mut self, part: &Record) {
        let record = part.name.clone();
        self.repeats(part);
        // A speed or an acceleration may jump.
        let is_position = |i: usize| {
            self.outputs
                .is_none_or(|group| group.quantity_of(i) == Quantity::Position)
        };
        let positions: Vec<bool> = (0..part.outputs.channels()).map(is_position).collect();
        for ((name, x), is_position) in named(&part.outputs).zip(positions) {
            if let Some(found) = wrap(x) {
                self.add(Finding::CounterWraps {
                    record: record.clone(),
                    column: name.to_owned(),
                    modulus: found.modulus,
                    times: found.times,
                    row: found.sample + 1,
                });
            } else if is_position
                && part.kind == RecordKind::Transient
                && let Some(found) = jump(x)
            {
                self.add(Finding::PositionJumps {
                    record: record.clone(),
                    column: name.to_owned(),
                    size: found.size,
                    times: found.times,
                    row: found.sample + 1,
                });
            }
        }
        for (name, t) in named(&part.auxiliary).filter(|(name, _)| is_clock(name)) {
            if let Some(found) = clock_finding(record.clone(), name.to_owned(), t) {
                self.add(found);
            } else if let Some((sample_rate, group)) = self.times
                && let Some(hz) = other_rate(t, unit_of(group, name), sample_rate)
            {
                self.add(Finding::OtherRate {
                    record: record.clone(),
                    column: name.to_owned(),
                    hz,
                    sample_rate,
                });
            }
        }
        // What is wrong with the signals themselves is wrong in the controller's too.
        let whole = self.findings.is_empty();
        if let (Some(controller), true, true) = (self.controller, moves(&part.references), whole) {
            for found in mismatches(part, controller) {
                self.add(Finding::ControllerMismatch {
                    record: record.clone(),
                    column: part.inputs.names.get(found.input).cloned().unwrap_or_default(),
                    percent: 100.0 * found.left,
                    factors: found.factors.map(|[reference, output]| Paths {
                        reference: Some(reference).filter(|r| r.is_finite()),
                        output,
                    }),
                });
            }
        }
        for ((name, r), u) in named(&part.references).zip(&part.inputs.columns) {
            if proportional(r, u) {
                self.add(Finding::ReferenceIsInput {
                    record: record.clone(),
                    column: name.to_owned(),
                });
            }
        }
        if part.kind == RecordKind::Transient {
            self.prints.add(part);
            self.spectrum = self.spectrum.take().or_else(|| spectrum(part));
            self.transient(part);
        }
        if part.kind == RecordKind::Transient
            && !moves(&part.references)
            && !moves(&part.injection)
            && is_feedback_only(part)
        {
            self.add(Finding::FeedbackOnly {
                record,
                input: part.inputs.names.first().cloned().unwrap_or_default(),
                output: part.outputs.names.first().cloned().unwrap_or_default(),
            });
        }
    }

    /// Dead time and drift, where no reference moves the machine.
    fn transient(&mut self, part: &Record) {
        for (name, y) in named(&part.outputs) {
            let (record, column) = (part.name.clone(), name.to_owned());
            if let [u] = part.inputs.columns.as_slice()
                && let Some(samples) = dead_time(u, y)
            {
                self.add(Finding::DeadTime {
                    record: record.clone(),
                    column: column.clone(),
                    samples,
                });
            }
            if !moves(&part.references)
                && !moves(&part.injection)
                && let Some(rise) = trend(&part.inputs.columns, y)
            {
                self.add(Finding::Trend { record, column, rise });
            }
        }
    }

    /// Values that repeat: all of them, those of the outputs, or of the inputs alone.
    fn repeats(&mut self, part: &Record) {
        let of = |signals: &Signals| -> Vec<Option<f64>> {
            signals
                .columns
                .iter()
                .map(|x| held(&x[..x.len().min(HEAD)]))
                .collect()
        };
        let (y, u, r) = (of(&part.outputs), of(&part.inputs), of(&part.references));
        let all = |of: &[Option<f64>]| !of.is_empty() && of.iter().all(Option::is_some);
        let every = all(&y) && all(&u);
        let driven = !r.is_empty() && r.iter().all(Option::is_none);
        let groups = [(&part.outputs, &y, true), (&part.inputs, &u, driven)];
        for (signals, found, wrong) in groups {
            for (name, samples) in signals.names.iter().zip(found) {
                if let Some(samples) = samples {
                    self.add(Finding::HeldSamples {
                        record: part.name.clone(),
                        column: name.clone(),
                        samples: *samples,
                        every,
                        wrong: wrong || every,
                    });
                }
            }
        }
    }

    /// What the record has told.
    pub(crate) fn finish(mut self) -> Look {
        let groups = std::mem::take(&mut self.groups);
        let shifts: Vec<_> = groups
            .iter()
            .flat_map(|g| g.names.iter().zip(&g.periods))
            .filter_map(|(name, p)| Some((name, p.shift()?)))
            .collect();
        // The excitation is in all signals; the one that shows it best says it.
        if let Some((column, shift)) = shifts.iter().max_by(|a, b| a.1.turn.total_cmp(&b.1.turn)) {
            self.add(Finding::PeriodDrifts {
                record: self.record.clone(),
                column: (*column).clone(),
                period: shift.period,
                turn: shift.turn,
                grave: shift.grave,
            });
        }
        let mut rises = [Vec::new(), Vec::new()];
        for (rises, group) in rises.iter_mut().zip(&groups) {
            for (name, periods) in group.names.iter().zip(&group.periods) {
                let found = periods.drift();
                rises.push(found.map_or(0.0, |[rise, _]| rise));
                if let Some([rise, part]) = found {
                    self.add(Finding::LevelDrifts {
                        record: self.record.clone(),
                        column: name.clone(),
                        rise,
                        percent: crate::signal::finite(100.0 * part),
                    });
                }
            }
        }
        let mut means = groups.map(Group::means);
        for (means, rises) in means.iter_mut().zip(&rises) {
            for (mean, rise) in means.iter_mut().zip(rises) {
                take_out(mean, *rise, 0);
            }
        }
        Look {
            record: self.record,
            findings: self.findings,
            scheduling: (self.scheduling[0] <= self.scheduling[1]).then_some(self.scheduling),
            rises,
            prints: self.prints,
            spectrum: self.spectrum,
            means,
        }
    }
}

impl Group {
    fn push(&mut self, signals: &Signals, period: usize) {
        if self.names.is_empty() {
            self.names.clone_from(&signals.names);
            self.periods = vec![Periods::default(); signals.channels()];
            self.sums = vec![Vec::new(); signals.channels()];
        }
        let columns = self.periods.iter_mut().zip(&mut self.sums).zip(&signals.columns);
        let before = self.count;
        for ((periods, sums), x) in columns {
            for (m, x) in x.chunks_exact(period.max(1)).enumerate() {
                periods.push(x);
                match before + m {
                    0 | 1 => x.clone_into(sums),
                    _ => sums.iter_mut().zip(x).for_each(|(s, x)| *s += x),
                }
            }
        }
        self.count += signals.len() / period.max(1);
    }

    fn means(self) -> Vec<Vec<f64>> {
        let count = self.count.saturating_sub(1).max(1) as f64;
        let mean = |sums: Vec<f64>| sums.into_iter().map(|s| s / count).collect();
        self.sums.into_iter().map(mean).collect()
    }
}

impl Look {
    /// Takes the drift of the level out of periods of the record, the first of them with this number.
    pub(crate) fn level(&self, part: &mut Record, first: usize) {
        let groups = [&mut part.outputs, &mut part.inputs];
        for (signals, rises) in groups.into_iter().zip(&self.rises) {
            for (x, rise) in signals.columns.iter_mut().zip(rises) {
                if let RecordKind::Periodic { period } = part.kind {
                    for (m, x) in x.chunks_mut(period.max(1)).enumerate() {
                        take_out(x, *rise, first + m);
                    }
                }
            }
        }
    }
}

/// A ramp of this rise over a period, in the period of this number.
fn take_out(x: &mut [f64], rise: f64, number: usize) {
    if rise != 0.0 {
        let n = x.len() as f64;
        x.iter_mut()
            .enumerate()
            .for_each(|(t, v)| *v -= rise * (number as f64 + t as f64 / n));
    }
}

/// Whether a signal is another one, up to a factor and rounding.
fn proportional(r: &[f64], u: &[f64]) -> bool {
    let power: f64 = u.iter().map(|u| u * u).sum();
    let factor = r.iter().zip(u).map(|(r, u)| r * u).sum::<f64>() / power;
    let left: f64 = r.iter().zip(u).map(|(r, u)| (r - factor * u).powi(2)).sum();
    let size: f64 = r.iter().map(|r| r * r).sum();
    size > 0.0 && left <= 1e-18 * size
}

/// The unit of a column, where the description states it.
fn unit_of<'a>(group: &'a ChannelGroup, name: &str) -> Option<&'a str> {
    let i = group.columns.iter().position(|c| c == name)?;
    group.units.get(i).map(String::as_str).filter(|u| !u.is_empty())
}

fn named(signals: &Signals) -> impl Iterator<Item = (&str, &[f64])> {
    let names = signals.names.iter().map(String::as_str);
    names.zip(signals.columns.iter().map(Vec::as_slice))
}

pub(super) fn clock_finding(record: String, column: String, t: &[f64]) -> Option<Finding> {
    Some(match uneven(t)? {
        Uneven::Lost { samples, behind } => Finding::LostSamples {
            record,
            column,
            samples,
            row: behind + 1,
        },
        Uneven::Back { times, behind } => Finding::DoubleSamples {
            record,
            column,
            times,
            row: behind + 1,
        },
    })
}
