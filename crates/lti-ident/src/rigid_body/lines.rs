//! Linear equations between windowed spectra.
//!
//! A relation between samples that holds at every sample holds between the spectra of its windowed terms too, without
//! transients and whatever the record begins and ends with. The window is `sin^4`, whose spectrum ends two lines from
//! its centre: what is not at a line and beside it does not reach it, so that a line with force is not touched by the
//! noise of the derivatives at higher frequencies.

use nalgebra::{Complex, SMatrix, SVector};
use realfft::RealFftPlanner;

pub(super) type C = Complex<f64>;

/// Spectra up to this part of the sampling frequency are kept.
const KEPT: f64 = 0.45;
/// Lines that a constant reaches through the window: 0, 1 and 2.
pub(super) const OF_CONSTANT: usize = 3;
/// Correlation of the noise of lines that are 0 to 4 apart: the spectrum of `sin^8` over its value at zero.
const CORRELATION: [f64; 5] = [1.0, -0.8, 0.4, -8.0 / 70.0, 1.0 / 70.0];
/// Sum of the squares of all correlations, 0 to both sides: lines that say together what one independent line does.
pub(super) const ALIKE: f64 = 1.0 + 2.0 * (0.64 + 0.16 + 64.0 / 4900.0 + 1.0 / 4900.0);

/// The window over `n` samples.
pub(super) fn window(n: usize) -> Vec<f64> {
    let at = |k: usize| (std::f64::consts::PI * (k as f64 + 0.5) / n as f64).sin().powi(4);
    (0..n).map(at).collect()
}

/// Number of lines kept of `n` samples.
pub(super) fn kept(n: usize) -> usize {
    (KEPT * n as f64) as usize
}

/// Lines of a windowed signal, scaled with `1 / sqrt(n)`, so that noise has the same level in records of any length.
pub(super) fn spectrum(planner: &mut RealFftPlanner<f64>, signal: &[f64], window: &[f64]) -> Vec<C> {
    let n = window.len();
    let fft = planner.plan_fft_forward(n);
    let mut part: Vec<f64> = signal.iter().zip(window).map(|(s, w)| s * w).collect();
    let mut lines = fft.make_output_vec();
    if part.len() != n || fft.process(&mut part, &mut lines).is_err() {
        return vec![C::default(); kept(n)];
    }
    lines.truncate(kept(n));
    let scale = 1.0 / (n as f64).sqrt();
    lines.iter().map(|l| l * scale).collect()
}

/// `u = x' theta + e` at the lines of one record, instruments `z`.
pub(super) struct Part<const D: usize> {
    pub(super) x: Vec<[C; D]>,
    pub(super) z: Vec<[C; D]>,
    pub(super) u: Vec<C>,
    /// Power of `e`; infinite where a line is not used.
    pub(super) noise: Vec<f64>,
}

impl<const D: usize> Part<D> {
    /// What the equations leave of the force.
    pub(super) fn residual(&self, theta: &SVector<f64, D>) -> Vec<C> {
        let left = |(x, u): (&[C; D], &C)| (0..D).fold(*u, |e, i| e - x[i] * theta[i]);
        self.x.iter().zip(&self.u).map(left).collect()
    }
}

/// `theta = inverse * sum Re(conj(z) u / noise)`.
pub(super) struct Linear<const D: usize> {
    pub(super) theta: SVector<f64, D>,
    pub(super) inverse: SMatrix<f64, D, D>,
    /// Condition number of the regressors, columns scaled to norm one.
    pub(super) condition_number: f64,
}

/// Weighted equations of all records, solved with the instruments; none where they do not tell the unknowns apart.
pub(super) fn solve<const D: usize>(parts: &[Part<D>]) -> Option<Linear<D>> {
    let (mut size, mut unit) = ([0.0; D], [0.0; D]);
    for (x, z, _, noise) in parts.iter().flat_map(rows) {
        for i in 0..D {
            size[i] += x[i].norm_sqr() / noise;
            unit[i] += z[i].norm_sqr() / noise;
        }
    }
    let (size, unit) = (size.map(f64::sqrt), unit.map(f64::sqrt));
    if size.iter().chain(&unit).any(|s| !s.is_normal()) {
        return None;
    }
    let (mut zx, mut xx) = (SMatrix::<f64, D, D>::zeros(), SMatrix::<f64, D, D>::zeros());
    let mut zu = SVector::<f64, D>::zeros();
    for (x, z, u, noise) in parts.iter().flat_map(rows) {
        for i in 0..D {
            let (z, own) = (z[i].conj() / (noise * unit[i]), x[i].conj() / (noise * size[i]));
            zu[i] += (z * u).re;
            for j in 0..D {
                zx[(i, j)] += (z * x[j]).re / size[j];
                xx[(i, j)] += (own * x[j]).re / size[j];
            }
        }
    }
    let scaled = zx.try_inverse()?;
    let inverse = SMatrix::from_fn(|i, j| scaled[(i, j)] / (size[i] * unit[j]));
    let theta = SVector::<f64, D>::from_fn(|i, _| (scaled * zu)[i] / size[i]);
    // The square root of the ratio of the norms bounds the condition of the columns.
    let condition_number = (xx.norm() * xx.try_inverse()?.norm()).sqrt();
    let is_finite = theta.iter().all(|t| t.is_finite()) && condition_number < 1e10;
    is_finite.then_some(Linear {
        theta,
        inverse,
        condition_number,
    })
}

fn rows<const D: usize>(part: &Part<D>) -> impl Iterator<Item = (&[C; D], &[C; D], C, f64)> {
    let rows = part.x.iter().zip(&part.z).zip(&part.u).zip(&part.noise);
    rows.filter(|(_, noise)| noise.is_finite())
        .map(|(((x, z), u), noise)| (x, z, *u, *noise))
}

impl<const D: usize> Linear<D> {
    /// Part of a line in the estimate: these sum to the number of unknowns.
    pub(super) fn leverage(&self, part: &Part<D>) -> Vec<f64> {
        let of = |k: usize| -> f64 {
            if !part.noise[k].is_finite() {
                return 0.0;
            }
            let sum = |i: usize| -> f64 {
                let z: C = (0..D).map(|j| part.z[k][j].conj() * self.inverse[(i, j)]).sum();
                (z * part.x[k][i]).re
            };
            ((0..D).map(sum).sum::<f64>() / part.noise[k]).clamp(0.0, 0.9)
        };
        (0..part.u.len()).map(of).collect()
    }

    /// Covariance of the unknowns under noise of these powers, which neighbouring lines share through the window.
    pub(super) fn covariance(&self, parts: &[Part<D>], powers: &[Vec<f64>]) -> SMatrix<f64, D, D> {
        let mut scores = SMatrix::<f64, D, D>::zeros();
        for (part, powers) in parts.iter().zip(powers) {
            let score = |k: usize| part.z[k].map(|z| z * (powers[k].sqrt() / part.noise[k]));
            for k in (0..part.u.len()).filter(|&k| part.noise[k].is_finite()) {
                let own = score(k);
                for (apart, correlation) in CORRELATION.iter().enumerate().take(k + 1) {
                    if !part.noise[k - apart].is_finite() {
                        continue;
                    }
                    let other = score(k - apart);
                    for i in 0..D {
                        for j in 0..D {
                            let product = 0.5 * correlation * (own[i].conj() * other[j]).re;
                            scores[(i, j)] += product;
                            if apart > 0 {
                                scores[(j, i)] += product;
                            }
                        }
                    }
                }
            }
        }
        self.inverse * scores * self.inverse.transpose()
    }
}

/// Half of the lines over which the power of the noise at line `k` is averaged.
fn reach(k: usize) -> usize {
    (k / 5).max(8)
}

/// Local mean of the powers of a residual: `counts` says how much of each line the fit has left.
pub(super) fn smoothed(powers: &[f64], counts: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let sums = |values: &[f64]| -> Vec<f64> {
        let mut sum = 0.0;
        let running = values.iter().map(|v| {
            sum += v;
            sum
        });
        std::iter::once(0.0).chain(running).collect()
    };
    let (powers, counts) = (sums(powers), sums(counts));
    let lines = powers.len() - 1;
    let between = |sums: &[f64], k: usize| {
        let (from, to) = (k.saturating_sub(reach(k)), (k + reach(k) + 1).min(lines));
        (sums[to] - sums[from]).max(0.0)
    };
    let left: Vec<f64> = (0..lines).map(|k| between(&counts, k)).collect();
    let means = (0..lines)
        .map(|k| between(&powers, k) / left[k].max(1.0))
        .collect();
    (means, left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_ends_two_lines_away_and_correlates_as_stated() {
        let mut planner = RealFftPlanner::new();
        let n = 64;
        let window = window(n);
        let lines = spectrum(&mut planner, &vec![1.0; n], &window);
        assert!(lines[OF_CONSTANT..].iter().all(|l| l.norm() < 1e-12));
        // The window starts half a sample late, which turns line m by m pi / n.
        let squares = spectrum(&mut planner, &window, &window);
        for (m, correlation) in CORRELATION.iter().enumerate() {
            let turned = squares[m] * C::from_polar(1.0, -std::f64::consts::PI * m as f64 / n as f64);
            assert!(
                (turned.re / squares[0].re - correlation).abs() < 1e-9,
                "{m}: {turned}"
            );
        }
    }
}
