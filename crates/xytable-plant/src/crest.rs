//! Low crest factor by iterative clipping (Van der Ouderaa, Schoukens and Renneboog, IEEE TIM 37(1), 1988).

use crate::PlantError;
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

type C64 = Complex<f64>;

/// Why the crest reduction stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CrestStop {
    /// All iterations were used; more would lower the crest factor a little.
    Iterations,
    /// Clipping did not change the signal any more.
    Stationary,
}

/// Result of the reduction: unit phasors of the excited lines.
pub(crate) struct Reduced {
    pub(crate) phasors: Vec<C64>,
    pub(crate) crest_factor: f64,
    pub(crate) first_crest_factor: f64,
    pub(crate) iterations: usize,
    pub(crate) stop: CrestStop,
}

/// Between phasors of the excited lines and a period of samples.
pub(crate) struct Synthesis<'a> {
    lines: &'a [usize],
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    spectrum: Vec<C64>,
    samples: Vec<f64>,
    period: usize,
}

impl<'a> Synthesis<'a> {
    /// `lines` are strictly increasing, from 1 to `period / 2`.
    pub(crate) fn new(period: usize, lines: &'a [usize]) -> Self {
        let mut planner = RealFftPlanner::new();
        Self {
            lines,
            forward: planner.plan_fft_forward(period),
            inverse: planner.plan_fft_inverse(period),
            spectrum: vec![C64::new(0.0, 0.0); period / 2 + 1],
            samples: vec![0.0; period],
            period,
        }
    }

    /// The signal whose discrete Fourier transform has these values at the lines; real at the Nyquist line.
    pub(crate) fn signal(&mut self, phasors: &[C64]) -> Result<&mut Vec<f64>, PlantError> {
        self.spectrum.fill(C64::new(0.0, 0.0));
        for (&line, &phasor) in self.lines.iter().zip(phasors) {
            self.spectrum[line] = if 2 * line == self.period {
                nyquist(phasor)
            } else {
                phasor
            };
        }
        self.inverse.process(&mut self.spectrum, &mut self.samples)?;
        Ok(&mut self.samples)
    }

    /// Unit phasors of the samples at the lines.
    fn phasors(&mut self, out: &mut [C64]) -> Result<(), PlantError> {
        self.forward.process(&mut self.samples, &mut self.spectrum)?;
        for (&line, value) in self.lines.iter().zip(out) {
            let v = self.spectrum[line];
            // A line that clipping has emptied keeps the phase that it had.
            let size = v.norm_sqr().sqrt();
            if size > 0.0 {
                *value = if 2 * line == self.period {
                    nyquist(v)
                } else {
                    v / size
                };
            }
        }
        Ok(())
    }
}

/// The Nyquist line is real: its phasor is 1 or -1.
fn nyquist(phasor: C64) -> C64 {
    C64::new(if phasor.re < 0.0 { -1.0 } else { 1.0 }, 0.0)
}

/// From Schroeder's phases, or random ones with a seed: clip, transform, keep the phases, restore the amplitudes.
///
/// The clipping level rises towards the peak, which first moves much and then polishes; the best signal seen is kept.
pub(crate) fn reduce_crest(
    synthesis: &mut Synthesis<'_>,
    random: Option<u64>,
    most_iterations: usize,
) -> Result<Reduced, PlantError> {
    let count = synthesis.lines.len() as f64;
    let mut phasors: Vec<C64> = match random {
        None => (0..synthesis.lines.len())
            .map(|i| C64::from_polar(1.0, -PI * i as f64 * (i as f64 + 1.0) / count))
            .collect(),
        Some(seed) => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            // A stream of its own: stream 0 of the seed chose the lines.
            rng.set_stream(1);
            synthesis
                .lines
                .iter()
                .map(|_| C64::from_polar(1.0, TAU * rng.random::<f64>()))
                .collect()
        }
    };
    let mut best = phasors.clone();
    let (mut first, mut lowest) = (f64::NAN, f64::INFINITY);
    let (mut iterations, mut stop) = (0, CrestStop::Iterations);
    loop {
        let samples = synthesis.signal(&phasors)?;
        let peak = samples.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let crest = peak / (samples.iter().map(|v| v * v).sum::<f64>() / samples.len() as f64).sqrt();
        if first.is_nan() {
            first = crest;
        }
        if crest < lowest {
            lowest = crest;
            best.copy_from_slice(&phasors);
        }
        if iterations == most_iterations {
            break;
        }
        let progress = iterations as f64 / most_iterations as f64;
        let level = peak * (0.75 + 0.2 * progress);
        samples.iter_mut().for_each(|v| *v = v.clamp(-level, level));
        let before = phasors.clone();
        synthesis.phasors(&mut phasors)?;
        iterations += 1;
        if before
            .iter()
            .zip(&phasors)
            .all(|(a, b)| (a - b).norm_sqr() < 1e-18)
        {
            stop = CrestStop::Stationary;
            break;
        }
    }
    Ok(Reduced {
        phasors: best,
        crest_factor: lowest,
        first_crest_factor: first,
        iterations,
        stop,
    })
}
