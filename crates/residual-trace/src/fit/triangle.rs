//! Least squares by a triangular factor.

use nalgebra::{DMatrix, DVector};

pub(crate) fn squares(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum()
}

/// Triangular factor of `[J r]`.
pub(crate) fn triangle(jacobian: &DMatrix<f64>, residual: &[f64]) -> DMatrix<f64> {
    let n = jacobian.ncols();
    let mut both = DMatrix::zeros(jacobian.nrows(), n + 1);
    both.columns_mut(0, n).copy_from(jacobian);
    both.column_mut(n).copy_from_slice(residual);
    both.qr().unpack_r()
}

/// Step that minimises `|R_11 s + r|^2 + damping |D s|^2`, D the lengths of the columns.
pub(crate) fn damped(r: &DMatrix<f64>, n: usize, damping: f64) -> DVector<f64> {
    let mut rows = DMatrix::zeros(2 * n, n);
    let mut right = DVector::zeros(2 * n);
    let lengths: Vec<f64> = (0..n).map(|j| r.column(j).norm().max(1e-30)).collect();
    for j in 0..n {
        for i in 0..=j {
            rows[(i, j)] = r[(i, j)] / lengths[j];
        }
        rows[(n + j, j)] = damping.sqrt();
        right[j] = -r[(j, n)];
    }
    let qr = rows.qr();
    let mut q = qr.q().transpose() * right;
    if !qr.r().solve_upper_triangular_mut(&mut q) {
        return DVector::zeros(n);
    }
    DVector::from_fn(n, |j, _| q[j] / lengths[j])
}

/// Standard deviations of the coordinates of a fit.
pub(crate) fn deviations(factor: &DMatrix<f64>) -> Vec<f64> {
    let n = factor.ncols();
    let lengths: Vec<f64> = (0..n).map(|j| factor.column(j).norm().max(1e-30)).collect();
    let scaled = DMatrix::from_fn(
        n,
        n,
        |i, j| if i <= j { factor[(i, j)] / lengths[j] } else { 0.0 },
    );
    match scaled.solve_upper_triangular(&DMatrix::identity(n, n)) {
        Some(inverse) => (0..n).map(|j| inverse.row(j).norm() / lengths[j]).collect(),
        None => vec![f64::INFINITY; n],
    }
}
