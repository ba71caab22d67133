//! What an error looks like that no effect explains.

use crate::base::Pair;
use crate::track::Track;
use std::f64::consts::TAU;

/// Where an error sits and what it goes with.
#[derive(Debug, Clone, PartialEq)]
pub struct Character {
    /// Output with the largest error over its noise, counted from zero.
    pub output: usize,
    /// Band that holds the middle eighty percent of its energy, Hz.
    pub band_hz: [f64; 2],
    /// Signals and the correlation of the error with them, the largest first.
    pub correlations: Vec<(&'static str, f64)>,
}

/// Frequencies at which the energy is taken.
const LINES: usize = 60;

/// Samples of a record that the spectrum looks at.
const SAMPLES: usize = 4096;

/// Describes errors by record and sample; none where there are no samples.
pub fn characterise(errors: &[Vec<Pair>], tracks: &[Track], noise: Pair) -> Option<Character> {
    let total = |i: usize| errors.iter().flatten().map(|e| e[i] * e[i]).sum::<f64>();
    let over = |i: usize| {
        if noise[i] > 0.0 {
            total(i) / (noise[i] * noise[i])
        } else {
            0.0
        }
    };
    let output = if over(1) > over(0) { 1 } else { 0 };
    let track = tracks.first()?;
    let samples = track.samples.min(SAMPLES);
    let (low, high) = (2.0 / samples as f64, 0.5_f64);
    let edge = |k: usize| low * (high / low).powf(k as f64 / (LINES - 1) as f64);
    let mut energy = [0.0; LINES];
    for error in errors {
        let n = error.len().min(SAMPLES);
        for (k, energy) in energy.iter_mut().enumerate() {
            let (mut re, mut im) = (0.0, 0.0);
            for (j, e) in error[..n].iter().enumerate() {
                let window = 0.5 - 0.5 * (TAU * j as f64 / n as f64).cos();
                let (s, c) = (TAU * edge(k) * j as f64).sin_cos();
                re += window * e[output] * c;
                im += window * e[output] * s;
            }
            // Lines are spaced by a factor: each stands for a band as wide as its frequency.
            *energy += (re * re + im * im) * edge(k);
        }
    }
    let all: f64 = energy.iter().sum();
    let at = |part: f64| {
        let mut sum = 0.0;
        let line = energy.iter().position(|e| {
            sum += e;
            sum >= part * all
        });
        edge(line.unwrap_or(LINES - 1)) / track.step
    };
    let mut correlations: Vec<(&'static str, f64)> = SIGNALS
        .iter()
        .map(|(name, signal)| (*name, correlation(errors, tracks, output, *signal)))
        .collect();
    correlations.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    Some(Character {
        output,
        band_hz: [at(0.1), at(0.9)],
        correlations,
    })
}

type Signal = fn(&Track, usize, usize) -> f64;

const SIGNALS: [(&str, Signal); 8] = [
    ("output", |t, k, i| t.outputs[k][i]),
    ("speed", speed),
    ("sign of the speed", |t, k, i| speed(t, k, i).signum()),
    ("acceleration", |t, k, i| {
        let at = |k: usize| t.outputs[k.min(t.samples - 1)][i];
        at(k + 1) - 2.0 * at(k) + at(k.saturating_sub(1))
    }),
    ("input", |t, k, i| t.inputs[k][i]),
    ("scheduling", |t, k, _| t.scheduling(k)[0]),
    ("rate of the scheduling", |t, k, _| t.scheduling(k)[1]),
    ("time", |_, k, _| k as f64),
];

fn speed(t: &Track, k: usize, i: usize) -> f64 {
    t.outputs[(k + 1).min(t.samples - 1)][i] - t.outputs[k.saturating_sub(1)][i]
}

fn correlation(errors: &[Vec<Pair>], tracks: &[Track], output: usize, signal: Signal) -> f64 {
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    for (error, track) in errors.iter().zip(tracks) {
        let n = error.len().max(1) as f64;
        let values: Vec<f64> = (0..error.len()).map(|k| signal(track, k, output)).collect();
        let mean = values.iter().sum::<f64>() / n;
        let middle = error.iter().map(|e| e[output]).sum::<f64>() / n;
        for (v, e) in values.iter().zip(error) {
            let (v, e) = (v - mean, e[output] - middle);
            both += v * e;
            own += e * e;
            other += v * v;
        }
    }
    let size = (own * other).sqrt();
    if size > 0.0 { both / size } else { 0.0 }
}
