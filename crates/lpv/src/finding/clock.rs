//! A column of times or sample numbers that is kept beside the signals: does it advance evenly?

use crate::new::seconds;
use crate::signal::steps_of_counter;
use lpv_numerics::statistics::{median, quantile};

/// What a column of times says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Uneven {
    /// So many samples are missing, the first behind this sample (from 0).
    Lost { samples: usize, behind: usize },
    /// It stands still or goes back, first behind this sample.
    Back { times: usize, behind: usize },
}

/// Words of which one is the name of a column of times or sample numbers, or the beginning of it before a bracket, blank or
/// underscore.
const NAMES: [&str; 22] = [
    "t",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "zeit",
    "zeitstempel",
    "temps",
    "tid",
    "tijd",
    "tiempo",
    "clock",
    "sample",
    "samples",
    "index",
    "idx",
    "counter",
    "count",
    "k",
    "n",
    "nr",
    "no",
];

/// Whether a column is one of times or sample numbers by its name.
pub(super) fn is_clock(name: &str) -> bool {
    let name = name.to_lowercase();
    let ends = |c: char| !c.is_alphanumeric();
    let last = name.rsplit('.').find(|part| !part.is_empty()).unwrap_or("");
    let word = last.split(ends).find(|part| !part.is_empty()).unwrap_or("");
    NAMES.contains(&word)
        || matches!(
            last,
            "sampleno" | "samplenumber" | "sample_number" | "t_s" | "t_ms"
        )
}

/// The rate of a column of times in this unit, where it is another one than that of the samples.
pub(super) fn other_rate(t: &[f64], unit: Option<&str>, sample_rate: f64) -> Option<f64> {
    /// Part by which the rates may differ.
    const ALIKE: f64 = 0.01;
    let seconds = seconds(unit?)?;
    let steps = steps_of_counter(t, None);
    // Of many, the mean: a coarse clock tells no single step.
    let step = (steps.len() >= 4 * SPAN).then(|| steps.iter().sum::<f64>() / steps.len() as f64)?;
    let hz = 1.0 / (seconds * step);
    (step > 0.0 && (hz / sample_rate - 1.0).abs() > ALIKE).then_some(hz)
}

/// Samples over which a step is averaged: a coarse clock counts some samples alike.
const SPAN: usize = 16;
/// Scatter of a span, in samples, up to which a missing sample can be seen.
const JITTER: f64 = 0.3;

/// Whether samples are missing or double; none for a clock too coarse to tell.
pub(super) fn uneven(t: &[f64]) -> Option<Uneven> {
    if t.len() < 4 * SPAN {
        return None;
    }
    // A time of day goes on after midnight.
    let steps = steps_of_counter(t, Some(86_400.0));
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(steps.iter().scan(0.0, |at, d| {
            *at += d;
            Some(*at)
        }))
        .collect();
    let over: Vec<f64> = (0..t.len() - SPAN).map(|k| sums[k + SPAN] - sums[k]).collect();
    let step = median(&over) / SPAN as f64;
    if step.is_nan() || step <= 0.0 {
        return None;
    }
    // A clock that repeats regularly is coarse; one that is as even as its samples shows each of them.
    let even = steps.iter().filter(|d| (*d / step - 1.0).abs() < JITTER).count();
    if 10 * even >= 9 * steps.len() {
        let back = |d: &f64| *d < 0.5 * step;
        let missing = |d: &f64| (d / step - 1.0).round().max(0.0);
        // A late time stamp is made up by the next; a missing sample is not.
        let (mut lost, mut times, mut first_lost, mut first_back) = (0.0, 0, None, None);
        for (k, d) in steps.iter().enumerate() {
            let later = steps.get(k + 1).copied().unwrap_or(step);
            let before = k.checked_sub(1).map_or(step, |k| steps[k]);
            let made_up = (d + later - 2.0 * step)
                .abs()
                .min((d + before - 2.0 * step).abs())
                < 2.0 * JITTER * step;
            if missing(d) > 0.0 && !made_up {
                lost += missing(d);
                first_lost.get_or_insert(k);
            } else if back(d) && !made_up {
                times += 1;
                first_back.get_or_insert(k);
            }
        }
        return match (first_lost, first_back) {
            (Some(behind), _) => Some(Uneven::Lost {
                samples: lost as usize,
                behind,
            }),
            (None, Some(behind)) => Some(Uneven::Back { times, behind }),
            _ => None,
        };
    }
    let scatter: Vec<f64> = over.iter().map(|d| (d / step - SPAN as f64).abs()).collect();
    if quantile(&scatter, 0.9) > JITTER {
        return None;
    }
    // Coarse: what a span gains on the others and does not give back.
    let (mut lost, mut first) = (0.0, None);
    for k in (0..over.len()).step_by(SPAN) {
        let gain = (over[k] / step - SPAN as f64).round();
        if gain >= 1.0 {
            lost += gain;
            first.get_or_insert(k);
        }
    }
    first.map(|behind| Uneven::Lost {
        samples: lost as usize,
        behind,
    })
}

#[cfg(test)]
mod tests {
    use super::super::kit::Random;
    use super::*;

    #[test]
    fn names_of_clocks() {
        for name in [
            "t",
            "Time",
            "time_s",
            "t [ms]",
            "log.time",
            "Zeit (s)",
            "sample",
            "SampleNumber",
            "k",
            "timestamp",
        ] {
            assert!(is_clock(name), "{name}");
        }
        for name in ["torque", "temperature", "y", "position", "tau", "i1", "counts.y"] {
            assert!(!is_clock(name), "{name}");
        }
    }

    #[test]
    fn lost_samples_are_counted_whatever_the_unit_and_the_jitter() {
        for seed in 0..60 {
            let mut random = Random::new(seed);
            let step = random.decades(6.0);
            let jitter = random.between(0.0, 0.1);
            let start = 1e3 * step * random.between(-1.0, 1.0);
            let gone: Vec<usize> = (0..1 + seed as usize % 5)
                .map(|i| 300 + 700 * i + (seed as usize * 37) % 200)
                .collect();
            let t: Vec<f64> = (0..5000)
                .filter(|k| !gone.contains(k))
                .map(|k| start + step * (k as f64 + jitter * random.between(-1.0, 1.0)))
                .collect();
            let found = uneven(&t);
            let expected = Some(Uneven::Lost {
                samples: gone.len(),
                behind: gone[0] - 1,
            });
            assert_eq!(found, expected, "{seed}");
            let mut double = t.clone();
            double.truncate(200);
            double.insert(100, double[100]);
            assert_eq!(
                uneven(&double),
                Some(Uneven::Back {
                    times: 1,
                    behind: 100
                })
            );
        }
    }

    #[test]
    fn the_rate_of_a_clock_is_held_against_that_of_the_samples() {
        for rate in [0.5, 40.0, 2e3, 1.7e5] {
            for (unit, scale) in [("s", 1.0), ("ms", 1e3), ("us", 1e6)] {
                let t: Vec<f64> = (0..500).map(|k| 7.0 + scale * f64::from(k) / rate).collect();
                assert_eq!(other_rate(&t, Some(unit), rate), None);
                let found = other_rate(&t, Some(unit), 2.0 * rate).unwrap();
                assert!((found / rate - 1.0).abs() < 1e-6, "{found} {rate}");
                assert_eq!(other_rate(&t, None, 2.0 * rate), None);
            }
        }
    }

    #[test]
    fn counters_that_start_again_are_even() {
        for (full, step) in [(256.0, 1.0), (65_536.0, 500.0), (4_294_967_296.0, 250_000.0)] {
            let t: Vec<f64> = (0..40_000)
                .map(|k| (0.9 * full + step * f64::from(k)) % full)
                .map(f64::floor)
                .collect();
            assert_eq!(uneven(&t), None, "{full}");
        }
    }

    #[test]
    fn even_clocks_are_even() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(900 + seed);
            let step = random.decades(6.0);
            let jitter = random.between(0.0, 0.14);
            let fine: Vec<f64> = (0..3000)
                .map(|k| step * (f64::from(k) + jitter * random.between(-1.0, 1.0)))
                .collect();
            // Milliseconds of samples that come faster or slower than that, rounded.
            let faster = random.between(0.05, 20.0);
            let coarse: Vec<f64> = (0..3000).map(|k| (f64::from(k) * faster).floor()).collect();
            let mut late = fine.clone();
            late[1500] += 0.8 * step;
            alarms += [fine, coarse, late]
                .iter()
                .filter(|t| uneven(t).is_some())
                .count();
        }
        assert!(alarms <= 6, "{alarms} of 600");
    }
}
