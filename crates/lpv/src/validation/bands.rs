//! The frozen error band by band, in percent of the response and in multiples of its noise.

use lpv_core::{Frf, FrfEstimate};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Error of the frozen model in a band of frequencies, all positions together.
///
/// All figures are relative and by output, so that the units of outputs and inputs do not matter; the worst output counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Band {
    /// Lowest line, Hz.
    pub low_hz: f64,
    /// Highest line, Hz.
    pub high_hz: f64,
    /// Root of the power of the error over that of the response, percent.
    pub error_percent: f64,
    /// The same of the stated noise of the response, or of the assumed one.
    pub noise_percent: f64,
    /// Root mean square over lines and outputs of the error over its stated standard deviation; 1 says nothing but noise. None where
    /// the noise of a response is assumed.
    pub over_noise: Option<f64>,
}

/// Bands an octave, as long as each holds enough lines.
const BANDS_PER_OCTAVE: f64 = 2.0;

/// Lines that a band holds at least.
const LEAST_LINES: usize = 6;

/// Lines on either side whose noise steadies that of one line, which few periods hardly tell.
const NEIGHBOURS: usize = 2;

/// One line of one output.
struct Cell {
    frequency_hz: f64,
    output: usize,
    error: f64,
    size: f64,
    noise: f64,
    steady_noise: f64,
}

/// The bands of models against the estimates that they are compared with, response by response, lowest first.
pub(crate) fn bands(model: &[Frf], estimates: &[FrfEstimate]) -> Vec<Band> {
    let scale = input_scale(estimates);
    let mut cells: Vec<Cell> = model
        .iter()
        .zip(estimates)
        .flat_map(|(g, e)| cells(g, e, &scale))
        .collect();
    cells.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut found: Vec<Band> = Vec::new();
    let least = LEAST_LINES * estimates.len() * estimates.first().map_or(1, |e| e.frf().outputs());
    let mut rest = cells.as_slice();
    while let Some(first) = rest.first() {
        let edge = first.frequency_hz.max(f64::MIN_POSITIVE) * 2f64.powf(1.0 / BANDS_PER_OCTAVE);
        let within = rest.partition_point(|c| c.frequency_hz < edge).max(least);
        // What would be left for a last band is too little for one of its own.
        let end = if within + least > rest.len() {
            rest.len()
        } else {
            // Cells of one line stay together.
            let last = rest[within - 1].frequency_hz;
            rest.partition_point(|c| c.frequency_hz <= last)
        };
        let assumed = estimates.iter().any(FrfEstimate::covariance_is_assumed);
        found.extend(band(&rest[..end]).map(|b| Band {
            over_noise: b.over_noise.filter(|_| !assumed),
            ..b
        }));
        rest = &rest[end..];
    }
    found
}

fn band(cells: &[Cell]) -> Option<Band> {
    let outputs = cells.iter().map(|c| c.output).max()? + 1;
    let percent = |of: fn(&Cell) -> f64| {
        let share = |output: usize| {
            let (mut part, mut size) = (0.0, 0.0);
            for c in cells.iter().filter(|c| c.output == output) {
                part += of(c);
                size += c.size;
            }
            if size > 0.0 { (part / size).sqrt() } else { 0.0 }
        };
        crate::signal::finite(100.0 * (0..outputs).map(share).fold(0.0, f64::max))
    };
    let ratio = |c: &Cell| match c.error {
        0.0 => 0.0,
        error => error / c.noise.max(c.steady_noise),
    };
    let mean = cells.iter().map(ratio).sum::<f64>() / cells.len() as f64;
    Some(Band {
        low_hz: cells.first()?.frequency_hz,
        high_hz: cells.last()?.frequency_hz,
        error_percent: percent(|c| c.error),
        noise_percent: percent(|c| c.noise),
        over_noise: Some(crate::signal::finite(mean.sqrt())),
    })
}

/// Error, size and noise of every line and output, as powers summed over scaled inputs.
fn cells(model: &Frf, estimate: &FrfEstimate, scale: &[f64]) -> Vec<Cell> {
    let frf = estimate.frf();
    let (outputs, lines) = (frf.outputs(), frf.len());
    let sum =
        |f: &dyn Fn(usize) -> f64| -> f64 { (0..scale.len()).map(|j| f(j) / (scale[j] * scale[j])).sum() };
    let mut all = Vec::with_capacity(outputs * lines);
    for output in 0..outputs {
        let noise: Vec<f64> = (0..lines)
            .map(|k| {
                let row = estimate.output_covariance(k)[(output, output)].re.max(0.0);
                let inputs = estimate.input_factor(k);
                row * sum(&|j| inputs[(j, j)].re.max(0.0))
            })
            .collect();
        for k in 0..lines {
            let (f, g) = (frf.line(k), model.line(k));
            let near = &noise[k.saturating_sub(NEIGHBOURS)..(k + NEIGHBOURS + 1).min(lines)];
            all.push(Cell {
                frequency_hz: frf.frequencies_hz()[k],
                output,
                error: sum(&|j| (g[(output, j)] - f[(output, j)]).norm_sqr()),
                size: sum(&|j| f[(output, j)].norm_sqr()),
                noise: noise[k],
                steady_noise: lpv_numerics::statistics::median(near),
            });
        }
    }
    all
}

/// The size of each input's column of the response relative to the others, whatever the units of outputs and inputs: the column
/// effects of the logarithms of the channels' root mean squares.
fn input_scale(estimates: &[FrfEstimate]) -> Vec<f64> {
    let Some(first) = estimates.first() else {
        return Vec::new();
    };
    let (outputs, inputs) = (first.frf().outputs(), first.frf().inputs());
    let channel = |i: usize, j: usize| -> f64 {
        let powers = estimates
            .iter()
            .flat_map(|e| e.frf().channel(i, j).map(|v| v.norm_sqr()));
        powers.sum::<f64>().max(f64::MIN_POSITIVE).sqrt().ln()
    };
    let columns: Vec<f64> = (0..inputs)
        .map(|j| (0..outputs).map(|i| channel(i, j)).sum::<f64>() / outputs as f64)
        .collect();
    let mean = columns.iter().sum::<f64>() / inputs as f64;
    columns.iter().map(|c| (c - mean).exp()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::num_complex::Complex;

    /// A response of one mode with a stated deviation, and a model that misses it by `error` between two frequencies.
    fn pair(deviation: f64, error: f64, [low, high]: [f64; 2], units: f64) -> (Frf, FrfEstimate) {
        let lines: Vec<f64> = (1..=400).map(f64::from).collect();
        let value = |f: &f64| units * 1e4 / Complex::new(1e4 - f * f, 0.04 * 100.0 * f);
        let truth: Vec<_> = lines.iter().map(value).collect();
        let missed = lines
            .iter()
            .map(|f| value(f) * if (low..high).contains(f) { 1.0 + error } else { 1.0 })
            .collect();
        let covariance = truth
            .iter()
            .map(|v| Complex::from((deviation * v.norm()).powi(2)))
            .collect();
        let frf = Frf::new(lines.clone(), 1, 1, truth).unwrap();
        let estimate = FrfEstimate::new(frf, covariance, vec![Complex::from(1.0); 400], 12.0, None).unwrap();
        (Frf::new(lines, 1, 1, missed).unwrap(), estimate)
    }

    #[test]
    fn an_error_is_found_in_its_band_whatever_the_unit() {
        for units in [1e-12, 1.0, 1e12] {
            let (model, estimate) = pair(0.01, 0.2, [150.0, 401.0], units);
            let found = bands(&[model], &[estimate]);
            assert!(found.len() > 6, "{found:?}");
            for b in &found {
                let expected = if b.low_hz >= 150.0 { 20.0 } else { 0.0 };
                if b.high_hz < 150.0 || b.low_hz >= 150.0 {
                    assert!((b.error_percent - expected).abs() < 1e-6, "{b:?}");
                    assert!(
                        (b.over_noise.unwrap() - expected).abs() < 0.2 * expected + 1e-9,
                        "{b:?}"
                    );
                }
                assert!((b.noise_percent - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn bands_hold_all_lines_once_in_order() {
        let (model, estimate) = pair(0.01, 0.0, [0.0, 0.0], 1.0);
        let found = bands(&[model], &[estimate]);
        assert_eq!(found[0].low_hz, 1.0);
        assert_eq!(found[found.len() - 1].high_hz, 400.0);
        assert!(
            found.windows(2).all(|w| w[1].low_hz == w[0].high_hz + 1.0),
            "{found:?}"
        );
    }
}
