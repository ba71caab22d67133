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

/// Minimises the squares of a residual, with forward differences; steps are at most one in every coordinate that is a logarithm,
/// the others have units. None where the start or one of its neighbours has no residual.
pub(crate) fn minimum(
    mut at: Vec<f64>,
    logarithms: &[bool],
    iterations: usize,
    residual: impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<Minimum> {
    let mut error = residual(&at)?;
    let mut cost = squares(&error);
    let mut damping = 1e-3;
    for iteration in 0.. {
        let mut jacobian = DMatrix::zeros(error.len(), at.len());
        for j in 0..at.len() {
            let (step, moved) = difference(&at, j, logarithms, &error, &residual)?;
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
                .zip(logarithms)
                .map(|((a, s), log)| a + if *log { s.clamp(-1.0, 1.0) } else { *s })
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

/// A step of one coordinate that moves the residual a little, and the residual there.
fn difference(
    at: &[f64],
    j: usize,
    logarithms: &[bool],
    error: &[f64],
    residual: &impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<(f64, Vec<f64>)> {
    /// Of the coordinate.
    const PART: f64 = 1e-6;
    /// Of the residual, which a step from zero moves by so much at least.
    const SEEN: f64 = 1e-7;
    /// The first step from zero, in any unit, and the growth of the next ones.
    const NEXT: (f64, f64) = (1e-40, 1e3);
    let moved = |step: f64| {
        let mut there = at.to_vec();
        there[j] += step;
        residual(&there)
    };
    if logarithms.get(j) == Some(&true) || at[j] != 0.0 {
        let step = if logarithms.get(j) == Some(&true) {
            PART
        } else {
            PART * at[j].abs()
        };
        return Some((step, moved(step)?));
    }
    let least = SEEN * SEEN * squares(error);
    let mut step = NEXT.0;
    let mut last = (step, moved(step)?);
    loop {
        let Some(there) = moved(step) else {
            return Some(last);
        };
        let by: f64 = there.iter().zip(error).map(|(a, b)| (a - b).powi(2)).sum();
        if by > least || step > NEXT.0.recip() {
            return Some((step, there));
        }
        last = (step, there);
        step *= NEXT.1;
    }
}
