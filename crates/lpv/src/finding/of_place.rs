//! What the records of one place say together with its response.

use super::Finding;
use super::compare::{Names, Voice, compare, is_known};
use super::saturation::saturation;
use super::watch::Look;
use experiment_data::Bundle;
use frf_estimation::PeriodicEstimate;
use lpv_core::FrfEstimate;
use lpv_core::num_complex::Complex;
use realfft::RealFftPlanner;

/// Responses of which one may stand apart: of three, an output that sees a mode shape change its sign looks like another sign.
const FEWEST: usize = 4;

/// Lines of a response that are compared between records.
const LINES: usize = 256;

/// Commands that an amplifier clips, of the records of one place.
pub(crate) fn saturations(bundle: &Bundle, looks: &[Look], estimate: &PeriodicEstimate) -> Vec<Finding> {
    let names = &bundle.description().channels.input.columns;
    let of = |look: &Look| {
        let [outputs, inputs, _] = &look.means;
        let [u] = inputs.as_slice() else { return None };
        let found = outputs
            .iter()
            .find_map(|y| saturation(u, y, &estimate.excited_lines))?;
        Some(Finding::CommandSaturates {
            record: look.record.clone(),
            column: names.first()?.clone(),
            level: found.level,
            percent: found.percent[0],
            smooth_percent: found.percent[1],
        })
    };
    looks.iter().filter_map(of).collect()
}

/// What responses that were measured elsewhere say against each other, input after input.
pub(crate) fn compare_measured(
    measured: &[(&str, &FrfEstimate)],
    outputs: &[String],
    inputs: &[String],
) -> Vec<Finding> {
    let mut found: Vec<Finding> = Vec::new();
    if measured.len() < FEWEST {
        return found;
    }
    for (j, input) in inputs.iter().enumerate() {
        let voices: Vec<Voice> = measured.iter().map(|(record, e)| voice(record, e, j)).collect();
        let names = Names {
            outputs,
            inputs: std::slice::from_ref(input),
        };
        for new in compare(&voices, &names) {
            // Two responses of one place are refused as such.
            let is_sure = matches!(new, Finding::RecordStandsApart { factor, .. } if is_known(factor));
            if is_sure && !found.iter().any(|f| f.place() == new.place()) {
                found.push(new);
            }
        }
    }
    found
}

/// What a response says of one input.
fn voice(record: &str, estimate: &FrfEstimate, input: usize) -> Voice {
    let frf = estimate.frf();
    let chosen: Vec<usize> = (0..frf.len()).step_by(frf.len().div_ceil(LINES).max(1)).collect();
    let outputs: Vec<Vec<Complex<f64>>> = (0..frf.outputs())
        .map(|i| chosen.iter().map(|k| frf.line(*k)[(i, input)]).collect())
        .collect();
    let deviation = |i: usize, k: usize| estimate.variance(k, i, input).sqrt();
    Voice {
        record: record.to_owned(),
        position: estimate.position().cloned(),
        frequencies_hz: chosen.iter().map(|k| frf.frequencies_hz()[*k]).collect(),
        inputs: vec![vec![Complex::from(1.0); chosen.len()]],
        references: Vec::new(),
        response: (0..chosen.len())
            .flat_map(|k| outputs.iter().map(move |y| y[k]))
            .collect(),
        noise: (0..frf.outputs())
            .map(|i| chosen.iter().map(|k| deviation(i, *k)).collect())
            .collect(),
        outputs,
    }
}

/// What the records of one place say at some of the lines of their response.
pub(crate) fn voices(looks: &[Look], estimate: &PeriodicEstimate) -> Vec<Voice> {
    let frf = estimate.estimate.frf();
    let count = frf.len();
    let chosen: Vec<usize> = (0..count).step_by(count.div_ceil(LINES).max(1)).collect();
    let (ny, nu) = (frf.outputs(), frf.inputs());
    let at = |x: &Vec<f64>| -> Vec<Complex<f64>> {
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(x.len());
        let (mut input, mut spectrum) = (x.clone(), plan.make_output_vec());
        if plan.process(&mut input, &mut spectrum).is_err() {
            return Vec::new();
        }
        let lines = chosen.iter().map(|k| estimate.excited_lines[*k]);
        lines.filter_map(|line| spectrum.get(line).copied()).collect()
    };
    let spectra: Vec<[Vec<Vec<Complex<f64>>>; 3]> = looks
        .iter()
        .map(|look| look.means.each_ref().map(|group| group.iter().map(at).collect()))
        .collect();
    let response: Vec<Complex<f64>> = chosen
        .iter()
        .flat_map(|k| {
            let line = frf.line(*k);
            (0..ny)
                .flat_map(|i| (0..nu).map(|j| line[(i, j)]).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        })
        .collect();
    // Noise in the mean of one record: the same in all of them.
    let noise: Vec<Vec<f64>> = (0..ny)
        .map(|i| {
            let of = |(l, k): (usize, &usize)| {
                let power = spectra
                    .iter()
                    .filter_map(|s| Some(s[0].get(i)?.get(l)?.norm_sqr()))
                    .sum::<f64>();
                let inputs = (0..nu)
                    .map(|j| 1.0 / estimate.input_snr[k * nu + j])
                    .fold(0.0, f64::max);
                (power / looks.len() as f64 * (1.0 / estimate.output_snr[k * ny + i] + inputs)).sqrt()
            };
            chosen.iter().enumerate().map(of).collect()
        })
        .collect();
    looks
        .iter()
        .zip(spectra)
        .map(|(look, [outputs, inputs, references])| Voice {
            record: look.record.clone(),
            position: estimate.estimate.position().cloned(),
            frequencies_hz: chosen.iter().map(|k| frf.frequencies_hz()[*k]).collect(),
            references: if references.len() == nu {
                references
            } else {
                Vec::new()
            },
            outputs,
            inputs,
            response: response.clone(),
            noise: noise.clone(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::Frf;
    use rand::{RngExt, SeedableRng};
    use std::f64::consts::TAU;

    /// A body on lever arms and two modes whose shapes bend along the stroke, at five positions.
    fn responses(seed: u64) -> Vec<FrfEstimate> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> f64 { rng.random_range(0.2..1.0) };
        let (arms, bends): (Vec<f64>, Vec<f64>) = (0..8).map(|_| (draw(), 2.0 * draw())).unzip();
        let lines: Vec<f64> = (1..200).map(f64::from).collect();
        let at = |p: f64| {
            let arm = |c: usize| 1.0 + 0.3 * p * arms[c];
            let shape = |m: usize, c: usize| (0.4 + bends[2 * m + c] * p).cos();
            let value = |f: f64, i: usize, j: usize| {
                let s = Complex::new(0.0, TAU * f);
                let mode = |m: usize| {
                    let w = TAU * [40.0, 120.0][m];
                    Complex::from(0.3 * shape(m, i) * shape(m, j)) / (s * s + s * (0.02 * w) + w * w)
                };
                Complex::from(arm(i) * arm(j)) / (s * s) + mode(0) + mode(1)
            };
            let values = lines
                .iter()
                .flat_map(|f| [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| value(*f, i, j)));
            let frf = Frf::new(lines.clone(), 2, 2, values.collect()).unwrap();
            FrfEstimate::with_unit_covariance(frf, Some(vec![p].into())).unwrap()
        };
        [-1.0, -0.5, 0.0, 0.5, 1.0].map(at).to_vec()
    }

    fn compared(estimates: &[FrfEstimate]) -> Vec<Finding> {
        let names = ["r0", "r1", "r2", "r3", "r4"];
        let channels = |c: &str| [format!("{c}1"), format!("{c}2")];
        let each: Vec<_> = names.into_iter().zip(estimates).collect();
        compare_measured(&each, &channels("y"), &channels("u"))
    }

    #[test]
    fn one_response_with_another_sign_or_unit_is_named() {
        for seed in 0..40 {
            let right = responses(seed);
            assert_eq!(compared(&right), [], "seed {seed}");
            for factor in [-1.0, 1e3, 1e-3] {
                let wrong = seed as usize % 5;
                let mut estimates = right.clone();
                let e = &right[wrong];
                let values = (0..e.frf().len()).flat_map(|k| {
                    let line = e.frf().line(k).into_owned();
                    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|at| line[at] * factor)
                });
                let frf = Frf::new(e.frf().frequencies_hz().to_vec(), 2, 2, values.collect()).unwrap();
                estimates[wrong] = FrfEstimate::with_unit_covariance(frf, e.position().cloned()).unwrap();
                let found = compared(&estimates);
                assert!(
                    found.iter().all(|f| f.place() == format!("r{wrong}")) && !found.is_empty(),
                    "seed {seed}, {factor}: {found:?}"
                );
            }
        }
    }
}
