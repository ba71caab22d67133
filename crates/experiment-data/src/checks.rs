//! The clauses of the format that need samples.

use crate::RecordError;
use crate::clipping;
use lpv_core::{Record, RecordKind, Signals};

/// What the checks need to know beside the record.
pub(crate) struct Expectation<'a> {
    /// Saturation of the controller, which inputs of transient records may reach.
    pub(crate) limit: Option<f64>,
    /// `position` of the description.
    pub(crate) declared_position: Option<f64>,
    /// Largest |p| of the bundle; asked only in doubt, because it may read other records.
    pub(crate) scheduling_scale: &'a dyn Fn() -> f64,
}

/// Checks every clause; gives the position, declared or, for a periodic record with one scheduling signal, measured.
pub(crate) fn check(record: &Record, expected: &Expectation<'_>) -> Result<Option<f64>, RecordError> {
    let mut position = expected.declared_position;
    lengths(record)?;
    for signals in groups(record) {
        for (name, samples) in named(signals) {
            finite(name, samples)?;
        }
    }
    if let RecordKind::Periodic { period } = record.kind {
        periods(record.len(), period)?;
        for (name, p) in named(&record.scheduling) {
            let mean = constant_scheduling(name, p, expected)?;
            if record.scheduling.channels() == 1 {
                position = position.or(Some(mean));
            }
        }
    }
    for (signals, limit) in [(&record.outputs, None), (&record.inputs, expected.limit)] {
        for (name, samples) in named(signals) {
            if samples.iter().all(|v| *v == samples[0]) {
                return Err(RecordError::Constant {
                    column: name.to_owned(),
                    value: samples[0],
                });
            }
            let found = match record.kind {
                RecordKind::Periodic { .. } => clipping::periodic(samples),
                RecordKind::Transient => clipping::transient(samples, limit),
            };
            if let Some(clipped) = found {
                return Err(RecordError::Clipped {
                    column: name.to_owned(),
                    extreme: clipped.extreme,
                    samples: clipped.samples,
                    of: samples.len(),
                });
            }
        }
    }
    Ok(position)
}

fn groups(record: &Record) -> [&Signals; 6] {
    [
        &record.outputs,
        &record.inputs,
        &record.references,
        &record.scheduling,
        &record.auxiliary,
        &record.injection,
    ]
}

fn named(signals: &Signals) -> impl Iterator<Item = (&str, &[f64])> {
    signals
        .names
        .iter()
        .map(String::as_str)
        .zip(signals.columns.iter().map(Vec::as_slice))
}

fn lengths(record: &Record) -> Result<(), RecordError> {
    let mut first: Option<(&str, usize)> = None;
    for (name, samples) in groups(record).into_iter().flat_map(named) {
        match first {
            None if samples.is_empty() => {
                return Err(RecordError::Empty {
                    column: name.to_owned(),
                });
            }
            None => first = Some((name, samples.len())),
            Some((first, expected)) if samples.len() != expected => {
                return Err(RecordError::UnequalLengths {
                    column: name.to_owned(),
                    found: samples.len(),
                    first: first.to_owned(),
                    expected,
                });
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn finite(name: &str, samples: &[f64]) -> Result<(), RecordError> {
    let bad = || {
        samples
            .iter()
            .enumerate()
            .filter(|(_, v)| !v.is_finite())
            .map(|(k, _)| k + 1)
    };
    let count = bad().count();
    if count == 0 {
        return Ok(());
    }
    Err(RecordError::NotFinite {
        column: name.to_owned(),
        rows: bad().take(10).collect(),
        lines: Vec::new(),
        count,
    })
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

/// Mean of a column. An exactly constant one gives exactly its value: records of one position are found by it.
pub(crate) fn mean(p: &[f64]) -> f64 {
    if p.iter().all(|v| *v == p[0]) {
        p[0]
    } else {
        p.iter().map(|v| v / p.len() as f64).sum()
    }
}

/// The mean of a scheduling signal that does not move.
fn constant_scheduling(name: &str, p: &[f64], expected: &Expectation<'_>) -> Result<f64, RecordError> {
    const CONSTANT: f64 = 1e-3;
    const SAME_POSITION: f64 = 1e-2;
    let from = p.iter().copied().fold(f64::INFINITY, f64::min);
    let to = p.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = mean(p);
    let own = from.abs().max(to.abs());
    if to - from > CONSTANT * own {
        let tolerance = CONSTANT * (expected.scheduling_scale)().max(own);
        // Around zero, and with no other position in the bundle, nothing gives a scale: the shape decides.
        let noise_around_zero =
            mean.abs() <= to - from && (expected.scheduling_scale)() <= own && von_neumann(p, mean) > 1.0;
        if to - from > tolerance && !noise_around_zero {
            return Err(RecordError::SchedulingMoves {
                column: name.to_owned(),
                from,
                to,
                tolerance,
            });
        }
    }
    if let Some(declared) = expected.declared_position {
        let apart = (declared - mean).abs();
        if apart > SAME_POSITION * own.max(declared.abs())
            && apart > SAME_POSITION * (expected.scheduling_scale)()
        {
            return Err(RecordError::PositionMismatch {
                column: name.to_owned(),
                declared,
                measured: mean,
            });
        }
    }
    Ok(mean)
}

/// Mean square successive difference over the variance: 2 for white noise, near 0 for a smooth motion.
fn von_neumann(p: &[f64], mean: f64) -> f64 {
    let steps: f64 = p.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let spread: f64 = p.iter().map(|v| (v - mean).powi(2)).sum();
    steps / spread
}
