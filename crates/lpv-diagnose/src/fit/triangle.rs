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

/// Step that minimises `|R_11 s + r|^2 + damping |D s|^2`, D the lengths of the columns; none where a column is zero.
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
    let step = |j: usize| {
        if lengths[j] > 1e-30 {
            q[j] / lengths[j]
        } else {
            0.0
        }
    };
    DVector::from_fn(n, |j, _| step(j))
}

/// Standard deviations of the coordinates of a fit, infinite where a column is zero; all are where the others are dependent.
pub(crate) fn deviations(factor: &DMatrix<f64>) -> Vec<f64> {
    let lengths: Vec<f64> = factor.column_iter().map(|c| c.norm()).collect();
    let seen: Vec<usize> = (0..lengths.len()).filter(|j| lengths[*j] > 1e-30).collect();
    let mut all = vec![f64::INFINITY; lengths.len()];
    let scaled = DMatrix::from_fn(factor.nrows(), seen.len(), |i, j| {
        factor[(i, seen[j])] / lengths[seen[j]]
    });
    let scaled = if seen.len() < lengths.len() {
        scaled.qr().unpack_r()
    } else {
        scaled
    };
    let n = seen.len();
    if let Some(inverse) = scaled.solve_upper_triangular(&DMatrix::identity(n, n)) {
        for (i, j) in seen.into_iter().enumerate() {
            all[j] = inverse.row(i).norm() / lengths[j];
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::{damped, deviations, triangle};
    use nalgebra::DMatrix;

    /// `y = 3 + 2 x` at x = -1, 0, 1, with a parameter in between that does nothing.
    #[test]
    fn a_parameter_that_is_not_seen_leaves_the_others_alone() {
        let rows = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, -1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let r = triangle(&rows, &[-1.0, -3.0, -5.0]);
        let step = damped(&r, 3, 1e-20);
        assert!((step[0] - 3.0).abs() < 1e-12 && (step[2] - 2.0).abs() < 1e-12);
        assert_eq!(step[1], 0.0);
        let found = deviations(&r.view((0, 0), (3, 3)).into_owned());
        let expected = [(1.0_f64 / 3.0).sqrt(), f64::INFINITY, 0.5_f64.sqrt()];
        for (a, b) in found.iter().zip(expected) {
            assert!(*a == b || (a - b).abs() < 1e-14, "{a} {b}");
        }
    }
}
