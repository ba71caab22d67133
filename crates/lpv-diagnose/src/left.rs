//! Whether anything is left in an error: what it goes with, against bounds that hold for all tests together.

use crate::simulate::Response;
use crate::track::Track;
use lpv_core::linalg::symmetric_eigen;
use lpv_numerics::statistics::chi_squared_p_value;
use nalgebra::{DMatrix, DVector};

/// What the white error of an output owes to one signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Left {
    /// The output, counted from zero.
    pub output: usize,
    /// The signal, in words.
    pub signal: String,
    /// Part of the square of the white error that the signal and its past explain.
    pub share: f64,
    /// Probability of as much by chance, for this test alone.
    pub p_value: f64,
    /// The same for all tests of the list together (Holm, Scandinavian Journal of Statistics 6, 1979, 65-70).
    pub adjusted: f64,
}

/// Delays of a signal, in samples, that are taken together: from none on; of the error's own past from one on.
const DELAYS: usize = 9;

type Signal = fn(&Track, &Response, usize, usize) -> f64;

/// Signals of a simulation without noise: what the sensors add reaches measured ones through the loop, at the same sample.
const SIGNALS: [(&str, Signal); 8] = [
    ("output", |_, r, k, i| r.outputs[k][i]),
    ("speed", speed),
    ("sign of the speed", |t, r, k, i| sign(speed(t, r, k, i), t, r, i)),
    ("input", |_, r, k, i| r.inputs[k][i]),
    ("scheduling", |t, _, k, _| t.scheduling(k)[0]),
    ("rate of the scheduling", |t, _, k, _| t.scheduling(k)[1]),
    ("square of the input", |_, r, k, i| r.inputs[k][i].powi(2)),
    ("time", |t, _, k, _| k as f64 / t.samples as f64),
];

fn speed(_: &Track, r: &Response, k: usize, i: usize) -> f64 {
    let last = r.outputs.len() - 1;
    r.outputs[(k + 1).min(last)][i] - r.outputs[k.saturating_sub(1)][i]
}

/// The sign of a speed, none where the machine all but rests.
fn sign(speed: f64, t: &Track, r: &Response, i: usize) -> f64 {
    let reach = r.outputs.iter().fold(0.0_f64, |m, y| m.max(y[i].abs()));
    if speed.abs() * t.samples as f64 > 1e-2 * reach {
        speed.signum()
    } else {
        0.0
    }
}

/// Tests of white errors, by record and output after output, against their own past and against every signal of the
/// simulations that they come from; in units of the noise.
pub(crate) fn what_is_left(
    white: &[Vec<f64>],
    tracks: &[Track],
    runs: &[Response],
    channels: usize,
) -> Vec<Left> {
    let mut all = Vec::new();
    // An observer answers to the noise of its readings, a sample later with the outputs and at once with the inputs.
    let behind = if tracks.iter().any(|t| t.follows) { 2 } else { 0 };
    let auxiliaries = tracks.iter().map(|t| t.auxiliary.len()).min().unwrap_or(0);
    for output in 0..channels {
        let errors: Vec<&[f64]> = white
            .iter()
            .zip(tracks)
            .map(|(w, t)| &w[output * t.samples..(output + 1) * t.samples])
            .collect();
        let mut test = |signal: String, first: usize, columns: Vec<Vec<f64>>| {
            let Some((fall, delays)) = explained(&errors, &columns, first) else {
                return;
            };
            let total: f64 = errors.iter().flat_map(|e| e.iter()).map(|e| e * e).sum();
            let count = errors.iter().map(|e| e.len()).sum::<usize>().max(1);
            // Errors that are larger than the noise make larger sums by chance too.
            let p_value = chi_squared_p_value(fall / (total / count as f64).max(1.0), delays);
            all.push(Left {
                output,
                signal,
                share: fall / total,
                p_value,
                adjusted: p_value,
            });
        };
        test(
            "its own past".to_owned(),
            1,
            errors.iter().map(|e| e.to_vec()).collect(),
        );
        let along = |value: &dyn Fn(&Track, &Response, usize) -> f64| -> Vec<Vec<f64>> {
            let records = tracks.iter().zip(runs);
            records
                .map(|(t, r)| (0..t.samples).map(|k| value(t, r, k)).collect())
                .collect()
        };
        for (name, signal) in SIGNALS {
            // What differs by channel is asked of all of them.
            let each = if matches!(name, "scheduling" | "rate of the scheduling" | "time") {
                1
            } else {
                channels
            };
            for channel in 0..each {
                let words = match each {
                    1 => name.to_owned(),
                    _ => format!("{name} {}", channel + 1),
                };
                test(words, behind, along(&|t, r, k| signal(t, r, k, channel)));
            }
        }
        for signal in 0..auxiliaries {
            let words = format!("further signal {}", signal + 1);
            test(words, 0, along(&|t, _, k| t.auxiliary[signal][k]));
        }
    }
    adjust(&mut all);
    all.sort_by(|a, b| a.p_value.total_cmp(&b.p_value).then(b.share.total_cmp(&a.share)));
    all
}

/// Sum of squares that delays of a signal explain, and how many of them; chi-squared of a white error of unit variance. None
/// for a signal that does not change.
fn explained(errors: &[&[f64]], columns: &[Vec<f64>], first: usize) -> Option<(f64, usize)> {
    let mut gram = DMatrix::<f64>::zeros(DELAYS, DELAYS);
    let mut right = DVector::<f64>::zeros(DELAYS);
    for (error, column) in errors.iter().zip(columns) {
        let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
        let middle = error.iter().sum::<f64>() / error.len().max(1) as f64;
        let mut rows = [0.0; DELAYS];
        for (k, e) in error.iter().enumerate().skip(first + DELAYS) {
            for (j, row) in rows.iter_mut().enumerate() {
                *row = column[k - first - j] - mean;
            }
            for j in 0..DELAYS {
                right[j] += rows[j] * (e - middle);
                for i in 0..=j {
                    gram[(i, j)] += rows[i] * rows[j];
                }
            }
        }
    }
    gram.fill_lower_triangle_with_upper_triangle();
    // Delays of a smooth signal are nearly the same: only directions that stand out count.
    let values = symmetric_eigen(gram).ok()?;
    let largest = values.eigenvalues.max();
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let (mut sum, mut count) = (0.0, 0);
    for (value, vector) in values.eigenvalues.iter().zip(values.eigenvectors.column_iter()) {
        if *value > 1e-9 * largest {
            sum += vector.dot(&right).powi(2) / value;
            count += 1;
        }
    }
    Some((sum, count))
}

/// Holm's correction, in place.
fn adjust(all: &mut [Left]) {
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|a, b| all[*a].p_value.total_cmp(&all[*b].p_value));
    let mut most: f64 = 0.0;
    for (rank, i) in order.into_iter().enumerate() {
        let count = (all.len() - rank) as f64;
        most = most.max((count * all[i].p_value).min(1.0));
        all[i].adjusted = most;
    }
}

#[cfg(test)]
mod tests {
    use super::{Left, adjust, explained};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// The sum of squares of white errors is chi-squared with as many degrees of freedom as delays.
    #[test]
    fn white_errors_owe_nothing() {
        let signal: Vec<f64> = (0..1500).map(|k| (0.05 * f64::from(k)).sin().signum()).collect();
        let sums: Vec<f64> = (0..300)
            .filter_map(|s| Some(explained(&[&white(1500, s)], std::slice::from_ref(&signal), 0)?.0))
            .collect();
        let mean = sums.iter().sum::<f64>() / 300.0;
        assert!((mean - 9.0).abs() < 0.75, "{mean}");
        let mut with = white(1500, 7);
        with.iter_mut().zip(&signal).for_each(|(w, s)| *w += 0.3 * s);
        let seen = explained(&[&with], &[signal], 0).map_or(0.0, |e| e.0);
        assert!(seen > 80.0, "{seen}");
    }

    /// By hand: 0.01, 0.03, 0.04 become 3 x 0.01, 2 x 0.03, and no less than that.
    #[test]
    fn holm_by_hand() {
        let one = |p_value| Left {
            output: 0,
            signal: String::new(),
            share: 0.0,
            p_value,
            adjusted: p_value,
        };
        let mut all = [one(0.04), one(0.01), one(0.03)];
        adjust(&mut all);
        let adjusted = all.map(|l| l.adjusted);
        assert!((adjusted[1] - 0.03).abs() < 1e-15);
        assert!((adjusted[2] - 0.06).abs() < 1e-15 && (adjusted[0] - 0.06).abs() < 1e-15);
    }
}
