//! Logged inputs that were measured: they run on between the samples, and are not held.

use super::{cubic, slope_of};
use crate::base::Pair;

/// One input at a time in samples: a cubic piece with slopes from four neighbours; beyond the ends the nearest sample.
pub(crate) fn at(signal: &[Pair], input: usize, time: f64) -> f64 {
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

/// All inputs at start, middle and end of so many parts of every sample.
pub(super) fn points(signal: &[Pair], substeps: usize) -> Vec<Pair> {
    let points = 2 * substeps;
    let time = |n: usize| (n / points) as f64 + (n % points) as f64 * (0.5 / substeps as f64);
    (0..=points * signal.len())
        .map(|n| [0, 1].map(|input| at(signal, input, time(n))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{at, points};

    #[test]
    fn the_points_of_all_samples() {
        let signal: Vec<[f64; 2]> = (0..9).map(|k| [f64::from(k).cos(), f64::from(k * k)]).collect();
        let all = points(&signal, 3);
        assert_eq!(all.len(), 9 * 6 + 1);
        for (n, value) in all.iter().enumerate() {
            let time = n as f64 / 6.0;
            let exact = [0, 1].map(|input| at(&signal, input, time));
            assert!(
                (0..2).all(|i| (value[i] - exact[i]).abs() < 1e-12),
                "{value:?} {exact:?}"
            );
        }
    }

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
