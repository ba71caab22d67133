//! What the records of one place say together with its response.

use super::Finding;
use super::compare::Voice;
use super::saturation::saturation;
use super::watch::Look;
use experiment_data::Bundle;
use frf_estimation::PeriodicEstimate;
use lpv_core::num_complex::Complex;
use realfft::RealFftPlanner;

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
