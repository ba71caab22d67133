//! Records without periods against each other: one of several with another sign or unit.
//!
//! The response of a record is that of averaged cross spectra (Welch) of first differences, which take drifts out of input and output
//! alike; with a reference that moves it is the instrument. Only lines on which the record is coherent count.

use super::Finding;
use super::compare::{Names, named};
use lpv_core::num_complex::Complex;
use lpv_core::{Record, RecordKind};
use lpv_numerics::statistics::{median, quantile, standard_deviation};
use realfft::RealFftPlanner;
use std::f64::consts::TAU;

type C64 = Complex<f64>;

/// Samples of a segment.
const SEGMENT: usize = 128;
/// Fewest segments, which overlap by half.
const FEWEST: usize = 6;
/// Squared coherence of a line that counts, and fewest such lines that two records share.
const COHERENT: f64 = 0.6;
const LINES: usize = 6;
/// Cosine of the angle beyond which a sign is another one, or the same.
const SURE: f64 = 0.9;
/// Factor that no machine makes: friction and stiffening change a response by less.
const FACTOR: f64 = 20.0;
/// Half the distance between the quartiles of the logarithms of the ratios of two records, line by line, that have one factor between
/// them; and what the deviation of a line, which is that of the noise, adds to it.
const EVEN: f64 = 0.1;
const DEVIATIONS: f64 = 1.5;
/// Records whose signals differ by more say nothing of a sign: what rests shows its controller.
const ALIKE: f64 = 5.0;

/// The response of a record by output, then by line; none on lines that are not coherent.
#[derive(Debug, Clone)]
pub(super) struct Spectrum {
    record: String,
    /// Standard deviations of outputs, then of the input.
    sizes: Vec<f64>,
    responses: Vec<Vec<Option<C64>>>,
    /// Relative deviation of a typical line by output, as its coherence tells.
    deviations: Vec<f64>,
}

/// The response of a transient record with one input and without scheduling, over which a gain may change its sign.
pub(super) fn spectrum(record: &Record) -> Option<Spectrum> {
    let ([u], true) = (
        record.inputs.columns.as_slice(),
        record.scheduling.columns.is_empty(),
    ) else {
        return None;
    };
    let moves = |x: &&Vec<f64>| x.iter().any(|v| *v != x[0]);
    let reference = record.references.columns.first().filter(moves);
    if record.kind != RecordKind::Transient || u.len() < SEGMENT / 2 * (FEWEST + 1) + 1 {
        return None;
    }
    let own = transforms(u, 1);
    let instrument = reference.map_or_else(|| own.clone(), |r| transforms(r, 1));
    let input_leaks = leaks(u, &own);
    let of_input = cross(&own, &instrument);
    let powers = [power(&own), power(&instrument)];
    let mut deviations = Vec::new();
    let responses = record.outputs.columns.iter().map(|y| {
        let output = transforms(y, 1);
        let output_leaks = leaks(y, &output);
        let power = power(&output);
        let mut noise = Vec::new();
        let line = |(k, y): (usize, C64)| {
            let coherence = |c: C64, p: f64| c.norm_sqr() / (p * powers[1][k]);
            let both = [coherence(y, power[k]), coherence(of_input[k], powers[0][k])];
            let good = both.iter().all(|c| *c > COHERENT) && !input_leaks[k] && !output_leaks[k];
            if good {
                let lost: f64 = both.iter().map(|c| (1.0 - c).max(0.0) / c).sum();
                noise.push((0.5 * lost / own.len() as f64).sqrt());
            }
            good.then(|| y / of_input[k])
                .filter(|h| h.is_finite() && h.norm() > 0.0)
        };
        let lines: Vec<Option<C64>> = cross(&output, &instrument)
            .into_iter()
            .enumerate()
            .map(line)
            .collect();
        deviations.push(median(&noise));
        lines
    });
    Some(Spectrum {
        responses: responses.collect(),
        deviations,
        sizes: record
            .outputs
            .columns
            .iter()
            .chain([u])
            .map(|x| standard_deviation(x))
            .collect(),
        record: record.name.clone(),
    })
}

/// Lines on which a signal has little more than what leaks from the others: under a window that falls off faster it has much less there.
fn leaks(x: &[f64], of_x: &[Vec<C64>]) -> Vec<bool> {
    /// Factor of the power.
    const LESS: f64 = 4.0;
    let narrow = power(&transforms(x, 2));
    let pairs = power(of_x).into_iter().zip(narrow);
    pairs.map(|(wide, narrow)| wide > LESS * narrow).collect()
}

/// Transforms of the segments of first differences, under a power of a Hann window of unit energy; without the mean.
fn transforms(x: &[f64], window_power: i32) -> Vec<Vec<C64>> {
    let differences: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(SEGMENT);
    let hann = |k: usize| (0.5 - 0.5 * (TAU * k as f64 / SEGMENT as f64).cos()).powi(window_power);
    let size = (0..SEGMENT).map(|k| hann(k).powi(2)).sum::<f64>().sqrt();
    let window: Vec<f64> = (0..SEGMENT).map(|k| hann(k) / size).collect();
    let mut all = Vec::new();
    for segment in differences.windows(SEGMENT).step_by(SEGMENT / 2) {
        let mut input: Vec<f64> = segment.iter().zip(&window).map(|(v, w)| v * w).collect();
        let mut lines = plan.make_output_vec();
        if plan.process(&mut input, &mut lines).is_ok() {
            all.push(lines[1..SEGMENT / 2].to_vec());
        }
    }
    all
}

fn cross(a: &[Vec<C64>], b: &[Vec<C64>]) -> Vec<C64> {
    let lines = 0..SEGMENT / 2 - 1;
    lines
        .map(|k| a.iter().zip(b).map(|(a, b)| a[k] * b[k].conj()).sum())
        .collect()
}

fn power(a: &[Vec<C64>]) -> Vec<f64> {
    cross(a, a).into_iter().map(|v| v.re).collect()
}

/// Records whose sign or unit is not that of the others.
pub(super) fn odd_ones(all: &[&Spectrum], names: &Names<'_>) -> Vec<Finding> {
    let mut found: Vec<Finding> = Vec::new();
    for i in 0..all.first().map_or(0, |s| s.responses.len()) {
        let factors: Vec<Option<f64>> = (0..all.len()).map(|e| factor(all, e, i)).collect();
        let odd: Vec<usize> = (0..all.len()).filter(|e| factors[*e].is_some()).collect();
        // Of two, the later one is named; of more, the others must agree.
        let odd = match (all.len(), odd.as_slice()) {
            (2, [_, second]) => vec![*second],
            (n, odd) if 2 * odd.len() < n => odd.to_vec(),
            _ => Vec::new(),
        };
        for e in odd {
            let record = all[e].record.clone();
            if let (Some(factor), false) = (factors[e], found.iter().any(|f| f.place() == record)) {
                found.push(Finding::RecordStandsApart {
                    record,
                    column: names.outputs.get(i).cloned().unwrap_or_default(),
                    factor: named(factor),
                    records: all.len(),
                    sure: false,
                });
            }
        }
    }
    found
}

/// How an output of a record stands to that of the others, if not as they do.
fn factor(all: &[&Spectrum], e: usize, i: usize) -> Option<f64> {
    let others: Vec<&&Spectrum> = all
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != e)
        .map(|(_, s)| s)
        .collect();
    let ratios: Vec<C64> = (0..SEGMENT / 2 - 1)
        .filter_map(|k| {
            let of_others: Vec<C64> = others.iter().filter_map(|s| s.responses[i][k]).collect();
            let part = |f: fn(&C64) -> f64| median(&of_others.iter().map(f).collect::<Vec<_>>());
            let ratio = all[e].responses[i][k]? / C64::new(part(|v| v.re), part(|v| v.im));
            (2 * of_others.len() > others.len() && ratio.is_finite() && ratio.norm() > 0.0).then_some(ratio)
        })
        .collect();
    if ratios.len() < LINES {
        return None;
    }
    let size = median(&ratios.iter().map(|r| r.norm()).collect::<Vec<_>>());
    let cosine = median(&ratios.iter().map(|r| r.re / r.norm()).collect::<Vec<_>>());
    let far = |x: f64, most: f64| x.ln().abs() > most.ln();
    let is_as_large = || {
        let typical = |c: usize| median(&others.iter().map(|s| s.sizes[c]).collect::<Vec<_>>());
        let last = all[e].sizes.len() - 1;
        [i, last]
            .iter()
            .all(|c| !far(all[e].sizes[*c] / typical(*c), ALIKE))
    };
    // Another unit is the same on all lines; two motions with little but leakage on theirs have another ratio on each.
    let logarithms: Vec<f64> = ratios.iter().map(|r| r.norm().ln()).collect();
    let spread = 0.5 * (quantile(&logarithms, 0.75) - quantile(&logarithms, 0.25));
    let noise = all.iter().map(|s| s.deviations[i]).fold(0.0, f64::max);
    if spread > EVEN + DEVIATIONS * noise {
        return None;
    }
    let is_turned = cosine < -SURE && !far(size, ALIKE) && is_as_large();
    (is_turned || cosine.abs() > SURE && far(size, FACTOR)).then(|| size * cosine.signum())
}

#[cfg(test)]
mod tests {
    use super::super::kit::{self, Plant, Random};
    use super::*;

    fn records(random: &mut Random, count: usize, noise: f64) -> Vec<Record> {
        let plant = Plant::machine(
            random.between(0.02, 0.2),
            random.between(0.01, 0.2),
            [0.9, 0.8],
            random.decades(9.0),
        );
        let size = random.decades(6.0);
        (0..count)
            .map(|k| {
                let samples = 10f64.powf(random.between(2.9, 3.7)) as usize;
                let own = size * random.decades(0.3);
                let u = random.noise(samples, own);
                let mut y = plant.open(&u);
                let noise = noise * standard_deviation(&y);
                y.iter_mut().for_each(|y| *y += noise * random.normal());
                Record {
                    name: format!("r{k}"),
                    ..kit::record(None, &[], &u, &y)
                }
            })
            .collect()
    }

    fn found(records: &[Record]) -> Vec<(String, f64)> {
        let all: Vec<Spectrum> = records.iter().filter_map(spectrum).collect();
        let names = Names {
            outputs: &["y".to_owned()],
            inputs: &["u".to_owned()],
        };
        let findings = odd_ones(&all.iter().collect::<Vec<_>>(), &names);
        findings
            .into_iter()
            .filter_map(|f| match f {
                Finding::RecordStandsApart { record, factor, .. } => Some((record, factor)),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn a_sign_and_a_unit_of_one_record_are_told() {
        let mut found_in = 0;
        for seed in 0..60 {
            let mut random = Random::new(seed);
            let count = 2 + seed as usize % 4;
            let noise = 10f64.powf(random.between(-4.0, -1.0));
            let mut all = records(&mut random, count, noise);
            assert_eq!(found(&all), Vec::new(), "seed {seed}");
            let factor = [-1.0, 1e3, 1e-3, -1e6, 57.295_779_5][seed as usize % 5];
            let wrong = if count == 2 { 1 } else { seed as usize % count };
            all[wrong].outputs.columns[0]
                .iter_mut()
                .for_each(|y| *y *= factor);
            for (record, told) in found(&all) {
                assert_eq!(record, format!("r{wrong}"), "seed {seed}");
                assert!(
                    (told / factor - 1.0).abs() < 0.01,
                    "seed {seed}: {told} for {factor}"
                );
                found_in += 1;
            }
        }
        // The others have too few lines above the noise.
        assert!(found_in >= 50, "{found_in} of 60");
    }

    /// A mass that follows a sine, or goes there and back at one speed, read on a grid: no line of the sine is excited.
    #[test]
    fn moves_of_several_kinds_have_one_unit() {
        for seed in 0..60 {
            let mut random = Random::new(seed + 7000);
            let (mass, size) = (random.decades(6.0), random.decades(6.0));
            let grid = size / 10f64.powf(random.between(3.0, 6.0));
            let samples = 4000;
            let all: Vec<Record> = (0..4)
                .map(|k| {
                    let period = random.between(300.0, 1500.0);
                    let ramp = random.between(0.05, 0.2);
                    let acceleration: Vec<f64> = (0..samples)
                        .map(|i| (f64::from(i) / period).fract())
                        .map(|t| match k {
                            0 => (TAU * t).cos(),
                            _ if t < ramp || t > 1.0 - ramp => 1.0,
                            _ if (t - 0.5).abs() < ramp => -1.0,
                            _ => 0.0,
                        })
                        .collect();
                    let (mut x, mut v) = (0.0, 0.0);
                    let x: Vec<f64> = acceleration
                        .iter()
                        .map(|a| {
                            let now = x;
                            x += v + 0.5 * a;
                            v += a;
                            now
                        })
                        .collect();
                    let largest = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                    let to = size / largest;
                    let u: Vec<f64> = acceleration.iter().map(|a| mass * to * a).collect();
                    let y: Vec<f64> = x.iter().map(|x| (to * x / grid).round() * grid).collect();
                    kit::record(None, &[], &u, &y)
                })
                .collect();
            assert_eq!(found(&all), Vec::new(), "seed {seed}");
        }
    }

    #[test]
    fn machines_that_differ_and_noise_are_not_signs() {
        for seed in 0..60 {
            let mut random = Random::new(seed + 900);
            // Other machines of the same gain at rest, noise without any response, and a loop at rest that shows its controller.
            let mut all = records(&mut random, 3, 0.05);
            let u = random.noise(1000, 1.0);
            let y = random.noise(1000, 1.0);
            all[1] = kit::record(None, &[], &u, &y);
            assert_eq!(found(&all), Vec::new(), "seed {seed}");
            let size = standard_deviation(&all[0].inputs.columns[0]);
            let rest: Vec<f64> = random.noise(1000, 1e-3 * size);
            let answer: Vec<f64> = rest.iter().map(|y| -0.7 * y).collect();
            all[1] = kit::record(None, &[], &answer, &rest);
            let told = found(&all);
            assert!(
                told.iter().all(|(_, factor)| factor.abs() != 1.0),
                "seed {seed}: {told:?}"
            );
        }
    }
}
