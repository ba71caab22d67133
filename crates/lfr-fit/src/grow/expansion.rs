//! A polynomial in the deltas, and the few channels that realise most of it.

use super::weights::Weights;
use crate::ho_kalman::HoKalman;
use crate::{Channel, FitError};
use lpv_core::linalg::{eigenvalues, least_squares, svd};
use nalgebra::DMatrix;

/// `S(delta) = sum S_m delta^m` in monomials of a largest total degree, fitted to samples by least squares.
pub(super) struct Expansion {
    monomials: Vec<Vec<usize>>,
    coefficients: Vec<DMatrix<f64>>,
    degree: usize,
}

/// Channels of an LFR, `S = S_0 + left Delta (I - inner Delta)^-1 right`.
pub(super) struct Channels {
    pub(super) left: DMatrix<f64>,
    pub(super) inner: DMatrix<f64>,
    pub(super) right: DMatrix<f64>,
    /// Channels that the expansion had a direction for.
    pub(super) found: Vec<bool>,
}

/// Spectral radius above which the D11 of a start is scaled down, so that it is well-posed.
const LARGEST_D11: f64 = 0.9;

impl Expansion {
    /// The largest degree that this many samples determine with a third of them to spare: a polynomial through all of
    /// them swings between them.
    pub(super) fn largest_degree(parameters: usize, samples: usize) -> usize {
        let fits = |degree: &usize| 3 * monomials(parameters, *degree).len() <= 2 * samples;
        (1..samples).take_while(fits).last().unwrap_or(0)
    }

    /// Of at most this degree.
    pub(super) fn new(
        places: &[Vec<f64>],
        samples: &[DMatrix<f64>],
        degree: usize,
    ) -> Result<Self, FitError> {
        let first = samples.first().ok_or(FitError::Empty { what: "positions" })?;
        let parameters = places.first().map_or(0, Vec::len);
        let degree = degree.min(Self::largest_degree(parameters, places.len()));
        let monomials = monomials(parameters, degree);
        let value = |place: &[f64], powers: &[usize]| -> f64 {
            place.iter().zip(powers).map(|(d, &k)| d.powi(k as i32)).product()
        };
        let design = DMatrix::from_fn(places.len(), monomials.len(), |i, m| {
            value(&places[i], &monomials[m])
        });
        let targets = DMatrix::from_fn(places.len(), first.len(), |i, j| samples[i][j]);
        let solved = least_squares(design, &targets, 1e-10).map_err(|_| FitError::NoConvergence {
            operation: "the polynomial through the local models",
        })?;
        let shape = first.shape();
        let coefficients = (0..monomials.len())
            .map(|m| DMatrix::from_iterator(shape.0, shape.1, solved.row(m).iter().copied()));
        Ok(Self {
            coefficients: coefficients.collect(),
            monomials,
            degree,
        })
    }

    pub(super) fn constant(&self) -> &DMatrix<f64> {
        &self.coefficients[0]
    }

    fn coefficient(&self, powers: &[usize]) -> Option<&DMatrix<f64>> {
        let at = self.monomials.iter().position(|m| m == powers)?;
        Some(&self.coefficients[at])
    }

    /// For each parameter alone, `S_1, S_2, ...` is an impulse response in `delta`: its Hankel matrix, cut to as many
    /// singular values as there are channels, gives a balanced realisation (Ho and Kalman). What two parameters do
    /// together goes into the blocks of `inner` between them, by least squares.
    pub(super) fn channels(&self, weights: &Weights, channels: &[Channel]) -> Result<Channels, FitError> {
        let [left, left_inverse, right, right_inverse] = weights.roots()?;
        let (rows, columns) = self.constant().shape();
        let nc = channels.len();
        let mut all = Channels {
            left: DMatrix::zeros(rows, nc),
            inner: DMatrix::zeros(nc, nc),
            right: DMatrix::zeros(nc, columns),
            found: vec![false; nc],
        };
        let parameters = self.monomials[0].len();
        let weighted = |powers: &[usize]| self.coefficient(powers).map(|s| &left * s * &right);
        for parameter in 0..parameters {
            let own: Vec<usize> = (0..nc)
                .filter(|&j| channels[j] == Channel::Parameter(parameter))
                .collect();
            if own.is_empty() || self.degree == 0 {
                continue;
            }
            let power = |k: usize| {
                let mut powers = vec![0; parameters];
                powers[parameter] = k;
                weighted(&powers).unwrap_or_else(|| DMatrix::zeros(rows, columns))
            };
            let powers: Vec<DMatrix<f64>> = (1..=self.degree).map(power).collect();
            let found = HoKalman::new(&powers)?.cut(own.len());
            let rank = found.inner.nrows();
            for (a, &i) in own.iter().take(rank).enumerate() {
                all.found[i] = true;
                all.left.column_mut(i).copy_from(&found.left.column(a));
                all.right.row_mut(i).copy_from(&found.right.row(a));
                for (b, &j) in own.iter().take(rank).enumerate() {
                    all.inner[(i, j)] = found.inner[(a, b)];
                }
            }
        }
        self.cross(&mut all, channels, weighted)?;
        let radius = eigenvalues(&all.inner)?;
        let radius = radius.iter().map(|l| l.norm()).fold(0.0, f64::max);
        if radius > LARGEST_D11 {
            all.inner *= LARGEST_D11 / radius;
        }
        all.left = left_inverse * all.left;
        all.right *= right_inverse;
        Ok(all)
    }

    /// `S_ij = L_i X_ij R_j + L_j X_ji R_i` for the product of parameters i and j.
    fn cross(
        &self,
        all: &mut Channels,
        channels: &[Channel],
        weighted: impl Fn(&[usize]) -> Option<DMatrix<f64>>,
    ) -> Result<(), FitError> {
        let parameters = self.monomials[0].len();
        for first in 0..parameters {
            for second in first + 1..parameters {
                let mut powers = vec![0; parameters];
                (powers[first], powers[second]) = (1, 1);
                let Some(product) = weighted(&powers) else {
                    continue;
                };
                let of = |j: usize, p: usize| channels[j] == Channel::Parameter(p);
                let pairs: Vec<(usize, usize)> = (0..channels.len())
                    .flat_map(|i| (0..channels.len()).map(move |j| (i, j)))
                    .filter(|&(i, j)| (of(i, first) && of(j, second)) || (of(i, second) && of(j, first)))
                    .filter(|&(i, j)| all.found[i] && all.found[j])
                    .collect();
                if pairs.is_empty() {
                    continue;
                }
                let outer = pairs.iter().map(|&(i, j)| {
                    let term = all.left.column(i) * all.right.row(j);
                    nalgebra::DVector::from_column_slice(term.as_slice())
                });
                let design = DMatrix::from_columns(&outer.collect::<Vec<_>>());
                let target = nalgebra::DVector::from_column_slice(product.as_slice());
                let svd = svd(design)?;
                let cut = 1e-6 * svd.singular_values.max();
                let solved = svd.solve(&target, cut).map_err(|_| FitError::NoConvergence {
                    operation: "the products of parameters in the local models",
                })?;
                for (&(i, j), v) in pairs.iter().zip(solved.iter()) {
                    all.inner[(i, j)] = *v;
                }
            }
        }
        Ok(())
    }
}

/// Exponents of all monomials of a total degree up to `degree`, the constant first.
fn monomials(parameters: usize, degree: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![]];
    for _ in 0..parameters {
        all = all
            .into_iter()
            .flat_map(|m: Vec<usize>| {
                let left = degree - m.iter().sum::<usize>();
                (0..=left).map(move |k| m.iter().copied().chain([k]).collect())
            })
            .collect();
    }
    all
}

#[cfg(test)]
mod tests;
