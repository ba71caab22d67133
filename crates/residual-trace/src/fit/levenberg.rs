//! Levenberg-Marquardt on a residual of moderate size.

use super::{damped, squares, triangle};
use nalgebra::DMatrix;

/// Where it ended.
pub(crate) struct Minimum {
    pub(crate) at: Vec<f64>,
    /// Sum of squares of the residual.
    pub(crate) cost: f64,
    /// Rows of the residual.
    pub(crate) rows: usize,
    /// Upper triangle with `R^T R = J^T J`.
    pub(crate) factor: DMatrix<f64>,
}

/// Minimises the squares of a residual, with forward differences; steps are at most one in every coordinate. None where the
/// start or one of its neighbours has no residual.
pub(crate) fn minimum(
    mut at: Vec<f64>,
    iterations: usize,
    residual: impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<Minimum> {
    let mut error = residual(&at)?;
    let mut cost = squares(&error);
    let mut damping = 1e-3;
    for iteration in 0.. {
        let mut jacobian = DMatrix::zeros(error.len(), at.len());
        for j in 0..at.len() {
            let step = 1e-6 * at[j].abs().clamp(1e-4, 1.0);
            let mut there = at.clone();
            there[j] += step;
            let moved = residual(&there)?;
            let column = moved.iter().zip(&error).map(|(a, b)| (a - b) / step);
            jacobian
                .column_mut(j)
                .iter_mut()
                .zip(column)
                .for_each(|(j, c)| *j = c);
        }
        let r = triangle(&jacobian, &error);
        let before = cost;
        let mut stuck = true;
        for _ in 0..8 {
            let step = damped(&r, at.len(), damping);
            let there: Vec<f64> = at
                .iter()
                .zip(step.iter())
                .map(|(a, s)| a + s.clamp(-1.0, 1.0))
                .collect();
            if let Some(found) = residual(&there)
                && squares(&found) < cost
            {
                cost = squares(&found);
                (at, error) = (there, found);
                damping = f64::max(0.1 * damping, 1e-9);
                stuck = false;
                break;
            }
            damping *= 10.0;
        }
        if stuck || before - cost < 1e-5 * cost || iteration >= iterations {
            let n = at.len();
            return Some(Minimum {
                at,
                cost,
                rows: error.len(),
                factor: r.view((0, 0), (n, n)).into_owned(),
            });
        }
    }
    None
}
