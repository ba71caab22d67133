//! The frozen system of an LFR, and how it moves with the entries of M.

use crate::shape::Shape;
use nalgebra::DMatrix;

/// `S = [A B; C D](p)` with the factors of its derivative, `dS = left dM right`.
pub(crate) struct Frozen {
    /// `(n + n_y) x (n + n_u)`.
    pub(crate) s: DMatrix<f64>,
    /// `[I, M_ab K]`, `(n + n_y) x rows of M`; empty unless asked for.
    pub(crate) left: DMatrix<f64>,
    /// `[I; K M_ba]`, `columns of M x (n + n_u)`; empty unless asked for.
    pub(crate) right: DMatrix<f64>,
    /// Whether `det(I - M_bb Delta)` is above zero.
    pub(crate) positive: bool,
}

/// What [`close`] is to compute.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Closure {
    Value,
    Derivative,
}

/// A pivot of `I - M_bb Delta` below this part of the largest entry counts as zero.
const SINGULAR: f64 = 1e-13;

/// `S = M_aa + M_ab K M_ba` with `K = Delta (I - M_bb Delta)^-1`. The derivative is exact:
/// `dK = K dM_bb K`, so `dS = [I, M_ab K] dM [I; K M_ba]`. None where the loop has no solution.
pub(crate) fn close(m: &DMatrix<f64>, shape: Shape, delta: &[f64], closure: Closure) -> Option<Frozen> {
    let (a, b, nc) = (shape.rows(), shape.columns(), delta.len());
    let mut s = m.view((0, 0), (a, b)).into_owned();
    if nc == 0 {
        return Some(Frozen {
            s,
            left: DMatrix::identity(a, a),
            right: DMatrix::identity(b, b),
            positive: true,
        });
    }
    let gap = DMatrix::from_fn(nc, nc, |i, j| {
        f64::from(u8::from(i == j)) - m[(a + i, b + j)] * delta[j]
    });
    let scale = gap.amax();
    let lu = gap.lu();
    let smallest = lu.lu_internal().diagonal().amin();
    if smallest.is_nan() || smallest <= SINGULAR * scale || !scale.is_finite() {
        return None;
    }
    // K M_ba = Delta (I - M_bb Delta)^-1 M_ba.
    let mut through = m.view((a, 0), (nc, b)).into_owned();
    if !lu.solve_mut(&mut through) {
        return None;
    }
    for (mut row, d) in through.row_iter_mut().zip(delta) {
        row *= *d;
    }
    s += m.view((0, b), (a, nc)) * &through;
    let positive = lu.determinant() > 0.0;
    if closure == Closure::Value {
        let none = || DMatrix::zeros(0, 0);
        return Some(Frozen {
            s,
            left: none(),
            right: none(),
            positive,
        });
    }
    let mut k = DMatrix::identity(nc, nc);
    if !lu.solve_mut(&mut k) {
        return None;
    }
    for (mut row, d) in k.row_iter_mut().zip(delta) {
        row *= *d;
    }
    let mut left = DMatrix::identity(a, a + nc);
    left.view_mut((0, a), (a, nc))
        .copy_from(&(m.view((0, b), (a, nc)) * k));
    let mut right = DMatrix::identity(b + nc, b);
    right.view_mut((b, 0), (nc, b)).copy_from(&through);
    Some(Frozen {
        s,
        left,
        right,
        positive,
    })
}

#[cfg(test)]
mod tests;
