//! Orthogonal multisines: periodic signals of flat spectrum and low crest factor, different in each experiment.

use crate::PlantError;
use crate::crest::{CrestStop, Synthesis, reduce_crest};
use crate::error::positive;
use crate::lines::Lines;
use lpv_core::Discrete;
use num_complex::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Settings of a multisine, unchecked; [`MultisineSettings::check`] makes the signals.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `period` | 32768 | samples a period, any number | 2 to 2^24 |
/// | `lines` | full | excited lines | see [`Lines`] |
/// | `amplitude` | 1e-4 | largest absolute value over all experiments (the peak, not the rms) | > 0 |
/// | `inputs` | 2 | inputs, and as many experiments | 1 to 64 |
/// | `crest_iterations` | 50 | most steps of crest reduction; 0 keeps the first phases | up to 10,000 |
/// | `seed` | 0 | for the lines and phases of [`Lines::OddRandom`] | |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MultisineSettings {
    /// Samples a period.
    pub period: usize,
    /// Excited lines.
    pub lines: Lines,
    /// Peak of the signals.
    pub amplitude: f64,
    /// Inputs, and as many experiments.
    pub inputs: usize,
    /// Most steps of crest reduction.
    pub crest_iterations: usize,
    /// Seed of the random choices.
    pub seed: u64,
}

impl Default for MultisineSettings {
    fn default() -> Self {
        Self {
            period: 1 << 15,
            lines: Lines::Full,
            amplitude: 1e-4,
            inputs: 2,
            crest_iterations: 50,
            seed: 0,
        }
    }
}

/// Orthogonal multisines for n inputs in n experiments.
///
/// At every excited line the matrix `R(k)` of spectra (rows: inputs, columns: experiments) is a flat spectrum times a
/// unitary pattern, so `R R^H` is a multiple of the identity. With two inputs, experiment 1 has `[a, a]` and
/// experiment 2 `[a, -a]`. A power of two takes a Hadamard matrix; other numbers take the Fourier matrix as phase
/// shifts, which leaves the Nyquist line out of reach (it is real).
#[derive(Debug, Clone, PartialEq)]
pub struct Multisine {
    settings: MultisineSettings,
    excited: Vec<usize>,
    detection: Vec<usize>,
    /// Distinct signals; `pattern` says which one, with which sign, an input gets.
    signals: Vec<Vec<f64>>,
    crest_factor: f64,
    first_crest_factor: f64,
    iterations: usize,
    stop: CrestStop,
}

impl MultisineSettings {
    /// Checks the settings, reduces the crest factor and makes the signals.
    ///
    /// # Errors
    /// [`PlantError::Setting`], [`PlantError::Line`], [`PlantError::NoLines`].
    pub fn check(self) -> Result<Multisine, PlantError> {
        positive("amplitude", self.amplitude)?;
        for (field, value, least, most, problem) in [
            ("period", self.period, 2, 1 << 24, "give 2 to 16,777,216 samples"),
            ("inputs", self.inputs, 1, 64, "give 1 to 64 inputs"),
            (
                "crest_iterations",
                self.crest_iterations,
                0,
                10_000,
                "give 0 to 10,000 iterations",
            ),
        ] {
            if !(least..=most).contains(&value) {
                return Err(PlantError::Setting {
                    field,
                    value: value as f64,
                    problem,
                });
            }
        }
        let selection = self.lines.select(self.period, self.seed)?;
        let excited = selection.excited;
        let fourier = !self.inputs.is_power_of_two();
        if fourier && let Some(index) = excited.iter().position(|&k| 2 * k == self.period) {
            return Err(PlantError::Line {
                index,
                line: excited[index],
                highest: (self.period - 1) / 2,
            });
        }
        let mut synthesis = Synthesis::new(self.period, &excited);
        let random = matches!(self.lines, Lines::OddRandom { .. }).then_some(self.seed);
        let reduced = reduce_crest(&mut synthesis, random, self.crest_iterations)?;
        let shifts = if fourier { self.inputs } else { 1 };
        let mut signals = Vec::with_capacity(shifts);
        for shift in 0..shifts {
            let turn = Complex::from_polar(1.0, TAU * shift as f64 / self.inputs as f64);
            let phasors: Vec<_> = reduced.phasors.iter().map(|v| v * turn).collect();
            signals.push(synthesis.signal(&phasors)?.to_vec());
        }
        // One scale for all signals keeps the spectra of equal size, hence orthogonal; the largest peak is the amplitude.
        let peak = signals.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        let scale = self.amplitude / peak;
        signals.iter_mut().flatten().for_each(|v| *v *= scale);
        Ok(Multisine {
            settings: self,
            excited,
            detection: selection.detection,
            signals,
            crest_factor: reduced.crest_factor,
            first_crest_factor: reduced.first_crest_factor,
            iterations: reduced.iterations,
            stop: reduced.stop,
        })
    }
}

impl Multisine {
    /// The settings that made it.
    pub fn settings(&self) -> &MultisineSettings {
        &self.settings
    }
    /// Samples a period.
    pub fn period(&self) -> usize {
        self.settings.period
    }
    /// Number of inputs, and of experiments.
    pub fn inputs(&self) -> usize {
        self.settings.inputs
    }
    /// Excited lines, cycles a period.
    pub fn lines(&self) -> &[usize] {
        &self.excited
    }
    /// Odd lines left out to detect distortion; empty except for [`Lines::OddRandom`].
    pub fn detection_lines(&self) -> &[usize] {
        &self.detection
    }
    /// Frequencies of the excited lines, Hz.
    pub fn frequencies_hz(&self, clock: Discrete) -> Vec<f64> {
        let duration = self.period() as f64 * clock.sample_time();
        self.excited.iter().map(|&k| k as f64 / duration).collect()
    }
    /// One period of the signal of `input` in `experiment`.
    ///
    /// # Errors
    /// [`PlantError::Length`] if there is no such input or experiment.
    pub fn signal(&self, experiment: usize, input: usize) -> Result<Vec<f64>, PlantError> {
        let n = self.inputs();
        for (what, index) in [
            ("experiments of a multisine", experiment),
            ("inputs of a multisine", input),
        ] {
            if index >= n {
                return Err(PlantError::Length {
                    what,
                    expected: n,
                    found: index + 1,
                });
            }
        }
        if n.is_power_of_two() {
            // Entry (i, j) of Sylvester's Hadamard matrix is the parity of the bits that i and j share.
            let sign = if (experiment & input).count_ones().is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            Ok(self.signals[0].iter().map(|v| sign * v).collect())
        } else {
            Ok(self.signals[(experiment * input) % n].clone())
        }
    }
    /// Peak over rms of the base signal.
    pub fn crest_factor(&self) -> f64 {
        self.crest_factor
    }
    /// Peak over rms before the crest reduction.
    pub fn first_crest_factor(&self) -> f64 {
        self.first_crest_factor
    }
    /// Steps of crest reduction done.
    pub fn iterations(&self) -> usize {
        self.iterations
    }
    /// Why the crest reduction stopped.
    pub fn stop(&self) -> CrestStop {
        self.stop
    }
}
