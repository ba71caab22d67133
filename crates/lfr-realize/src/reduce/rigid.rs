//! The integrators of a frozen model, apart from the rest.

use crate::RealizeError;
use lpv_core::linalg::svd;
use lpv_core::{Discrete, StateSpace};
use nalgebra::{DMatrix, DVector};

/// A sampled model as `gamma (T^2/2) (z + 1) / (z - 1)^2 + flexible`.
pub(crate) struct Split {
    /// `n_y x n_u`; none without integrators.
    pub(crate) gamma: Option<DMatrix<f64>>,
    pub(crate) flexible: StateSpace<Discrete>,
}

/// Bases of the invariant subspaces of A (right) and of its transpose (left), for the poles at 1 and for the rest.
pub(crate) struct Bases {
    pub(crate) left: DMatrix<f64>,
    pub(crate) right: DMatrix<f64>,
    pub(crate) left_rest: DMatrix<f64>,
    pub(crate) right_rest: DMatrix<f64>,
}

/// A double pole at 1 is split by rounding to about the root of the working precision.
const NEAR: f64 = 1e-5;

/// How exactly the integrators must be those of a rigid body, relative to its gain.
const EXACT: f64 = 1e-6;

/// Directions below this part of the largest singular value belong to the null space.
const NULL: f64 = 1e-10;

const UNSTABLE: &str = "a pole on or outside the unit circle that is no integrator; only stable parts and the double integrators of a rigid body can be reduced";
const NO_RIGID_BODY: &str = "integrators that are not those of a rigid body, gamma (T^2/2) (z + 1) / (z - 1)^2; take them out and add them again afterwards";

impl Split {
    /// # Errors
    /// [`RealizeError::Reduction`] for poles on or outside the unit circle other than the double integrators of a rigid
    /// body.
    pub(crate) fn new(model: &StateSpace<Discrete>, p: &[f64]) -> Result<Self, RealizeError> {
        let refused = |problem| RealizeError::Reduction {
            p: p.to_vec(),
            problem,
        };
        let poles = model.poles()?;
        if poles.iter().any(|z| (z - 1.0).norm() >= NEAR && z.norm() >= 1.0) {
            return Err(refused(UNSTABLE));
        }
        if poles.iter().all(|z| (z - 1.0).norm() >= NEAR) {
            return Ok(Self {
                gamma: None,
                flexible: model.clone(),
            });
        }
        let bases = Self::bases(model).ok_or_else(|| refused(NO_RIGID_BODY))?;
        let part = |u: &DMatrix<f64>, v: &DMatrix<f64>| {
            let left = (u.transpose() * v).try_inverse()? * u.transpose();
            Some((&left * model.a() * v, left * model.b(), model.c() * v))
        };
        let (a, b, c) = part(&bases.left, &bases.right).ok_or_else(|| refused(NO_RIGID_BODY))?;
        let chain = &a - DMatrix::identity(a.nrows(), a.nrows());
        let square = model.clock().sample_time().powi(2);
        // C (zI - A)^-1 B = C B / (z - 1) + C (A - I) B / (z - 1)^2, the second power of A - I being zero.
        let gamma = &c * chain * &b / square;
        let difference = c * b - &gamma * (0.5 * square);
        if gamma.amax() == 0.0 || difference.norm() > EXACT * gamma.norm() * square {
            return Err(refused(NO_RIGID_BODY));
        }
        let rounding = 1e-12 * gamma.amax();
        let (a, b, c) = part(&bases.left_rest, &bases.right_rest).ok_or_else(|| refused(NO_RIGID_BODY))?;
        Ok(Self {
            gamma: Some(gamma.map(|v| if v.abs() > rounding { v } else { 0.0 })),
            flexible: StateSpace::new(a, b, c, model.d().clone(), model.clock())?,
        })
    }

    /// None where the integrators form chains of more than two.
    pub(crate) fn bases(model: &StateSpace<Discrete>) -> Option<Bases> {
        let n = model.states();
        let poles = model.poles().ok()?;
        let count = poles.iter().filter(|z| (*z - 1.0).norm() < NEAR).count();
        let step = model.a() - DMatrix::identity(n, n);
        let square = &step * &step;
        // Each invariant subspace is orthogonal to the rest of the other side.
        let (right, left_rest) = null_space(&square, count)?;
        let (left, right_rest) = null_space(&square.transpose(), count)?;
        Some(Bases {
            left,
            right,
            left_rest,
            right_rest,
        })
    }
}

/// Orthonormal bases of the null space, if it has this dimension, and of its complement.
fn null_space(m: &DMatrix<f64>, dimension: usize) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let svd = svd(m.clone()).ok()?;
    let vectors = svd.v_t?;
    let cut = NULL * svd.singular_values.max().max(1.0);
    let pick = |null: bool| {
        let rows = (0..m.nrows()).filter(|&i| (svd.singular_values[i] <= cut) == null);
        let columns: Vec<DVector<f64>> = rows.map(|i| vectors.row(i).transpose()).collect();
        if columns.is_empty() {
            DMatrix::zeros(m.nrows(), 0)
        } else {
            DMatrix::from_columns(&columns)
        }
    };
    let null = pick(true);
    (null.ncols() == dimension).then(|| (null, pick(false)))
}
