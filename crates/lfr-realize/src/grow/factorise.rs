//! A start from a polynomial through frozen models: its coefficients factorised into channels.

use super::coherent::Coherent;
use crate::candidate::Shape;
use crate::problem::Problem;
use crate::sampling::Sampling;
use crate::{Candidate, Channel, FrozenData, RealizeError};
use nalgebra::{DMatrix, DVector};

/// Highest power of a parameter in the polynomial.
const DEGREE: usize = 3;

/// Spectral radius above which the D11 of a start is scaled down, so that it is well-posed.
const LARGEST_D11: f64 = 0.9;

/// A channel whose singular value is below this part of the largest keeps its random entries.
const WEAK: f64 = 1e-9;

impl<K: Sampling> Coherent<K> {
    /// The LFR of a polynomial `S = S_0 + sum_i sum_k S_ik delta_i^k` through the models. For each parameter the
    /// coefficients are Markov parameters `S_k = L D^(k-1) R`, so that a truncated singular value decomposition of
    /// their Hankel matrix gives as many channels as there are deltas (Ho and Kalman, 1966), weighted by what the rows
    /// and columns of S do to the response. What is lacking beyond the rank stays as in `base`.
    pub(super) fn factorised(&self, base: Candidate<K>) -> Result<Candidate<K>, RealizeError> {
        let (a, b) = (self.shape.rows(), self.shape.columns());
        let parameters = self.range.normalise(&self.range.centre()).len();
        let powers: Vec<(usize, usize)> = (0..parameters)
            .flat_map(|i| (1..=self.degree(i)).map(move |k| (i, k)))
            .collect();
        let regressors = DMatrix::from_fn(self.models.len(), powers.len() + 1, |row, column| {
            let power = column.checked_sub(1).map(|at| powers[at]);
            power.map_or(1.0, |(i, k)| self.models[row].0[i].powi(k as i32))
        });
        let values = DMatrix::from_fn(self.models.len(), a * b, |row, column| self.models[row].1[column]);
        let failed = || RealizeError::NoConvergence {
            operation: "the polynomial through the local models",
        };
        let svd = regressors
            .try_svd(true, true, f64::EPSILON, 1000)
            .ok_or_else(failed)?;
        let coefficients = svd.solve(&values, 1e-12).map_err(|_| failed())?;
        let coefficient = |at: usize| DMatrix::from_fn(a, b, |i, j| coefficients[(at, j * a + i)]);
        let mut m = base.matrix().clone();
        m.view_mut((0, 0), (a, b)).copy_from(&coefficient(0));
        for parameter in 0..parameters {
            let channels: Vec<usize> = (0..base.channels().len())
                .filter(|&j| base.channels()[j] == Channel::Parameter(parameter))
                .collect();
            let markov: Vec<DMatrix<f64>> = (0..powers.len())
                .filter(|&at| powers[at].0 == parameter)
                .map(|at| coefficient(at + 1))
                .collect();
            let Some(parts) = self.ho_kalman(&markov, channels.len()) else {
                continue;
            };
            for (k, &channel) in channels.iter().take(parts.d.nrows()).enumerate() {
                for i in 0..a {
                    m[(i, b + channel)] = parts.l[(i, k)];
                }
                for j in 0..b {
                    m[(a + channel, j)] = parts.r[(k, j)];
                }
                for (l, &other) in channels.iter().take(parts.d.nrows()).enumerate() {
                    m[(a + channel, b + other)] = parts.d[(k, l)];
                }
            }
        }
        // What the mask fixes stays.
        let (old, free) = (base.matrix(), base.free());
        let m = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
            if free[(i, j)] { m[(i, j)] } else { old[(i, j)] }
        });
        Ok(base.with_matrix(m))
    }

    fn ho_kalman(&self, markov: &[DMatrix<f64>], channels: usize) -> Option<Realised> {
        let (a, b, q) = (self.shape.rows(), self.shape.columns(), markov.len());
        if q == 0 || channels == 0 {
            return None;
        }
        let mut hankel = DMatrix::zeros(a * q, b * q);
        for i in 0..q {
            for j in 0..q - i {
                let mut block = hankel.view_mut((i * a, j * b), (a, b));
                block.copy_from(&markov[i + j]);
                for (mut row, weight) in block.row_iter_mut().zip(self.row_weight.iter()) {
                    row *= *weight;
                }
                for (mut column, weight) in block.column_iter_mut().zip(self.column_weight.iter()) {
                    column *= *weight;
                }
            }
        }
        let svd = hankel.try_svd(true, true, f64::EPSILON, 1000)?;
        let (u, v, values) = (svd.u?, svd.v_t?, svd.singular_values);
        let rank = values
            .iter()
            .take(channels)
            .filter(|v| **v > WEAK * values[0])
            .count();
        let root = DMatrix::from_diagonal(&values.rows(0, rank).map(f64::sqrt));
        let (observe, control) = (u.columns(0, rank) * &root, &root * v.rows(0, rank));
        let mut d = DMatrix::zeros(rank, rank);
        if q > 1 {
            let (up, down) = (observe.rows(0, (q - 1) * a), observe.rows(a, (q - 1) * a));
            d = up
                .into_owned()
                .try_svd(true, true, f64::EPSILON, 1000)?
                .solve(&down, 1e-9)
                .ok()?;
            let radius = lpv_core::linalg::eigenvalues(&d).ok()?;
            let radius = radius.iter().map(|l| l.norm()).fold(0.0, f64::max);
            if radius > LARGEST_D11 {
                d *= LARGEST_D11 / radius;
            }
        }
        Some(Realised {
            l: DMatrix::from_fn(a, rank, |i, k| observe[(i, k)] / self.row_weight[i]),
            r: DMatrix::from_fn(rank, b, |k, j| control[(k, j)] / self.column_weight[j]),
            d,
        })
    }

    /// The highest power that the values of a parameter tell from lower ones.
    fn degree(&self, parameter: usize) -> usize {
        let mut values: Vec<f64> = self.models.iter().map(|(delta, _)| delta[parameter]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup_by(|a, b| *a - *b < 1e-9);
        DEGREE.min(values.len() - 1)
    }
}

/// `sum_k L D^(k-1) R delta^k`.
struct Realised {
    l: DMatrix<f64>,
    d: DMatrix<f64>,
    r: DMatrix<f64>,
}

/// Weights of the rows and columns of S whose products come nearest, in logarithms, to the lengths of the columns of the
/// Jacobian.
pub(super) fn sensitivity<K: Sampling>(
    fitted: &Candidate<K>,
    rigid: usize,
    shape: Shape,
    data: &FrozenData,
) -> Result<(DVector<f64>, DVector<f64>), RealizeError> {
    let problem = Problem::new(fitted, data)?;
    let theta = problem.theta(fitted);
    let linear = problem.linearise(&theta).ok_or_else(|| problem.no_start())?;
    let lengths = linear.jacobian.column_iter().map(|c| c.norm().ln());
    let entries: Vec<((usize, usize), f64)> = fitted
        .free_entries()
        .into_iter()
        .map(|(i, j)| (i - rigid, j - rigid))
        .zip(lengths)
        .filter(|(_, length)| length.is_finite())
        .collect();
    let (mut rows, mut columns) = (DVector::zeros(shape.rows()), DVector::zeros(shape.columns()));
    for _ in 0..10 {
        rows = means(rows.len(), entries.iter().map(|&((i, j), v)| (i, v - columns[j])));
        columns = means(columns.len(), entries.iter().map(|&((i, j), v)| (j, v - rows[i])));
    }
    Ok((rows.map(f64::exp), columns.map(f64::exp)))
}

fn means(size: usize, values: impl Iterator<Item = (usize, f64)>) -> DVector<f64> {
    let (mut sum, mut count) = (DVector::<f64>::zeros(size), vec![0.0_f64; size]);
    for (at, v) in values {
        sum[at] += v;
        count[at] += 1.0;
    }
    DVector::from_fn(size, |i, _| sum[i] / count[i].max(1.0))
}

#[cfg(test)]
mod tests;
