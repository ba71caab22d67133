//! How much of each output the inputs explain linearly, for any excitation.

use crate::FrfError;
use lpv_core::Record;
use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex;
use realfft::RealFftPlanner;

type C64 = Complex<f64>;

/// Multiple coherence of each output with all inputs together.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coherence {
    /// Lines in cycles a segment, from 1; Nyquist is left out.
    pub lines: Vec<usize>,
    /// Samples a segment.
    pub segment: usize,
    /// By output, then by line: `S_yu S_uu^-1 S_uy / S_yy`, 0 to 1. With K segments a signal without any relation still
    /// shows about `n_u / K`.
    pub by_output: Vec<Vec<f64>>,
    /// By output: the part of its power over all lines that the inputs explain.
    pub explained: Vec<f64>,
}

/// Welch's method: Hann windows on segments of `N / segments` samples that overlap by half, means removed
/// (Bendat and Piersol, Random Data, 4th ed., ch. 7 and 11).
///
/// # Errors
/// [`FrfError::NoRecords`] for a record without inputs or outputs, [`FrfError::Setting`] if there are fewer than
/// `2 n_u + 2` segments or fewer than 16 samples in one.
pub fn multiple_coherence(record: &Record, segments: usize) -> Result<Coherence, FrfError> {
    let (ny, nu) = (record.outputs.channels(), record.inputs.channels());
    if ny == 0 || nu == 0 {
        return Err(FrfError::NoRecords);
    }
    let length = record.len() / segments.max(1);
    if segments < 2 * nu + 2 || length < 16 {
        return Err(FrfError::Setting {
            setting: "segments",
            value: segments as f64,
            expected: "at least 2 n_u + 2, and short enough to leave 16 samples in each",
        });
    }
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let window: Vec<f64> = (0..length)
        .map(|t| (std::f64::consts::PI * t as f64 / length as f64).sin().powi(2))
        .collect();
    let mut input = plan.make_input_vec();
    let mut spectrum = plan.make_output_vec();
    let count = (record.len() - length) / (length / 2) + 1;
    let channels: Vec<&Vec<f64>> = record
        .inputs
        .columns
        .iter()
        .chain(&record.outputs.columns)
        .collect();
    // Spectra by channel, then by segment.
    let mut spectra: Vec<Vec<Vec<C64>>> = vec![Vec::with_capacity(count); nu + ny];
    for (channel, found) in channels.iter().zip(&mut spectra) {
        let mean = channel.iter().sum::<f64>() / channel.len() as f64;
        for s in 0..count {
            let from = s * (length / 2);
            for ((x, v), w) in input.iter_mut().zip(&channel[from..from + length]).zip(&window) {
                *x = (v - mean) * w;
            }
            if plan.process(&mut input, &mut spectrum).is_err() {
                return Err(FrfError::NoRecords);
            }
            found.push(spectrum.clone());
        }
    }
    let lines: Vec<usize> = (1..length.div_ceil(2)).collect();
    let mut by_output = vec![Vec::with_capacity(lines.len()); ny];
    let (mut explained_power, mut all_power) = (vec![0.0; ny], vec![0.0; ny]);
    let cross = |a: usize, b: usize, k: usize| -> C64 {
        spectra[a]
            .iter()
            .zip(&spectra[b])
            .map(|(x, y)| x[k] * y[k].conj())
            .sum()
    };
    for &k in &lines {
        let uu = DMatrix::from_fn(nu, nu, |i, j| cross(i, j, k));
        let factor = Cholesky::new(uu);
        for (i, found) in by_output.iter_mut().enumerate() {
            let uy = DVector::from_fn(nu, |j, _| cross(j, nu + i, k));
            let power = cross(nu + i, nu + i, k).re;
            let explained = factor.as_ref().map_or(0.0, |f| uy.dotc(&f.solve(&uy)).re);
            explained_power[i] += explained.clamp(0.0, power);
            all_power[i] += power;
            found.push(if power > 0.0 {
                (explained / power).clamp(0.0, 1.0)
            } else {
                0.0
            });
        }
    }
    Ok(Coherence {
        lines,
        segment: length,
        by_output,
        explained: explained_power
            .iter()
            .zip(&all_power)
            .map(|(e, a)| if *a > 0.0 { e / a } else { 0.0 })
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::{Purpose, RecordKind, Signals};

    fn noise(n: usize, mut seed: u64) -> Vec<f64> {
        (0..n)
            .map(|_| {
                seed = seed
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .collect()
    }

    fn record(inputs: Vec<Vec<f64>>, outputs: Vec<Vec<f64>>) -> Record {
        let signals = |columns: Vec<Vec<f64>>| Signals {
            names: vec![String::new(); columns.len()],
            units: Vec::new(),
            columns,
        };
        Record {
            name: "r".to_owned(),
            kind: RecordKind::Transient,
            purpose: Purpose::Estimation,
            position: None,
            outputs: signals(outputs),
            inputs: signals(inputs),
            references: Signals::default(),
            scheduling: Signals::default(),
            auxiliary: Signals::default(),
            injection: Signals::default(),
        }
    }

    /// `y = u + v` with independent white u, v of powers 1 and 1/4 has the coherence 0.8; an unrelated output almost none.
    #[test]
    fn known_coherence() {
        let n = 1 << 15;
        let (u, w, v, other) = (noise(n, 1), noise(n, 9), noise(n, 5), noise(n, 77));
        let y: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + 0.5 * v).collect();
        let both: Vec<f64> = u.iter().zip(&w).map(|(u, w)| u - 2.0 * w).collect();
        let found = multiple_coherence(&record(vec![u, w], vec![y, other, both]), 256).unwrap();
        let mean = |i: usize| found.by_output[i].iter().sum::<f64>() / found.lines.len() as f64;
        assert!((mean(0) - 0.8).abs() < 0.02, "{}", mean(0));
        assert!(mean(1) < 0.02, "{}", mean(1));
        assert!(mean(2) > 0.999, "{}", mean(2));
        assert!((found.explained[0] - 0.8).abs() < 0.02 && found.explained[1] < 0.02);
    }

    #[test]
    fn records_too_short_are_refused() {
        let r = record(vec![vec![0.0, 1.0, 0.0]], vec![vec![1.0, 0.0, 2.0]]);
        assert!(multiple_coherence(&r, 16).is_err());
        assert!(multiple_coherence(&r, 0).is_err());
    }
}
