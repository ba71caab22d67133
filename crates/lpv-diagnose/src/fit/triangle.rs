//! What the triangular factor of a linearisation tells.

use lpv_numerics::least_squares::Quadratic;
use nalgebra::DMatrix;

pub(crate) fn squares(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum()
}

/// Upper triangle with `R^T R = J^T J` of a linearisation without tangents, in its coordinates.
pub(crate) fn in_coordinates(quadratic: &Quadratic) -> DMatrix<f64> {
    let mut factor = quadratic.r.clone();
    for (j, mut column) in factor.column_iter_mut().enumerate() {
        column /= quadratic.map[(j, j)];
    }
    factor
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
    use super::*;
    use nalgebra::dvector;

    /// `y = 3 + 2 x` at x = -1, 0, 1, with a parameter in between that does nothing.
    #[test]
    fn a_parameter_that_is_not_seen_leaves_the_others_alone() {
        let rows = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, -1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
        let near = Quadratic::new(&rows, &dvector![-1.0, -3.0, -5.0], &DMatrix::zeros(3, 0));
        let step = &near.map * near.step(1e-20).unwrap().y;
        assert!((step[0] - 3.0).abs() < 1e-12 && (step[2] - 2.0).abs() < 1e-12);
        assert_eq!(step[1], 0.0);
        let found = deviations(&in_coordinates(&near));
        let expected = [(1.0_f64 / 3.0).sqrt(), f64::INFINITY, 0.5_f64.sqrt()];
        for (a, b) in found.iter().zip(expected) {
            assert!(*a == b || (a - b).abs() < 1e-14, "{a} {b}");
        }
    }
}
