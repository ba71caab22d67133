//! Logged inputs that were measured: they run on between the samples, and are not held.

use crate::base::Pair;
use crate::track::{cubic, slope_of};

/// One input at a time in samples: a cubic piece with slopes from four neighbours; beyond the ends the nearest sample.
pub(super) fn at(signal: &[Pair], input: usize, time: f64) -> f64 {
    let value = |k: isize| signal[k.clamp(0, signal.len() as isize - 1) as usize][input];
    let floor = time.floor();
    let (k, s) = (floor as isize, time - floor);
    let (a, b) = (value(k), value(k + 1));
    if s == 0.0 {
        return a;
    }
    let slope = |k: isize| slope_of([k - 2, k - 1, k + 1, k + 2].map(value));
    cubic([a, b], [slope(k), slope(k + 1)], s)[0]
}

#[cfg(test)]
mod tests {
    use super::at;

    /// Frequencies over three decades, up to a tenth of the sample rate: the error is of the order of the fifth power of the phase.
    #[test]
    fn a_sine_is_the_same_between_its_samples() {
        for phase in [6e-4, 6e-3, 6e-2, 0.6] {
            let signal: Vec<[f64; 2]> = (0..400).map(|k| [(phase * f64::from(k)).sin(), 0.0]).collect();
            for j in 0..1000 {
                let time = 20.0 + 0.317 * f64::from(j);
                let error = at(&signal, 0, time) - (phase * time).sin();
                assert!(
                    error.abs() < 1e-2 * phase.powi(4) + 1e-12,
                    "{error} at phase {phase}"
                );
            }
        }
    }
}
