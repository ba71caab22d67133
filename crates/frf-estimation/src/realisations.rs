//! Robust method: variance over realisations against variance over periods.

use nalgebra::{DMatrix, SymmetricEigen};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Standard deviations of the averaged output of one experiment about `F U`, by line, then by output, in the unit of the
/// output's amplitude spectrum. Multiply by `sqrt(S_jj)` of the estimate for the deviation of the FRF entry `(i, j)`.
#[derive(Debug, Clone, PartialEq)]
pub struct RealisationDistortion {
    /// Number of realisations, `n_e / n_u` rounded down.
    pub realisations: usize,
    /// From experiment to experiment, that is noise and nonlinear distortion, averaged over neighbouring lines.
    pub total: Vec<f64>,
    /// From period to period: noise.
    pub noise: Vec<f64>,
    /// `sqrt(total^2 - noise^2)` averaged over neighbouring lines, zero where negative.
    pub nonlinear: Vec<f64>,
    /// Root mean square of `nonlinear` over all lines, relative to that of the output, by output.
    pub nonlinear_relative: Vec<f64>,
}

/// Residuals `V = Y - F U` of all lines; with `H = I - G U`, `E[V V^H] = C_total tr(H H^H)`.
pub(crate) struct Residuals {
    outputs: usize,
    experiments: usize,
    inputs: usize,
    total: Vec<C64>,
    noise: Vec<C64>,
    power: Vec<f64>,
    lines: usize,
}

/// Result of the averaging over lines.
pub(crate) struct Smoothed {
    pub(crate) nonlinear: Vec<C64>,
    pub(crate) degrees_of_freedom: f64,
    pub(crate) distortion: RealisationDistortion,
}

impl Residuals {
    pub(crate) fn new(outputs: usize, experiments: usize) -> Self {
        Self {
            outputs,
            experiments,
            inputs: 1,
            total: Vec::new(),
            noise: Vec::new(),
            power: vec![0.0; outputs],
            lines: 0,
        }
    }

    /// Takes the line with spectra `Y` and `U`, response `f`, gain `g` and noise covariance `noise`.
    pub(crate) fn push(&mut self, [y, u]: [&[C64]; 2], f: &[C64], g: &[C64], noise: &[C64]) {
        let (ny, ne) = (self.outputs, self.experiments);
        let nu = g.len() / ne;
        self.inputs = nu;
        let mut trace = 0.0;
        for e in 0..ne {
            for d in 0..ne {
                let gu: C64 = (0..nu).map(|j| g[j * ne + d] * u[e * nu + j]).sum();
                trace += (if d == e { 1.0 - gu } else { -gu }).norm_sqr();
            }
        }
        let start = self.total.len();
        self.total.resize(start + ny * ny, C64::new(0.0, 0.0));
        let out = &mut self.total[start..];
        for e in 0..ne {
            let v = |i: usize| -> C64 {
                let through: C64 = (0..nu).map(|j| f[j * ny + i] * u[e * nu + j]).sum();
                y[e * ny + i] - through
            };
            for k in 0..ny {
                let vk = v(k).conj();
                for i in 0..ny {
                    out[k * ny + i] += v(i) * vk / trace;
                }
                self.power[k] += y[e * ny + k].norm_sqr() / ne as f64;
            }
        }
        self.noise.extend_from_slice(noise);
        self.lines += 1;
    }

    /// Averages `C_total - C_noise` over `2 half + 1` lines (fewer at the ends) and keeps its positive part.
    pub(crate) fn smooth(self, half: usize, ny: usize) -> Smoothed {
        let size = ny * ny;
        let mut nonlinear = Vec::with_capacity(self.total.len());
        let (mut total, mut noise, mut level) = (Vec::new(), Vec::new(), Vec::new());
        let mut sums = vec![0.0; ny];
        for l in 0..self.lines {
            let (low, high) = (l.saturating_sub(half), (l + half + 1).min(self.lines));
            let mut mean_total = DMatrix::<C64>::zeros(ny, ny);
            let mut excess = DMatrix::<C64>::zeros(ny, ny);
            for w in low..high {
                for (i, (t, n)) in self.total[w * size..(w + 1) * size]
                    .iter()
                    .zip(&self.noise[w * size..(w + 1) * size])
                    .enumerate()
                {
                    mean_total[i] += t / (high - low) as f64;
                    excess[i] += (t - n) / (high - low) as f64;
                }
            }
            let excess = positive_part(excess);
            for i in 0..ny {
                let e = excess[(i, i)].re.max(0.0);
                sums[i] += e;
                level.push(e.sqrt());
                total.push(mean_total[(i, i)].re.max(0.0).sqrt());
                noise.push(self.noise[l * size + i * ny + i].re.sqrt());
            }
            nonlinear.extend_from_slice(excess.as_slice());
        }
        let relative = |(e, s): (&f64, &f64)| if *e == 0.0 { 0.0 } else { (e / s).sqrt() };
        let window = (half + 1).min(self.lines) as f64;
        Smoothed {
            nonlinear,
            // The window at either end is the narrowest.
            degrees_of_freedom: window * (self.experiments - self.inputs) as f64,
            distortion: RealisationDistortion {
                realisations: self.experiments / self.inputs,
                total,
                noise,
                nonlinear: level,
                nonlinear_relative: sums.iter().zip(&self.power).map(relative).collect(),
            },
        }
    }
}

/// The Hermitian matrix without its negative eigenvalues; channels are scaled first, so that units do not count.
fn positive_part(m: DMatrix<C64>) -> DMatrix<C64> {
    let n = m.nrows();
    let scale: Vec<f64> = (0..n).map(|i| m[(i, i)].re.abs().sqrt()).collect();
    if scale.iter().any(|s| *s == 0.0 || !s.is_finite()) {
        return DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                C64::new(m[(i, i)].re.max(0.0), 0.0)
            } else {
                C64::new(0.0, 0.0)
            }
        });
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| m[(i, j)] / (scale[i] * scale[j]));
    if n == 1 {
        return m.map(|v| C64::new(v.re.max(0.0), 0.0));
    }
    let Some(eigen) = SymmetricEigen::try_new(scaled, f64::EPSILON, 200) else {
        return DMatrix::zeros(n, n);
    };
    let mut out = DMatrix::zeros(n, n);
    for (value, q) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > 0.0 {
            out += q * q.adjoint() * C64::new(*value, 0.0);
        }
    }
    DMatrix::from_fn(n, n, |i, j| out[(i, j)] * scale[i] * scale[j])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positive_part_keeps_and_clips() {
        let c = |re, im| C64::new(re, im);
        let keep = DMatrix::from_row_slice(2, 2, &[c(2.0, 0.0), c(0.0, 1.0), c(0.0, -1.0), c(3.0, 0.0)]);
        assert!((positive_part(keep.clone()) - keep).norm() < 1e-12);
        // diag(4, -1) by hand.
        let clip = DMatrix::from_row_slice(2, 2, &[c(4.0, 0.0), c(0.0, 0.0), c(0.0, 0.0), c(-1.0, 0.0)]);
        let clipped = positive_part(clip);
        assert!((clipped[(0, 0)] - 4.0).norm() < 1e-12 && clipped[(1, 1)].norm() < 1e-12);
        assert_eq!(
            positive_part(DMatrix::from_element(1, 1, c(-2.0, 0.0)))[0],
            c(0.0, 0.0)
        );
        assert!(positive_part(DMatrix::from_element(2, 2, c(f64::NAN, 0.0)))[(0, 1)].norm() == 0.0);
    }
}
