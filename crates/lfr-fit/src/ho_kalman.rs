//! The realisation of a polynomial in delta: its coefficients are an impulse response with delta in the place of the shift.

use crate::FitError;
use lpv_core::linalg::svd;
use nalgebra::DMatrix;

/// Singular values below this part of the largest are no direction.
const NOTHING: f64 = 1e-9;

/// `S_0 + left Delta (I - inner Delta)^-1 right` for `S(delta) = S_0 + S_1 delta + S_2 delta^2 + ...`, balanced.
#[derive(Debug, Clone)]
pub(crate) struct HoKalman {
    rows: usize,
    columns: usize,
    /// Singular values and vectors of the block Hankel matrix, as many as there are directions.
    values: Vec<f64>,
    u: DMatrix<f64>,
    v: DMatrix<f64>,
    /// `U^T H_1 V` of the shifted one.
    middle: DMatrix<f64>,
}

/// Matrices of a realisation.
pub(crate) struct Realisation {
    pub(crate) left: DMatrix<f64>,
    pub(crate) inner: DMatrix<f64>,
    pub(crate) right: DMatrix<f64>,
}

impl HoKalman {
    /// For the coefficients `S_1, S_2, ...`, at least one.
    pub(crate) fn new(coefficients: &[DMatrix<f64>]) -> Result<Self, FitError> {
        let first = coefficients
            .first()
            .ok_or(FitError::Empty { what: "coefficients" })?;
        let ((rows, columns), d) = (first.shape(), coefficients.len());
        let hankel = |shift: usize| {
            let mut h = DMatrix::zeros(rows * d, columns * d);
            for i in 0..d {
                for j in 0..d {
                    if let Some(s) = coefficients.get(i + j + shift) {
                        h.view_mut((i * rows, j * columns), (rows, columns)).copy_from(s);
                    }
                }
            }
            h
        };
        let svd = svd(hankel(0))?;
        let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
            return Err(FitError::NoConvergence {
                operation: "the singular values of a block Hankel matrix",
            });
        };
        let all = &svd.singular_values;
        let rank = all.iter().filter(|v| **v > NOTHING * all[0]).count();
        let (u, v) = (u.columns(0, rank).into_owned(), v.rows(0, rank).into_owned());
        Ok(Self {
            middle: u.transpose() * hankel(1) * v.transpose(),
            values: all.iter().take(rank).copied().collect(),
            rows,
            columns,
            u,
            v,
        })
    }

    /// Singular values, the largest first.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// With the first `size` directions, or all if there are fewer.
    pub(crate) fn cut(&self, size: usize) -> Realisation {
        let size = size.min(self.values.len());
        let roots: Vec<f64> = self.values.iter().take(size).map(|v| v.sqrt()).collect();
        Realisation {
            left: DMatrix::from_fn(self.rows, size, |i, a| self.u[(i, a)] * roots[a]),
            inner: DMatrix::from_fn(size, size, |a, b| self.middle[(a, b)] / (roots[a] * roots[b])),
            right: DMatrix::from_fn(size, self.columns, |a, j| self.v[(a, j)] * roots[a]),
        }
    }
}
