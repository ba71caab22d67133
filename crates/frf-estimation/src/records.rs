//! Whole records into the accumulator, with the transient judged from all periods.

use crate::accumulator::{finite, shape};
use crate::{FrfError, Layout, PeriodicAccumulator, PeriodicEstimate, PeriodicSettings, SkipRule};
use lpv_core::{Clock, Discrete, PeriodBlock, Record, RecordKind, Signals};

/// Factor above what the later periods show that a difference must exceed to be called a transient.
const EXCESS: f64 = 1.5;
/// Differences below this part of the signal's root mean square do not matter, whatever the later periods show.
const FLOOR: f64 = 1e-9;

/// Estimates the FRF from periodic records of one plant at one position, one record an experiment.
///
/// Under [`SkipRule::Auto`] the last period is taken as settled. For each output and input, the mean square
/// of the difference between a period and the last one is compared with its largest value over the second half of the
/// record; every period of the first half up to the last one that is more than 50 % above is dropped, and as many from
/// every record, so that all keep their steady part. At most half of the periods are dropped.
///
/// # Errors
/// [`FrfError::NoRecords`], [`FrfError::NotPeriodic`], [`FrfError::Mismatch`] where records differ in period, channels or
/// position, [`FrfError::BlockShape`], [`FrfError::NotFinite`], and all of [`PeriodicAccumulator`].
pub fn estimate_records(
    records: &[&Record],
    clock: Discrete,
    settings: &PeriodicSettings,
) -> Result<PeriodicEstimate, FrfError> {
    let first = *records.first().ok_or(FrfError::NoRecords)?;
    let mut periods = Vec::with_capacity(records.len());
    for (index, record) in records.iter().enumerate() {
        let RecordKind::Periodic { period } = record.kind else {
            return Err(FrfError::NotPeriodic {
                record: index,
                name: record.name.clone(),
            });
        };
        periods.push(period);
        check_alike(index, record, first)?;
        if period != periods[0] {
            return Err(mismatch(
                index,
                record,
                "the period",
                periods[0] as f64,
                period as f64,
            ));
        }
        record.check()?;
    }
    let period = periods[0];
    let layout = Layout {
        period,
        outputs: first.outputs.channels(),
        inputs: first.inputs.channels(),
        references: first.references.channels(),
        experiments: records.len(),
        sample_rate_hz: 2.0 * clock.nyquist_hz(),
    };
    let skip = match settings.skip {
        SkipRule::Fixed(n) => n,
        SkipRule::Auto => records
            .iter()
            .map(|r| unsettled_periods(r, period))
            .max()
            .unwrap_or(0),
    };
    let fixed = PeriodicSettings {
        skip: SkipRule::Fixed(skip),
        ..settings.clone()
    };
    let mut accumulator = PeriodicAccumulator::new(layout, &fixed, first.position.clone())?;
    for (experiment, record) in records.iter().enumerate() {
        for m in 0..record.len() / period {
            let cut = |signals: &Signals| -> Vec<Vec<f64>> {
                let range = m * period..(m + 1) * period;
                signals
                    .columns
                    .iter()
                    .map(|c| c[range.clone()].to_vec())
                    .collect()
            };
            let (outputs, inputs) = (cut(&record.outputs), cut(&record.inputs));
            let references = cut(&record.references);
            accumulator.push(&PeriodBlock {
                experiment,
                period: m,
                outputs: &outputs,
                inputs: &inputs,
                references: &references,
            })?;
        }
    }
    accumulator.finish()
}

/// Periods at the start of the record in which the transient shows.
fn unsettled_periods(record: &Record, period: usize) -> usize {
    let channels = || record.outputs.columns.iter().chain(&record.inputs.columns);
    let of = |m: usize| channels().map(move |c| &c[m * period..(m + 1) * period]);
    let count = record.len() / period;
    let mut settling = Settling::new(of(count - 1).map(<[f64]>::to_vec).collect());
    (0..count).for_each(|m| settling.push(of(m)));
    settling.unsettled()
}

/// How long the transient at the start of a periodic record lasts, as [`estimate_records`] judges it, from one period at a time.
#[derive(Debug, Clone)]
pub struct Settling {
    last: Vec<Vec<f64>>,
    /// Of each signal, by period: sum of squares of the difference from the last one.
    differences: Vec<Vec<f64>>,
}

impl Settling {
    /// For a record that ends with this period of its outputs and inputs.
    #[must_use]
    pub fn new(last: Vec<Vec<f64>>) -> Self {
        let differences = vec![Vec::new(); last.len()];
        Self { last, differences }
    }

    /// Takes the periods in their order, the last one included; a signal each, as in [`Settling::new`].
    pub fn push<'a>(&mut self, period: impl IntoIterator<Item = &'a [f64]>) {
        for ((all, last), own) in self.differences.iter_mut().zip(&self.last).zip(period) {
            all.push(own.iter().zip(last).map(|(a, b)| (a - b) * (a - b)).sum());
        }
    }

    /// Periods at the start in which the transient shows.
    #[must_use]
    pub fn unsettled(&self) -> usize {
        let unsettled = self
            .differences
            .iter()
            .zip(&self.last)
            .map(|(differences, last)| {
                let count = differences.len();
                let half = count / 2;
                // Two periods leave nothing to compare with.
                let settled = differences[half..].iter().take((count - half).saturating_sub(1));
                let Some(settled) = settled.copied().reduce(f64::max) else {
                    return 0;
                };
                let power: f64 = last.iter().map(|x| x * x).sum();
                let limit = (EXCESS * settled).max(FLOOR * FLOOR * power);
                let moves = differences[..half].iter().rposition(|d| *d > limit);
                moves.map_or(0, |m| m + 1)
            });
        unsettled.max().unwrap_or(0)
    }
}

/// Channels, position and finite samples; for all estimators that take several records.
pub(crate) fn check_alike(index: usize, record: &Record, first: &Record) -> Result<(), FrfError> {
    let groups = [
        ("output", "the number of outputs", &record.outputs, &first.outputs),
        ("input", "the number of inputs", &record.inputs, &first.inputs),
        (
            "reference",
            "the number of references",
            &record.references,
            &first.references,
        ),
    ];
    for (kind, what, signals, reference) in groups {
        let (expected, found) = (reference.channels(), signals.channels());
        if expected != found {
            return Err(mismatch(index, record, what, expected as f64, found as f64));
        }
        for (channel, samples) in signals.columns.iter().enumerate() {
            shape(index, "samples of a channel", record.len(), samples.len())?;
            finite(index, kind, channel, samples)?;
        }
    }
    if record.position != first.position {
        let [expected, found] = [first, record].map(|r| r.position.as_deref().unwrap_or(&[]));
        let value = |p: &[f64], i: usize| p.get(i).copied().unwrap_or(f64::NAN);
        let differs = |i: &usize| expected.get(*i) != found.get(*i);
        let at = (0..expected.len().max(found.len())).find(differs).unwrap_or(0);
        let (expected, found) = (value(expected, at), value(found, at));
        return Err(mismatch(index, record, "the position", expected, found));
    }
    Ok(())
}

pub(crate) fn mismatch(
    record: usize,
    which: &Record,
    what: &'static str,
    expected: f64,
    found: f64,
) -> FrfError {
    FrfError::Mismatch {
        record,
        name: which.name.clone(),
        what,
        expected,
        found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::Purpose;

    fn record(samples: Vec<f64>, period: usize) -> Record {
        Record {
            name: "r".into(),
            kind: RecordKind::Periodic { period },
            purpose: Purpose::Estimation,
            position: None,
            outputs: Signals::new(&["y"], vec![samples]),
            inputs: Signals::default(),
            references: Signals::default(),
            scheduling: Signals::default(),
            auxiliary: Signals::default(),
            injection: Signals::default(),
        }
    }

    #[test]
    fn decaying_transient_is_skipped() {
        // Periods of one value and a zero: 100, 10, 1, 0.1 off, then steady but for +-0.01.
        let values = [100.0, 10.0, 1.0, 0.1, 0.01, -0.01, 0.01, -0.01, 0.01, 0.0];
        let samples: Vec<f64> = values.iter().flat_map(|v| [5.0 + v, 5.0]).collect();
        assert_eq!(unsettled_periods(&record(samples, 2), 2), 4);
        assert_eq!(unsettled_periods(&record(vec![1.0; 12], 2), 2), 0);
        assert_eq!(unsettled_periods(&record(vec![1.0, 0.0, 2.0, 0.0], 2), 2), 0);
    }
}
