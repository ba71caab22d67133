//! One point of the search: given the denominator, the best numerators, the residual and the normal matrices.
//!
//! `F(z) = B(z) / (t(z) a(z))`, `t = (z-1)^m` fixed, `a = sum_j alpha_j p_j`, `B_c = sum_i beta_ci p_i`; the columns
//! of the Jacobian of the residual `r = F - B / (t a)` are `-p_i / (t a)` in channel `c` for `beta_ci` and
//! `B p_j / (t a^2)` for `alpha_j`.

use crate::PoleFitError;
use crate::basis::Basis;
use crate::moments::Products;
use crate::weights::Lines;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use num_complex::Complex;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// What stays the same during a fit.
#[derive(Debug)]
pub(crate) struct Setup<'a> {
    pub(crate) lines: &'a Lines,
    /// `(z - 1)^m` on the lines.
    pub(crate) t: Vec<C64>,
    pub(crate) order: usize,
    /// Number of coefficients `alpha`: order - m + 1.
    pub(crate) n_a: usize,
    /// Number of coefficients of a numerator.
    pub(crate) n_b: usize,
}

impl Setup<'_> {
    /// Real equations.
    pub(crate) fn equations(&self) -> usize {
        2 * self.lines.len() * self.lines.channels()
    }
    /// Real unknowns; the scale of the denominator is none.
    pub(crate) fn unknowns(&self) -> usize {
        self.lines.channels() * self.n_b + self.n_a - 1
    }
    /// The basis that makes the numerators' normal matrix nearly the identity at the denominator `a`.
    pub(crate) fn basis(&self, a: &[C64]) -> Result<Basis, PoleFitError> {
        let a = with_floor(a.to_vec());
        let mu: Vec<f64> = (0..a.len())
            .map(|k| self.lines.profile[k] / (self.t[k] * a[k]).norm_sqr())
            .collect();
        Basis::new(&self.lines.z, &mu, self.order)
    }
}

/// A root on a line would make the weight there infinite.
fn with_floor(mut a: Vec<C64>) -> Vec<C64> {
    let largest = a.iter().map(|v| v.norm_sqr()).fold(0.0, f64::max);
    for v in &mut a {
        if v.norm_sqr() < 1e-26 * largest {
            *v = C64::new(1e-13 * largest.sqrt(), 0.0);
        }
    }
    a
}

/// A denominator with its best numerators.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) alpha: DVector<f64>,
    /// Numerators, one column a channel.
    pub(crate) beta: DMatrix<f64>,
    /// `a` on the lines, and `1 / (t a)`.
    pub(crate) a: Vec<C64>,
    pub(crate) inverse: Vec<C64>,
    /// `F - B / (t a)`, line after line.
    pub(crate) residual: Vec<C64>,
    /// Weighted sum of squares `sum_k r^H K r`.
    pub(crate) cost: f64,
    h_bb: Cholesky<f64, Dyn>,
}

/// Normal matrix of the denominator after the numerators are eliminated.
pub(crate) struct Reduced {
    /// `H_aa - H_ab^T H_bb^-1 H_ab`.
    pub(crate) m: DMatrix<f64>,
    /// `H_bb^-1 H_ab`.
    pub(crate) elimination: DMatrix<f64>,
    /// Covariance of the equation error of noise with covariance `K^-1`, a factor apart.
    pub(crate) noise: DMatrix<f64>,
}

impl Point {
    pub(crate) fn new(
        setup: &Setup<'_>,
        basis: &Basis,
        products: &Products,
        alpha: DVector<f64>,
    ) -> Result<Self, PoleFitError> {
        let (lines, n_b) = (setup.lines, setup.n_b);
        let (n, n_c) = (lines.len(), lines.channels());
        let failed = PoleFitError::Numerators { order: setup.order };
        let a = with_floor(basis.combine(alpha.as_slice()));
        let inverse: Vec<C64> = (0..n).map(|k| (setup.t[k] * a[k]).inv()).collect();
        if !inverse.iter().all(|v| v.is_finite()) {
            return Err(failed);
        }
        let weight: Vec<f64> = (0..n)
            .map(|k| inverse[k].norm_sqr() / basis.root_mu[k].powi(2))
            .collect();
        let coupled = &lines.coupled;
        let mut real = vec![0.0; n * (n_c + coupled.len())];
        let mut imaginary = vec![0.0; n * coupled.len()];
        for k in 0..n {
            let line = &lines.k[k * n_c * n_c..(k + 1) * n_c * n_c];
            for c in 0..n_c {
                real[c * n + k] = weight[k] * line[c * n_c + c].re;
            }
            for (s, &(c, d)) in coupled.iter().enumerate() {
                let w = line[d * n_c + c] * weight[k];
                real[(n_c + s) * n + k] = w.re;
                imaginary[s * n + k] = w.im;
            }
        }
        let moments = products.sum(&real, &imaginary);
        let mut h = DMatrix::zeros(n_c * n_b, n_c * n_b);
        for c in 0..n_c {
            for j in 0..n_b {
                for i in 0..n_b {
                    h[(c * n_b + i, c * n_b + j)] = moments.real(i, j, c);
                }
            }
        }
        for (s, &(c, d)) in coupled.iter().enumerate() {
            for j in 0..n_b {
                for i in 0..n_b {
                    let value = moments.complex(i, j, n_c + s, s);
                    h[(c * n_b + i, d * n_b + j)] = value;
                    h[(d * n_b + j, c * n_b + i)] = value;
                }
            }
        }
        for i in 0..h.nrows() {
            h[(i, i)] *= 1.0 + 1e-14;
        }
        let h_bb = Cholesky::new(h).ok_or(failed.clone())?;
        let mut point = Self {
            alpha,
            beta: DMatrix::zeros(n_b, n_c),
            a,
            inverse,
            residual: lines.f.clone(),
            cost: 0.0,
            h_bb,
        };
        // The second pass is iterative refinement: its right-hand side comes from the residual itself, so that the
        // squared condition number of the normal matrix does not reach the solution.
        for _ in 0..2 {
            let mut step = DVector::zeros(n_c * n_b);
            let weighted = point.weighted_residual(lines);
            for c in 0..n_c {
                let x: Vec<C64> = (0..n)
                    .map(|k| point.inverse[k].conj() * weighted[k * n_c + c])
                    .collect();
                step.rows_mut(c * n_b, n_b).copy_from(&basis.correlate(n_b, &x));
            }
            point.h_bb.solve_mut(&mut step);
            for (b, s) in point.beta.iter_mut().zip(step.iter()) {
                *b += s;
            }
            for c in 0..n_c {
                let numerator = basis.combine(&point.beta.as_slice()[c * n_b..(c + 1) * n_b]);
                for k in 0..n {
                    point.residual[k * n_c + c] = lines.f[k * n_c + c] - numerator[k] * point.inverse[k];
                }
            }
        }
        let weighted = point.weighted_residual(lines);
        point.cost = inner(&point.residual, &weighted);
        if point.cost.is_finite() {
            Ok(point)
        } else {
            Err(failed)
        }
    }

    /// `B / (t a)` on the lines.
    pub(crate) fn model(&self, lines: &Lines) -> Vec<C64> {
        lines.f.iter().zip(&self.residual).map(|(f, r)| f - r).collect()
    }

    fn weighted_residual(&self, lines: &Lines) -> Vec<C64> {
        let n_c = lines.channels();
        let mut weighted = vec![ZERO; self.residual.len()];
        let pairs = self
            .residual
            .chunks_exact(n_c)
            .zip(weighted.chunks_exact_mut(n_c));
        for (k, (r, w)) in pairs.enumerate() {
            lines.apply_weight(k, r, w);
        }
        weighted
    }

    /// Half the gradient of the cost with respect to `alpha`; the one with respect to `beta` is zero here.
    pub(crate) fn gradient(&self, setup: &Setup<'_>, basis: &Basis) -> DVector<f64> {
        let lines = setup.lines;
        let n_c = lines.channels();
        let weighted = self.weighted_residual(lines);
        let model = self.model(lines);
        let x: Vec<C64> = (0..lines.len())
            .map(|k| {
                let range = k * n_c..(k + 1) * n_c;
                let sum: C64 = model[range.clone()]
                    .iter()
                    .zip(&weighted[range])
                    .map(|(g, w)| g.conj() * w)
                    .sum();
                sum / self.a[k].conj()
            })
            .collect();
        basis.correlate(setup.n_a, &x)
    }

    /// The reduced normal matrix. With `v` the model it is the Gauss-Newton one; with `v` the data it is that of the
    /// linearised problem `t a F - B`, divided by the present `t a` (Sanathanan, Koerner, 1963).
    pub(crate) fn reduce(
        &self,
        setup: &Setup<'_>,
        basis: &Basis,
        products: &Products,
        v: &[C64],
    ) -> Option<Reduced> {
        let (lines, n_a, n_b) = (setup.lines, setup.n_a, setup.n_b);
        let (n, n_c) = (lines.len(), lines.channels());
        let mut real = vec![0.0; n * (n_c + 2)];
        let mut imaginary = vec![0.0; n * n_c];
        let mut weighted = vec![ZERO; n_c];
        for k in 0..n {
            let line = &v[k * n_c..(k + 1) * n_c];
            lines.apply_weight(k, line, &mut weighted);
            let mu = basis.root_mu[k].powi(2);
            let factor = self.inverse[k].conj() / (self.a[k] * mu);
            for c in 0..n_c {
                let w = factor * weighted[c];
                real[c * n + k] = w.re;
                imaginary[c * n + k] = w.im;
            }
            let flat = 1.0 / (self.a[k].norm_sqr() * mu);
            real[n_c * n + k] = inner(line, &weighted) * flat;
            real[(n_c + 1) * n + k] = flat;
        }
        let moments = products.sum(&real, &imaginary);
        let h_aa = DMatrix::from_fn(n_a, n_a, |i, j| moments.real(i, j, n_c));
        let h_ab = DMatrix::from_fn(n_c * n_b, n_a, |row, j| {
            let (c, i) = (row / n_b, row % n_b);
            -moments.complex(i, j, c, c)
        });
        let mut w = h_ab;
        if !self.h_bb.l_dirty().solve_lower_triangular_mut(&mut w) {
            return None;
        }
        let m = h_aa - w.tr_mul(&w);
        let mut elimination = w;
        if !self
            .h_bb
            .l_dirty()
            .tr_solve_lower_triangular_mut(&mut elimination)
        {
            return None;
        }
        let noise = DMatrix::from_fn(n_a, n_a, |i, j| moments.real(i, j, n_c + 1));
        let finite = m.iter().chain(noise.iter()).all(|x| x.is_finite());
        finite.then_some(Reduced {
            m,
            elimination,
            noise,
        })
    }
}

/// `Re x^H y`.
fn inner(x: &[C64], y: &[C64]) -> f64 {
    x.iter().zip(y).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

#[cfg(test)]
mod tests;
