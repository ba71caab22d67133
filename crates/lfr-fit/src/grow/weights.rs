//! How much a change of `[A B; C D]` moves the relative response, on average.

use crate::FitError;
use lpv_core::linalg::symmetric_eigen;
use lpv_core::{Clock, Frf, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;

/// Averages over positions and lines of `l^H l / |G|` and `r r^H / |G|`, where `dF = l dS r` with
/// `l = [C (zI - A)^-1, I]` and `r = [(zI - A)^-1 B; I]`: the observability and controllability of a change, relative.
/// Without the rows of the outputs if only those of the states change.
pub(super) struct Weights {
    left: DMatrix<f64>,
    right: DMatrix<f64>,
    states: usize,
}

/// Directions that matter less than this part of the strongest weigh as much as it.
const FLOOR: f64 = 1e-8;

impl Weights {
    /// `rows` of S change: those of the states, or all.
    pub(super) fn new(states: usize, inputs: usize, rows: usize) -> Self {
        let columns = states + inputs;
        Self {
            left: DMatrix::zeros(rows, rows),
            right: DMatrix::zeros(columns, columns),
            states,
        }
    }

    /// Adds the lines of one position. Lines without a response do not count.
    pub(super) fn add<K: Clock>(&mut self, model: &StateSpace<K>, frf: &Frf) {
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
        let (n, nu) = (self.states, model.inputs());
        let (b, c) = (complex(model.b()), complex(model.c()));
        for (k, &f) in frf.frequencies_hz().iter().enumerate() {
            let mut resolvent = -complex(model.a());
            for i in 0..n {
                resolvent[(i, i)] += model.clock().point(f);
            }
            let scale = 1.0 / frf.line(k).norm();
            let Some(inverse) = resolvent.try_inverse() else {
                continue;
            };
            if !scale.is_finite() {
                continue;
            }
            let mut l = DMatrix::zeros(model.outputs(), self.left.nrows());
            l.columns_mut(0, n).copy_from(&(&c * &inverse));
            for i in n..l.ncols() {
                l[(i - n, i)] = Complex::new(1.0, 0.0);
            }
            let mut r = DMatrix::identity(n + nu, nu);
            r.rows_mut(0, n).copy_from(&(inverse * &b));
            r.view_mut((n, 0), (nu, nu)).copy_from(&DMatrix::identity(nu, nu));
            self.left += (l.adjoint() * l).map(|v| v.re * scale);
            self.right += (&r * r.adjoint()).map(|v| v.re * scale);
        }
    }

    /// Symmetric roots of both weights with their inverses.
    pub(super) fn roots(&self) -> Result<[DMatrix<f64>; 4], FitError> {
        let [left, left_inverse] = roots(&self.left)?;
        let [right, right_inverse] = roots(&self.right)?;
        Ok([left, left_inverse, right, right_inverse])
    }
}

/// The symmetric root of a weight, and its inverse.
pub(crate) fn roots(m: &DMatrix<f64>) -> Result<[DMatrix<f64>; 2], FitError> {
    let eigen = symmetric_eigen(m.clone())?;
    let floor = FLOOR * eigen.eigenvalues.max();
    // No weight at all: every direction alike.
    let roots = eigen
        .eigenvalues
        .map(|v| if floor > 0.0 { v.max(floor).sqrt() } else { 1.0 });
    let with = |values: nalgebra::DVector<f64>| {
        &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    Ok([with(roots.clone()), with(roots.map(f64::recip))])
}
