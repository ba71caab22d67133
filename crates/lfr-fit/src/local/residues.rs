//! Residues of known poles, and the modal form that they make.

use super::LocalMode;
use crate::sampling::Sampling;
use crate::{FitError, FrozenData};
use lpv_core::{CoreError, Frf, StateSpace};
use lpv_numerics::dense::triangle_of;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

type C64 = Complex<f64>;

/// What there is beside the modes.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Beside<'a> {
    Nothing,
    /// Double integrators, whose gain is found along with the residues.
    Gain,
    /// This response.
    Known(&'a Frf),
}

/// `F = gamma phi + sum_i R_i phi_i + conj(R_i phi_i)`, fitted with the relative weight `1 / ||G||_F` a line.
pub(crate) struct Residues {
    poles: Vec<C64>,
    /// `phi_i` on the lines of the data.
    fractions: Vec<Vec<C64>>,
    gamma: DMatrix<f64>,
    residues: Vec<DMatrix<C64>>,
}

impl Residues {
    pub(crate) fn new<K: Sampling>(
        clock: K,
        data: &FrozenData,
        poles: &[C64],
        beside: Beside<'_>,
    ) -> Result<Self, FitError> {
        let has_rigid = beside == Beside::Gain;
        let position = &data.positions()[0];
        let (frf, z) = (&position.frf, &position.z);
        let (ny, nu) = (frf.outputs(), frf.inputs());
        let ts = data.clock();
        let t = ts.sample_time();
        let fractions: Vec<Vec<C64>> = poles
            .iter()
            .map(|&pole| {
                let own = clock.pole_of_sampled(pole, ts);
                z.iter().map(|&z| clock.partial_fraction(own, z, ts)).collect()
            })
            .collect();
        // Columns: the rigid body, then for each mode the real and the imaginary part of its residue.
        let mut columns: Vec<Vec<C64>> = Vec::new();
        if has_rigid {
            let phi = z
                .iter()
                .map(|z| (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (0.5 * t * t));
            columns.push(phi.collect());
        }
        for (pole, phi) in poles.iter().zip(&fractions) {
            if pole.im > 0.0 {
                let conjugate = clock.pole_of_sampled(pole.conj(), ts);
                let other: Vec<C64> = z
                    .iter()
                    .map(|&z| clock.partial_fraction(conjugate, z, ts))
                    .collect();
                let i = C64::i();
                columns.push(phi.iter().zip(&other).map(|(a, b)| a + b).collect());
                columns.push(phi.iter().zip(&other).map(|(a, b)| i * (a - b)).collect());
            } else {
                columns.push(phi.clone());
            }
        }
        if let Some((k, _)) = z
            .iter()
            .enumerate()
            .find(|(k, _)| columns.iter().any(|c| !c[*k].norm().is_finite()))
        {
            return Err(CoreError::PoleOnLine {
                frequency_hz: frf.frequencies_hz()[k],
            }
            .into());
        }
        let solution = weighted_solution(&columns, frf, beside)?;
        let matrix = |row: usize| DMatrix::from_fn(ny, nu, |o, u| solution[(row, u * ny + o)]);
        let gamma = if has_rigid {
            matrix(0)
        } else {
            DMatrix::zeros(ny, nu)
        };
        let mut row = usize::from(has_rigid);
        let residues = poles.iter().map(|pole| {
            let re = matrix(row);
            let im = if pole.im > 0.0 {
                matrix(row + 1)
            } else {
                DMatrix::zeros(ny, nu)
            };
            row += if pole.im > 0.0 { 2 } else { 1 };
            re.zip_map(&im, C64::new)
        });
        Ok(Self {
            residues: residues.collect(),
            poles: poles.to_vec(),
            fractions,
            gamma,
        })
    }

    pub(super) fn mode(&self, i: usize, frf: &Frf) -> LocalMode {
        let (residue, phi) = (&self.residues[i], &self.fractions[i]);
        let factor = if self.poles[i].im > 0.0 { 2.0 } else { 1.0 };
        let share = |k: usize| {
            let part = residue.norm() * phi[k].norm() * factor;
            (part / frf.line(k).norm().max(f64::MIN_POSITIVE)).powi(2)
        };
        let sum: f64 = (0..frf.len()).map(share).sum();
        let values = residue.clone().singular_values();
        let second = values.iter().nth(1).copied().unwrap_or(0.0);
        LocalMode {
            pole: self.poles[i],
            share: (sum / frf.len() as f64).sqrt(),
            second_rank: second / values.max().max(f64::MIN_POSITIVE),
            kept: true,
        }
    }

    /// The modal form with rank-one residues `R_i = c_i b_i`: for a pair with the pole `s = sigma + j omega`,
    /// `A = [sigma, -omega; omega, sigma]`, `B = sqrt(2) [Re b; Im b]`, `C = sqrt(2) [Re c, -Im c]`, `||b|| = ||c||`.
    pub(crate) fn realise<K: Sampling>(
        &self,
        clock: K,
        data: &FrozenData,
    ) -> Result<(StateSpace<K>, DMatrix<f64>), FitError> {
        let (ny, nu) = self.gamma.shape();
        let n = self.poles.iter().map(|p| if p.im > 0.0 { 2 } else { 1 }).sum();
        let (mut a, mut b, mut c) = (DMatrix::zeros(n, n), DMatrix::zeros(n, nu), DMatrix::zeros(ny, n));
        let mut at = 0;
        for (pole, residue) in self.poles.iter().zip(&self.residues) {
            let s = clock.pole_of_sampled(*pole, data.clock());
            let failed = || FitError::NoConvergence {
                operation: "the singular values of a residue",
            };
            let svd = lpv_core::linalg::svd(residue.clone())?;
            let (Some(u), Some(v)) = (&svd.u, &svd.v_t) else {
                return Err(failed());
            };
            let first = svd.singular_values.imax();
            let root = svd.singular_values[first].sqrt();
            let out: DVector<C64> = u.column(first) * C64::from(root);
            let into = v.row(first) * C64::from(root);
            a[(at, at)] = s.re;
            if pole.im > 0.0 {
                let two = std::f64::consts::SQRT_2;
                a[(at, at + 1)] = -s.im;
                a[(at + 1, at)] = s.im;
                a[(at + 1, at + 1)] = s.re;
                for (j, v) in into.iter().enumerate() {
                    (b[(at, j)], b[(at + 1, j)]) = (two * v.re, two * v.im);
                }
                for (i, v) in out.iter().enumerate() {
                    (c[(i, at)], c[(i, at + 1)]) = (two * v.re, -two * v.im);
                }
                at += 2;
            } else {
                // A real matrix may come with a common phase in its complex factors.
                let largest = into
                    .iter()
                    .copied()
                    .max_by(|a, b| a.norm_sqr().total_cmp(&b.norm_sqr()))
                    .unwrap_or(C64::from(1.0));
                let phase = largest / largest.norm().max(f64::MIN_POSITIVE);
                into.iter()
                    .enumerate()
                    .for_each(|(j, v)| b[(at, j)] = (v / phase).re);
                out.iter()
                    .enumerate()
                    .for_each(|(i, v)| c[(i, at)] = (v * phase).re);
                at += 1;
            }
        }
        let flexible = StateSpace::new(a, b, c, DMatrix::zeros(ny, nu), clock)?;
        Ok((flexible, self.gamma.clone()))
    }
}

/// Least squares with one right-hand side a channel, every line divided by the size of the response there.
fn weighted_solution(columns: &[Vec<C64>], frf: &Frf, beside: Beside<'_>) -> Result<DMatrix<f64>, FitError> {
    let (lines, size, channels) = (frf.len(), columns.len(), frf.outputs() * frf.inputs());
    if 2 * lines < size {
        return Err(FitError::TooFewEquations {
            equations: 2 * lines * channels,
            unknowns: size * channels,
        });
    }
    let mut all = DMatrix::zeros(2 * lines, size + channels);
    for k in 0..lines {
        let weight = 1.0 / frf.line(k).norm().max(f64::MIN_POSITIVE);
        let known = columns.iter().map(|c| c[k]);
        let wanted = frf.line_slice(k).iter().enumerate().map(|(at, v)| match beside {
            Beside::Known(part) => v - part.line_slice(k)[at],
            Beside::Nothing | Beside::Gain => *v,
        });
        for (j, v) in known.chain(wanted).enumerate() {
            all[(k, j)] = v.re * weight;
            all[(lines + k, j)] = v.im * weight;
        }
    }
    let scale: Vec<f64> = (0..size)
        .map(|j| all.column(j).norm().max(f64::MIN_POSITIVE))
        .collect();
    for (j, s) in scale.iter().enumerate() {
        all.column_mut(j).unscale_mut(*s);
    }
    let factor = triangle_of(size + channels, std::iter::once(&all));
    let r = factor.view((0, 0), (size, size));
    let mut solution = r
        .solve_upper_triangular(&factor.view((0, size), (size, channels)))
        .filter(|x| x.iter().all(|v| v.is_finite()))
        .ok_or(FitError::NoConvergence {
            operation: "the fit of the residues (two poles are equal)",
        })?;
    for (mut row, s) in solution.row_iter_mut().zip(&scale) {
        row.unscale_mut(*s);
    }
    Ok(solution)
}
