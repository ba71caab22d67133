//! A frozen model as the sum of its rigid body and its modes.

use crate::FitError;
use lpv_core::{Continuous, CoreError, StateSpace};
use nalgebra::DMatrix;

/// `dq/dt = v`, `dv/dt = -R v + Gamma u`, and `y = q + (flexible part)`.
pub(super) struct Separated {
    /// Gamma.
    pub(super) gain: DMatrix<f64>,
    /// R.
    pub(super) rate: DMatrix<f64>,
    pub(super) flexible: StateSpace<Continuous>,
}

/// Most steps of the iteration below, each of which gains the factor between the rates of the modes and those of friction.
const STEPS: usize = 200;

/// Change relative to the size at which it has ended.
const ENDED: f64 = 1e-13;

impl Separated {
    /// From a model with the states `[q; v; x]` whose q are integrals of v: `A = [0 I 0; 0 A_vv A_vx; 0 A_xv A_xx]`,
    /// `C = [I C_v C_x]`.
    ///
    /// The slow states lie in the span of `[I 0; 0 I; 0 X]`, and the fast ones in that of `[Z; Y; I]`, with
    /// `A_xx X = X (A_vv + A_vx X) - A_xv`, `Y (A_xv Y + A_xx) = A_vv Y + A_vx`, `Z (A_xv Y + A_xx) = Y`: fixed points that are
    /// found from zero where every mode is faster than friction. The slow part of the outputs are the rigid positions; what of their
    /// speed an input moves at once goes to the modes in the true machine too, and is dropped in both.
    ///
    /// # Errors
    /// [`FitError::Core`] where friction is as fast as the modes.
    pub(super) fn new(whole: &StateSpace<Continuous>) -> Result<Self, FitError> {
        let (n, ny, nu) = (whole.states(), whole.outputs(), whole.inputs());
        let nx = n - 2 * ny;
        let part = |m: &DMatrix<f64>, at, size| m.view(at, size).into_owned();
        let a = |at, size| part(whole.a(), at, size);
        let (vv, vx) = (a((ny, ny), (ny, ny)), a((ny, 2 * ny), (ny, nx)));
        let (xv, xx) = (a((2 * ny, ny), (nx, ny)), a((2 * ny, 2 * ny), (nx, nx)));
        let (cv, cx) = (
            part(whole.c(), (0, ny), (ny, ny)),
            part(whole.c(), (0, 2 * ny), (ny, nx)),
        );
        let (bv, bx) = (
            part(whole.b(), (ny, 0), (ny, nu)),
            part(whole.b(), (2 * ny, 0), (nx, nu)),
        );
        let direct = whole.d().clone();
        if [&vx, &xv, &cv].iter().all(|m| m.amax() == 0.0) {
            return Ok(Self {
                gain: bv,
                rate: -vv,
                flexible: StateSpace::new(xx, bx, cx, direct, Continuous)?,
            });
        }
        let refused = || CoreError::NoConvergence {
            operation: "the separation of the rigid body from the modes (friction is as fast as they are)",
        };
        let by_modes = xx.clone().lu();
        let x = fixed_point(DMatrix::zeros(nx, ny), |x| {
            by_modes.solve(&(x * (&vv + &vx * x) - &xv))
        });
        let y = fixed_point(DMatrix::zeros(ny, nx), |y| {
            let fast = &xv * y + &xx;
            let side = &vv * y + &vx;
            fast.transpose()
                .lu()
                .solve(&side.transpose())
                .map(|y| y.transpose())
        });
        let (x, y) = x.zip(y).ok_or_else(refused)?;
        let fast = &xv * &y + &xx;
        let slow = &vv + &vx * &x;
        let z = fast
            .transpose()
            .lu()
            .solve(&y.transpose())
            .ok_or_else(refused)?
            .transpose();
        // [v; x] = [I Y; X I] [v'; x'], q = q' + Z x'.
        let inside = (DMatrix::identity(ny, ny) - &y * &x)
            .try_inverse()
            .ok_or_else(refused)?;
        let slow_input = &inside * (&bv - &y * &bx);
        let fast_input = &bx - &x * &slow_input;
        let seen = &cv + &cx * &x;
        // The rigid positions are q' + seen v'; their speeds follow.
        let speeds = DMatrix::identity(ny, ny) + &seen * &slow;
        let back = speeds.clone().try_inverse().ok_or_else(refused)?;
        Ok(Self {
            gain: &speeds * slow_input,
            rate: -(&speeds * &slow * back),
            flexible: StateSpace::new(fast, fast_input, &z + &cv * &y + &cx, direct, Continuous)?,
        })
    }
}

/// Where repeated steps end; none where they do not.
fn fixed_point(
    mut at: DMatrix<f64>,
    step: impl Fn(&DMatrix<f64>) -> Option<DMatrix<f64>>,
) -> Option<DMatrix<f64>> {
    for _ in 0..STEPS {
        let next = step(&at)?;
        let change = (&next - &at).amax();
        let size = next.amax();
        at = next;
        if !size.is_finite() {
            return None;
        }
        if change <= ENDED * size {
            return Some(at);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::linalg::{block_diagonal, eigenvalues, from_blocks};
    use nalgebra::dmatrix;

    /// The parts are found again from a mixture of their states, whatever the friction below the modes.
    #[test]
    fn parts_are_found_again() {
        for friction in [0.0, 1e-3, 0.1, 1.0] {
            let rate = dmatrix![friction, 0.3 * friction; 0.2 * friction, 0.5 * friction];
            let gain = dmatrix![1.0, 0.2; -0.1, 0.7];
            let modes = dmatrix![0.0, 9.0, 0.0, 0.0; -9.0, -0.2, 0.0, 0.0; 0.0, 0.0, 0.0, 14.0; 0.0, 0.0, -14.0, -0.3];
            let (b, c) = (
                dmatrix![0.0, 0.0; 1.0, 0.5; 0.0, 0.0; 0.2, -0.8],
                dmatrix![0.3, 0.0, 0.1, 0.0; 0.2, 0.0, -0.4, 0.0],
            );
            let (zero, one) = (DMatrix::zeros(2, 2), DMatrix::identity(2, 2));
            let body = from_blocks(&[&[&zero, &one], &[&zero, &-&rate]]).unwrap();
            let a = block_diagonal(&body, &modes);
            let b = from_blocks(&[&[&zero], &[&gain], &[&b]]).unwrap();
            let c = from_blocks(&[&[&one, &zero, &c]]).unwrap();
            // Speeds and modes mixed, the speeds still the rates of positions: q keeps its place by q' = q - (what v' needs).
            let mix = dmatrix![0.3, -0.1; 0.2, 0.4; 0.0, 0.1; -0.2, 0.3];
            let mut t = DMatrix::<f64>::identity(8, 8);
            t.view_mut((4, 2), (4, 2)).copy_from(&mix);
            let back = t.clone().try_inverse().unwrap();
            let whole = StateSpace::new(
                &t * a * &back,
                &t * b,
                c * &back,
                DMatrix::zeros(2, 2),
                Continuous,
            )
            .unwrap();
            let found = Separated::new(&whole).unwrap();
            assert!((&found.gain - &gain).amax() < 1e-11, "{}", found.gain);
            assert!((&found.rate - &rate).amax() < 1e-11, "{}", found.rate);
            let mut poles: Vec<f64> = eigenvalues(found.flexible.a())
                .unwrap()
                .iter()
                .map(|l| l.im)
                .collect();
            poles.sort_by(f64::total_cmp);
            let mut wanted: Vec<f64> = eigenvalues(&modes).unwrap().iter().map(|l| l.im).collect();
            wanted.sort_by(f64::total_cmp);
            for (found, wanted) in poles.iter().zip(&wanted) {
                assert!((found - wanted).abs() < 1e-10);
            }
            let at = [0.7, 1.9];
            let flexible = StateSpace::new(
                modes.clone(),
                dmatrix![0.0, 0.0; 1.0, 0.5; 0.0, 0.0; 0.2, -0.8],
                dmatrix![0.3, 0.0, 0.1, 0.0; 0.2, 0.0, -0.4, 0.0],
                DMatrix::zeros(2, 2),
                Continuous,
            )
            .unwrap();
            let (one, other) = (
                found.flexible.frequency_response(&at).unwrap(),
                flexible.frequency_response(&at).unwrap(),
            );
            for (a, b) in one.values().iter().zip(other.values()) {
                assert!((a - b).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn friction_as_fast_as_the_modes_is_refused() {
        let a = dmatrix![0.0, 1.0, 0.0, 0.0; 0.0, -50.0, 0.0, 1.0; 0.0, 0.0, 0.0, 1.0; 0.0, 5.0, -1.0, -0.1];
        let b = dmatrix![0.0; 1.0; 0.0; 1.0];
        let c = dmatrix![1.0, 0.0, 1.0, 0.0];
        let whole = StateSpace::new(a, b, c, dmatrix![0.0], Continuous).unwrap();
        assert!(Separated::new(&whole).is_err());
    }
}
