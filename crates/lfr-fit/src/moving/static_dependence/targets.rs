//! What the matrices of an LFR are fitted to: those of the frozen model in coordinates that do not depend on p.

use crate::{FitError, MechanicalForm};
use lpv_core::linalg::{block_diagonal, pseudo_inverse};
use lpv_core::{Continuous, StateSpace};
use nalgebra::{DMatrix, DVector};

/// Positions at which the matrices are compared.
const POSITIONS: usize = 13;

/// Normalised position and `S = [A B; C D]` there, without the rows of `dq/dt = w_0 v`.
pub(super) struct Target {
    pub(super) delta: f64,
    pub(super) s: DMatrix<f64>,
}

/// The frozen matrices in the coordinates `T(p) x~`, T from the normalised position and the frozen model.
pub(super) fn targets(
    form: &MechanicalForm,
    transformation: impl Fn(f64, &StateSpace<Continuous>) -> Result<DMatrix<f64>, FitError>,
) -> Result<Vec<Target>, FitError> {
    (0..POSITIONS)
        .map(|i| {
            let delta = 2.0 * i as f64 / (POSITIONS - 1) as f64 - 1.0;
            let p = form.range().centre()[0] + delta * form.range().half_width()[0];
            let frozen = form.frozen(&[p])?;
            let t = transformation(delta, &frozen)?;
            let inverse = t.clone().try_inverse().ok_or(FitError::Start {
                p: vec![p],
                problem: "the state basis that the moving records ask for is singular there",
            })?;
            let (n, ny, nu) = (frozen.states(), frozen.outputs(), frozen.inputs());
            let mut s = DMatrix::zeros(n + ny, n + nu);
            s.view_mut((0, 0), (n, n))
                .copy_from(&(&t * frozen.a() * &inverse));
            s.view_mut((0, n), (n, nu)).copy_from(&(&t * frozen.b()));
            s.view_mut((n, 0), (ny, n)).copy_from(&(frozen.c() * &inverse));
            Ok(Target { delta, s })
        })
        .collect()
}

/// `T = diag(t, t)`, as near to the identity as may be, with which inputs act and outputs see as at the centre: those of a machine
/// whose actuators and sensors stand where they are, whatever moves between them. The least squares of `t B~ = B_0`, `C~ = C_0 t`.
pub(super) fn constant_ports(
    form: &MechanicalForm,
    centre: &StateSpace<Continuous>,
    frozen: &StateSpace<Continuous>,
) -> Result<DMatrix<f64>, FitError> {
    /// Part of the largest singular value below which a direction says nothing.
    const CUT: f64 = 1e-3;
    let (n, nu, ny) = (frozen.states(), frozen.inputs(), frozen.outputs());
    let nq = n / 2;
    let inputs: Vec<f64> = (0..nu)
        .map(|j| centre.b().column(j).amax().max(f64::MIN_POSITIVE))
        .collect();
    let b = |of: &StateSpace<Continuous>, i: usize, j: usize| of.b()[(nq + i, j)] / inputs[j];
    let c = |of: &StateSpace<Continuous>, i: usize, j: usize| of.c()[(i, j)] / form.scales()[i];
    // vec(t - I), entry (i, j) at j nq + i.
    let mut m = DMatrix::zeros(nq * (nu + ny), nq * nq);
    let mut right = DVector::zeros(m.nrows());
    for j in 0..nu {
        for i in 0..nq {
            let row = j * nq + i;
            for k in 0..nq {
                m[(row, k * nq + i)] = b(frozen, k, j);
            }
            right[row] = b(centre, i, j) - b(frozen, i, j);
        }
    }
    for j in 0..nq {
        for i in 0..ny {
            let row = nu * nq + j * ny + i;
            for k in 0..nq {
                m[(row, j * nq + k)] = c(centre, i, k);
            }
            right[row] = c(frozen, i, j) - c(centre, i, j);
        }
    }
    let change = pseudo_inverse(m, CUT)? * right;
    let t = DMatrix::identity(nq, nq) + DMatrix::from_column_slice(nq, nq, change.as_slice());
    Ok(block_diagonal(&t, &t))
}
