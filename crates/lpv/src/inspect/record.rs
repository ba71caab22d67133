//! Figures of each record and channel.

use super::Spread;
use crate::account::NumberOrList;
use experiment_data::{Bundle, DataError};
use frf_estimation::{Coherence, multiple_coherence};
use lpv_core::num_complex::Complex;
use lpv_core::{Position, Purpose, Record, RecordKind, Signals};
use lpv_numerics::statistics::{mean, range, standard_deviation};
use realfft::RealFftPlanner;
use schemars::JsonSchema;
use serde::Serialize;

/// One record.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RecordInfo {
    /// Name.
    pub name: String,
    /// File, relative to the bundle.
    pub file: String,
    /// `periodic` or `transient`.
    pub kind: &'static str,
    /// `estimation` or `validation`.
    pub purpose: &'static str,
    /// Samples.
    pub samples: usize,
    /// Length in units of time.
    pub duration: f64,
    /// Samples a period.
    pub period: Option<usize>,
    /// The constant scheduling value.
    #[schemars(with = "Option<NumberOrList>")]
    pub position: Option<Position>,
    /// Smallest and largest value of each scheduling signal.
    pub scheduling: Vec<[f64; 2]>,
    /// Figures of every channel; of a periodic record in a large file, those of its last period.
    pub channels: Vec<ChannelStats>,
    /// Multiple coherence of each output with all inputs over the lines of a Welch spectrum; transient records that are long
    /// enough.
    pub coherence: Vec<Spread>,
    /// The part of the power of each output, or of its differences, that the inputs explain linearly, from the same spectrum.
    pub explained: Vec<f64>,
}

/// Figures of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ChannelStats {
    /// Role.
    pub role: &'static str,
    /// Column.
    pub name: String,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Root mean square about the mean.
    pub rms: f64,
    /// Largest deviation from the mean over the rms.
    pub crest_factor: f64,
    /// Step between neighbouring values, where the signal has few different ones.
    pub resolution: Option<f64>,
    /// Part of the power about the mean above 0.8 times the Nyquist frequency.
    pub near_nyquist: f64,
}

/// The figures of a record; its file as the bundle names it.
pub(super) fn describe(r: &Record, file: &str, sample_rate_hz: f64) -> RecordInfo {
    let groups = [
        ("output", &r.outputs),
        ("input", &r.inputs),
        ("reference", &r.references),
        ("auxiliary", &r.auxiliary),
        ("injection", &r.injection),
    ];
    let welch = coherence(r);
    RecordInfo {
        name: r.name.clone(),
        file: file.to_owned(),
        kind: match r.kind {
            RecordKind::Periodic { .. } => "periodic",
            RecordKind::Transient => "transient",
        },
        purpose: match r.purpose {
            Purpose::Estimation => "estimation",
            Purpose::Validation => "validation",
        },
        samples: r.len(),
        duration: r.len() as f64 / sample_rate_hz,
        period: match r.kind {
            RecordKind::Periodic { period } => Some(period),
            RecordKind::Transient => None,
        },
        position: r.position.clone(),
        scheduling: r
            .scheduling
            .columns
            .iter()
            .map(|c| {
                let (low, high) = range(c);
                [low, high]
            })
            .collect(),
        channels: groups
            .into_iter()
            .flat_map(|(role, signals)| stats(role, signals))
            .collect(),
        coherence: welch.by_output.iter().map(|c| Spread::of(c)).collect(),
        explained: welch.explained,
    }
}

/// The same of a periodic record that need not be in memory as a whole.
pub(super) fn describe_large(bundle: &Bundle, index: usize, file: &str) -> Result<RecordInfo, DataError> {
    let (mut samples, mut last) = (0, None);
    let mut scheduling: Vec<[f64; 2]> = Vec::new();
    let position = bundle.each_period(index, |part| {
        samples += part.len();
        let columns = &part.scheduling.columns;
        scheduling.resize(columns.len(), [f64::INFINITY, f64::NEG_INFINITY]);
        for ([low, high], column) in scheduling.iter_mut().zip(columns) {
            let own = range(column);
            (*low, *high) = (low.min(own.0), high.max(own.1));
        }
        last = Some(part);
    })?;
    let rate = bundle.description().sample_rate_hz;
    let last = match last {
        Some(last) => last,
        // A record without a period is refused above.
        None => bundle.load(index)?,
    };
    Ok(RecordInfo {
        samples,
        duration: samples as f64 / rate,
        position,
        scheduling,
        ..describe(&last, file, rate)
    })
}

/// Welch's method with segments of a sixteenth of the record; empty for records too short for it. A motion that drifts hides in its
/// slowest lines what the inputs do: the differences of all signals are asked too, and those that the inputs explain best count.
fn coherence(r: &Record) -> Coherence {
    const EXPLAINED: f64 = 0.9;
    if matches!(r.kind, RecordKind::Periodic { .. }) {
        return Coherence::default();
    }
    let least = |c: &Coherence| c.explained.iter().copied().fold(f64::INFINITY, f64::min);
    let mut best = multiple_coherence(r, SEGMENTS).unwrap_or_default();
    let mut signals = r.clone();
    for _ in 0..2 {
        if least(&best) > EXPLAINED {
            break;
        }
        let columns = signals
            .outputs
            .columns
            .iter_mut()
            .chain(&mut signals.inputs.columns);
        columns.for_each(|c| *c = c.windows(2).map(|w| w[1] - w[0]).collect());
        let other = multiple_coherence(&signals, SEGMENTS).unwrap_or_default();
        for (i, explained) in other.explained.iter().enumerate() {
            if *explained > best.explained[i] {
                best.explained[i] = *explained;
                best.by_output[i].clone_from(&other.by_output[i]);
            }
        }
    }
    best
}

/// Non-overlapping segments of a record.
const SEGMENTS: usize = 16;

fn stats(role: &'static str, signals: &Signals) -> Vec<ChannelStats> {
    signals
        .names
        .iter()
        .zip(&signals.columns)
        .map(|(name, x)| {
            let (min, max) = range(x);
            let (m, rms) = (mean(x), standard_deviation(x));
            ChannelStats {
                role,
                name: name.clone(),
                min,
                max,
                rms,
                crest_factor: if rms > 0.0 {
                    (max - m).max(m - min) / rms
                } else {
                    0.0
                },
                resolution: resolution(x),
                near_nyquist: if rms > 0.0 { near_nyquist(x) } else { 0.0 },
            }
        })
        .collect()
}

/// A signal with more than one sample a value on average shows its converter.
fn resolution(x: &[f64]) -> Option<f64> {
    const SAMPLES_A_VALUE: usize = 4;
    let mut values = x.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() < 3 || values.len() * SAMPLES_A_VALUE > x.len() {
        return None;
    }
    let steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
    Some(lpv_numerics::statistics::median(&steps))
}

fn near_nyquist(x: &[f64]) -> f64 {
    if x.len() < 16 {
        return 0.0;
    }
    let m = mean(x);
    // A Hann window keeps what leaks from low frequencies out of the upper band.
    let n = x.len() as f64;
    let mut input: Vec<f64> = x
        .iter()
        .enumerate()
        .map(|(k, v)| (v - m) * (std::f64::consts::PI * k as f64 / n).sin().powi(2))
        .collect();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(input.len());
    let mut spectrum = plan.make_output_vec();
    if plan.process(&mut input, &mut spectrum).is_err() {
        return 0.0;
    }
    let power = |part: &[Complex<f64>]| part.iter().map(Complex::norm_sqr).sum::<f64>();
    let from = (0.8 * spectrum.len() as f64) as usize;
    power(&spectrum[from..]) / power(&spectrum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_kit::{PERIOD, PERIODS, two_periodic_records};

    #[test]
    fn figures_by_hand() {
        let x: Vec<f64> = (0..64).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!((near_nyquist(&x) - 1.0).abs() < 1e-9);
        let steps: Vec<f64> = (0..400).map(|k| 0.5 * f64::from(k % 10)).collect();
        assert_eq!(resolution(&steps), Some(0.5));
        let smooth: Vec<f64> = (0..400).map(f64::from).collect();
        assert_eq!(resolution(&smooth), None);
        let s = &stats("output", &Signals::new(&["y"], vec![vec![0.0, 4.0, 0.0, 0.0]]))[0];
        // Mean 1, rms sqrt(3), peak 3 above the mean.
        assert!((s.crest_factor - 3.0 / 3f64.sqrt()).abs() < 1e-12);
    }

    /// A period at a time, or all at once: the same figures, those of the channels from the last period.
    #[test]
    fn a_large_record_is_that_of_its_periods() {
        let (_folder, bundle) = two_periodic_records();
        let rate = bundle.description().sample_rate_hz;
        for i in (0..bundle.len()).filter(|i| bundle.description().records[*i].is_periodic()) {
            let whole = bundle.load(i).unwrap();
            let mut last = None;
            bundle.each_period(i, |part| last = Some(part)).unwrap();
            let expected = RecordInfo {
                channels: describe(&last.unwrap(), "a", rate).channels,
                ..describe(&whole, "a", rate)
            };
            assert_eq!(describe_large(&bundle, i, "a").unwrap(), expected);
            assert_eq!(expected.samples, PERIODS * PERIOD);
        }
    }
}
