//! The closed-loop output noise, and the filter that makes it white.

use crate::base::Pair;

/// Taps of the filter in a competition, where it is applied to every column of every fit.
pub(crate) const SHORT: usize = 24;
/// Taps for tests of whether anything is left: a loop with integrators colours the noise for long.
pub(crate) const LONG: usize = 160;

/// One prediction-error filter an output: `w = (e - prediction from the past) / deviation`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Whitening {
    taps: [Vec<f64>; 2],
    channels: usize,
    /// Deviation of the closed-loop output noise, by output.
    pub(crate) deviation: Pair,
}

impl Whitening {
    /// From samples of the closed-loop output noise, one vector a record.
    pub(crate) fn new(noise: &[Vec<Pair>], channels: usize, order: usize) -> Self {
        let mut taps = [Vec::new(), Vec::new()];
        let mut deviation = [0.0; 2];
        for (i, taps) in taps.iter_mut().enumerate().take(channels) {
            let mut r = vec![0.0; order + 1];
            let mut count = 0.0;
            for record in noise {
                for (lag, r) in r.iter_mut().enumerate().take(record.len()) {
                    *r += record[lag..]
                        .iter()
                        .zip(record)
                        .map(|(a, b)| a[i] * b[i])
                        .sum::<f64>();
                }
                count += record.len() as f64;
            }
            deviation[i] = (r[0] / count).sqrt();
            let (a, variance) = levinson(&r);
            let scale = (variance / count).sqrt().recip();
            *taps = a.iter().map(|a| a * scale).collect();
        }
        Self {
            taps,
            channels,
            deviation,
        }
    }

    /// No filter: errors over their own root mean square.
    pub(crate) fn by_size(errors: &[Vec<Pair>], channels: usize) -> Self {
        let count = errors.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let mut taps = [Vec::new(), Vec::new()];
        let mut deviation = [0.0; 2];
        for (i, taps) in taps.iter_mut().enumerate().take(channels) {
            let squares: f64 = errors.iter().flatten().map(|e| e[i] * e[i]).sum();
            deviation[i] = (squares / count).sqrt();
            *taps = vec![deviation[i].recip()];
        }
        Self {
            taps,
            channels,
            deviation,
        }
    }

    /// The force that would take an error away, at an observer of bandwidth `w / (2 pi)` and over the mass: `w^2 e + 2 d w e'`, with the
    /// mean rate over so many samples; in units of one until it is [sized](Self::sized).
    pub(crate) fn by_force(
        channels: usize,
        [stiffness, damping]: [f64; 2],
        (span, step): (usize, f64),
    ) -> Self {
        let rate = damping / (span as f64 * step);
        let mut one = vec![0.0; span + 1];
        (one[0], one[span]) = (stiffness + rate, -rate);
        let taps = std::array::from_fn(|i| if i < channels { one.clone() } else { Vec::new() });
        Self {
            taps,
            channels,
            deviation: [1.0; 2],
        }
    }

    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// The same in units of the root mean square that it makes of these errors.
    pub(crate) fn sized(self, errors: &[Vec<Pair>]) -> Self {
        let mut white = Vec::new();
        errors.iter().for_each(|e| self.apply(e, &mut white));
        let size = (white.iter().map(|w| w * w).sum::<f64>() / white.len().max(1) as f64).sqrt();
        if size > 0.0 {
            self.finer(size.recip())
        } else {
            self
        }
    }

    /// The same in units that are so many times smaller.
    pub(crate) fn finer(mut self, times: f64) -> Self {
        self.taps.iter_mut().flatten().for_each(|t| *t *= times);
        self.deviation = self.deviation.map(|d| d / times);
        self
    }

    /// The white sequence of an error, output after output.
    pub(crate) fn apply(&self, error: &[Pair], out: &mut Vec<f64>) {
        for (i, taps) in self.taps.iter().enumerate().take(self.channels) {
            let error: Vec<f64> = error.iter().map(|e| e[i]).collect();
            let first = out.len();
            out.resize(first + error.len(), 0.0);
            let white = &mut out[first..];
            // Tap by tap, so that samples lie beside each other.
            let present = taps.iter().enumerate().take(error.len());
            for (j, tap) in present.filter(|(_, tap)| **tap != 0.0) {
                for (w, e) in white[j..].iter_mut().zip(&error) {
                    *w += tap * e;
                }
            }
        }
    }
}

/// Prediction-error filter `[1, a_1, ...]` of an autocovariance and the variance that it leaves.
fn levinson(r: &[f64]) -> (Vec<f64>, f64) {
    let mut a = vec![1.0];
    let mut variance = r[0];
    for m in 1..r.len() {
        let reflection = -a.iter().enumerate().map(|(j, a)| a * r[m - j]).sum::<f64>() / variance;
        a.push(0.0);
        let old = a.clone();
        for j in 1..=m {
            a[j] = old[j] + reflection * old[m - j];
        }
        variance *= 1.0 - reflection * reflection;
    }
    (a, variance)
}

#[cfg(test)]
mod tests {
    use super::levinson;

    #[test]
    fn a_first_order_process_by_hand() {
        // e(k) = 0.8 e(k-1) + w, variance of w one.
        let r: Vec<f64> = (0..5).map(|j| 0.8_f64.powi(j) / (1.0 - 0.64)).collect();
        let (a, variance) = levinson(&r);
        assert!((variance - 1.0).abs() < 1e-12);
        assert!((a[1] + 0.8).abs() < 1e-12 && a[2..].iter().all(|a| a.abs() < 1e-12));
    }
}
