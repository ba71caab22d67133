//! The period of a signal that repeats.

use super::RecordFile;
use lpv_core::num_complex::Complex;
use realfft::RealFftPlanner;
use std::collections::BTreeMap;

/// A signal repeats after T samples if `sum (x(t+T) - x(t))^2` is below this part of the power of both parts: of a command in a loop, which
/// has noise and a beginning, and of a reference, which repeats but for the digits or the converter that it went through.
#[derive(Debug, Clone, Copy)]
pub(super) enum Repeats {
    /// An input.
    Nearly,
    /// A reference.
    Exactly,
}

impl Repeats {
    fn limit(self) -> f64 {
        match self {
            Self::Nearly => 0.05,
            Self::Exactly => 1e-5,
        }
    }
}

/// How much worse twice the period may be than the period of a reference: noise makes no difference, waves that only nearly fit go on to part. An
/// input may die out or drift.
const TWICE: f64 = 2.0;

/// A lag is a period only after one that is none: a slow signal resembles itself a moment later.
const DIFFERS: f64 = 0.5;

/// Samples a period of a signal of at least two periods; none for anything else.
pub(super) fn period_of(signal: &[f64], repeats: Repeats) -> Option<usize> {
    let n = signal.len();
    if n < 8 || !signal.iter().all(|v| v.is_finite()) {
        return None;
    }
    let mean = lpv_numerics::statistics::mean(signal);
    let x: Vec<f64> = signal.iter().map(|v| v - mean).collect();
    let correlation = correlation(&x)?;
    // Energy of the first samples, so that those of both parts of a lag are known.
    let mut energy = vec![0.0; n + 1];
    for k in 0..n {
        energy[k + 1] = energy[k] + x[k] * x[k];
    }
    let difference = |lag: usize| {
        let both = energy[n - lag] + energy[n] - energy[lag];
        if both > 0.0 {
            (both - 2.0 * correlation[lag]) / both
        } else {
            1.0
        }
    };
    let first = (1..=n / 2).find(|&lag| difference(lag) > DIFFERS)?;
    let best = (first..=n / 2).min_by(|&a, &b| difference(a).total_cmp(&difference(b)))?;
    let least = difference(best);
    if least > repeats.limit() {
        return None;
    }
    // All multiples of the period repeat as well: the smallest that is as good.
    let limit = (2.0 * least).max(1e-9);
    let period = (first..=best).find(|&lag| difference(lag) <= limit && is_dip(&difference, lag, first))?;
    let is_exact = matches!(repeats, Repeats::Exactly);
    let parts = is_exact && 2 * period <= n / 2 && difference(2 * period) > TWICE * difference(period) + 1e-6;
    (!parts).then_some(period)
}

/// Whether an output may have a period: the means of its periods differ, beside a slow drift, by no more than the output moves in one.
pub(super) fn goes_with(output: &[f64], period: usize) -> bool {
    let periods: Vec<&[f64]> = output.chunks_exact(period).collect();
    let count = periods.len() as f64;
    if count < 3.0 {
        return true;
    }
    let means: Vec<f64> = periods
        .iter()
        .map(|x| lpv_numerics::statistics::mean(x))
        .collect();
    let middle = lpv_numerics::statistics::mean(&means);
    let at = |k: usize| k as f64 - 0.5 * (count - 1.0);
    let sum = |of: &dyn Fn(usize) -> f64| (0..means.len()).map(of).sum::<f64>();
    let slope = sum(&|k| at(k) * means[k]) / sum(&|k| at(k) * at(k));
    let between = sum(&|k| (means[k] - middle - slope * at(k)).powi(2)) / count;
    let within =
        sum(&|k| periods[k].iter().map(|x| (x - means[k]).powi(2)).sum::<f64>()) / (count * period as f64);
    between <= within
}

/// Takes periods back that are not the one of most records, at least of two: one excitation has one period, and moves resemble themselves after
/// another time in every record. What is said of it.
pub(super) fn agree(records: &mut [RecordFile]) -> Option<String> {
    let mut counts = BTreeMap::new();
    for period in records.iter().filter_map(|r| r.period) {
        *counts.entry(period).or_insert(0) += 1;
    }
    let most = counts.values().copied().max().unwrap_or(0);
    let mut leading = counts.iter().filter(|(_, count)| **count == most && most > 1);
    // Two that lead leave it open which is that of the excitation.
    let common = match (leading.next(), leading.next()) {
        (Some((period, _)), None) => Some(*period),
        _ => None,
    };
    let others = || counts.keys().filter(|p| Some(**p) != common);
    let (shortest, longest) = (others().min()?, others().max()?);
    if common.is_none() && shortest == longest {
        return None;
    }
    records
        .iter_mut()
        .filter(|r| r.period != common)
        .for_each(|r| r.period = None);
    let after = match shortest == longest {
        true => shortest.to_string(),
        false => format!("{shortest} to {longest}"),
    };
    Some(format!(
        "records that repeat after {after} samples are taken for moves: one excitation has one period in all records; \
         if they are periodic, write `kind` and `period`, and estimate each period apart"
    ))
}

/// Whether a lag is better than its neighbours.
fn is_dip(difference: &impl Fn(usize) -> f64, lag: usize, first: usize) -> bool {
    let here = difference(lag);
    (lag == first || difference(lag - 1) >= here) && difference(lag + 1) >= here
}

/// `sum_t x(t) x(t + lag)` for all lags up to half the length.
fn correlation(x: &[f64]) -> Option<Vec<f64>> {
    let length = (2 * x.len()).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let mut input = forward.make_input_vec();
    input[..x.len()].copy_from_slice(x);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut input, &mut spectrum).ok()?;
    for s in &mut spectrum {
        *s = Complex::new(s.norm_sqr() / length as f64, 0.0);
    }
    let mut output = back.make_output_vec();
    back.process(&mut spectrum, &mut output).ok()?;
    output.truncate(x.len() / 2 + 2);
    Some(output)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A command that fights a disturbance repeats; the moves that go with it do not.
    #[test]
    fn moves_under_a_periodic_command_have_no_period() {
        let command = multisine(78, 1997, 1);
        let wave: Vec<f64> = command.iter().map(|u| 1e-4 * u).collect();
        let moves: Vec<f64> = (0..1997)
            .map(|t| (1e-3 * t as f64).sin() + (2.7e-3 * t as f64).cos())
            .collect();
        let both: Vec<f64> = wave.iter().zip(&moves).map(|(a, b)| a + b).collect();
        let drifting: Vec<f64> = wave
            .iter()
            .enumerate()
            .map(|(t, y)| y + 1e-2 * t as f64)
            .collect();
        assert_eq!(period_of(&command, Repeats::Exactly), Some(78));
        assert!(goes_with(&wave, 78) && goes_with(&drifting, 78) && goes_with(&[1.0; 1997], 78));
        assert!(!goes_with(&both, 78));
    }

    fn multisine(period: usize, samples: usize, highest: usize) -> Vec<f64> {
        (0..samples)
            .map(|t| {
                (1..=highest)
                    .map(|k| {
                        let phase = (k * k * 7) as f64;
                        (std::f64::consts::TAU * (k * (t % period)) as f64 / period as f64 + phase).cos()
                    })
                    .sum()
            })
            .collect()
    }

    fn noise(samples: usize) -> Vec<f64> {
        let mut seed = 1u64;
        (0..samples)
            .map(|_| {
                seed = seed
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .collect()
    }

    proptest! {
        #[test]
        fn multisines_with_noise_have_their_period(period in 40usize..500, periods in 2usize..6, rest in 0usize..30, highest in 3usize..15) {
            let mut x = multisine(period, period * periods + rest, highest);
            for (v, e) in x.iter_mut().zip(noise(period * periods + rest)) {
                *v += 0.02 * e;
            }
            prop_assert_eq!(period_of(&x, Repeats::Nearly), Some(period));
        }
    }

    #[test]
    fn moves_and_noise_have_none() {
        let ramp: Vec<f64> = (0..1000).map(f64::from).collect();
        for signal in [&ramp[..], &noise(1000), &[0.0; 100], &[1.0, 2.0]] {
            assert_eq!(period_of(signal, Repeats::Nearly), None);
        }
    }

    proptest! {
        /// A few waves whose common period is longer than the record nearly repeat after some time, and do not.
        #[test]
        fn waves_that_only_nearly_fit_have_none(ratio in 2.1f64..9.0, part in 0.05f64..1.0, samples in 800usize..4000) {
            let apart = (ratio - ratio.round()).abs();
            // Least error of a lag that shares the phase out between both waves.
            let squares = (1.0 + part * part) * (1.0 + (part * ratio).powi(2));
            prop_assume!((std::f64::consts::TAU * apart * part).powi(2) / squares > 1e-4);
            let x: Vec<f64> = (0..samples)
                .map(|t| {
                    let turn = 2.4 * std::f64::consts::TAU * t as f64 / samples as f64;
                    turn.sin() + part * (ratio * turn).sin()
                })
                .collect();
            prop_assert_eq!(period_of(&x, Repeats::Exactly), None);
        }
    }
}
