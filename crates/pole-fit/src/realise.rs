//! A state space from the polynomials, without powers of `z`.
//!
//! The states of one input are `p_j u / a` for `j` below the degree of `a`, whose shift is the transposed comrade
//! matrix, and a chain of exact integrators driven by the first of them: `p_0 u / (a (z-1)^i)`.

use crate::basis::Recurrence;
use lpv_core::{CoreError, Discrete, StateSpace};
use nalgebra::{DMatrix, DVector};

/// `beta`: numerators, one column a channel (column-major channels of an `n_y x n_u` response).
pub(crate) fn realise(
    recurrence: &Recurrence,
    alpha: &DVector<f64>,
    beta: &DMatrix<f64>,
    integrators: usize,
    (n_y, n_u): (usize, usize),
    clock: Discrete,
) -> Result<StateSpace<Discrete>, CoreError> {
    let (n_f, m) = (alpha.len() - 1, integrators);
    let n = n_f + m;
    let coefficients = divide(recurrence, alpha, beta, m)?;
    // One copy of the denominator an input or an output, whichever are fewer.
    let by_inputs = n_u <= n_y;
    let copies = if by_inputs { n_u } else { n_y };
    let mut one = DMatrix::zeros(n, n);
    let mut drive = DVector::zeros(n);
    if n_f > 0 {
        let comrade = recurrence.comrade(alpha);
        one.view_mut((0, 0), (n_f, n_f)).copy_from(&comrade.transpose());
        drive[n_f - 1] = recurrence.h[(n_f, n_f - 1)] / alpha[n_f];
    } else if m > 0 {
        drive[0] = recurrence.constant / alpha[0];
    }
    for i in 0..m {
        one[(n_f + i, n_f + i)] = 1.0;
        if i > 0 {
            one[(n_f + i, n_f + i - 1)] = 1.0;
        } else if n_f > 0 {
            one[(n_f, 0)] = 1.0;
        }
    }
    let mut a = DMatrix::zeros(copies * n, copies * n);
    let mut b = DMatrix::zeros(copies * n, copies);
    let others = if by_inputs { n_y } else { n_u };
    let mut c = DMatrix::zeros(others, copies * n);
    let mut d = DMatrix::zeros(others, copies);
    for copy in 0..copies {
        a.view_mut((copy * n, copy * n), (n, n)).copy_from(&one);
        b.view_mut((copy * n, copy), (n, 1)).copy_from(&drive);
        for other in 0..others {
            let channel = if by_inputs {
                copy * n_y + other
            } else {
                other * n_y + copy
            };
            for j in 0..n {
                c[(other, copy * n + j)] = coefficients[(j, channel)];
            }
            d[(other, copy)] = coefficients[(n, channel)];
        }
    }
    if by_inputs {
        StateSpace::new(a, b, c, d, clock)
    } else {
        StateSpace::new(a.transpose(), c.transpose(), b.transpose(), d.transpose(), clock)
    }
}

/// Coefficients of the numerators in the polynomials of the states, `t p_j`, `(z-1)^(m-i) p_0`, and `t a` for the
/// feed-through; their degrees are 0 to `n`, so the map is invertible.
fn divide(
    recurrence: &Recurrence,
    alpha: &DVector<f64>,
    beta: &DMatrix<f64>,
    m: usize,
) -> Result<DMatrix<f64>, CoreError> {
    let n_f = alpha.len() - 1;
    let n = n_f + m;
    let mut map = DMatrix::zeros(n + 1, n + 1);
    let mut place = |column: usize, mut q: DVector<f64>, times: usize| {
        for _ in 0..times {
            q = recurrence.times_integrator(&q);
        }
        map.view_mut((0, column), (q.len(), 1)).copy_from(&q);
    };
    for j in 0..n_f {
        let unit = DVector::from_fn(j + 1, |i, _| f64::from(u8::from(i == j)));
        place(j, unit, m);
    }
    for i in 1..=m {
        place(n_f + i - 1, DVector::from_element(1, 1.0), m - i);
    }
    place(n, alpha.clone(), m);
    let mut padded = DMatrix::zeros(n + 1, beta.ncols());
    padded.view_mut((0, 0), beta.shape()).copy_from(beta);
    map.lu().solve(&padded).ok_or(CoreError::Singular {
        operation: "realisation of the fitted response",
    })
}
