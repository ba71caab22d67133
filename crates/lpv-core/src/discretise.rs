//! From continuous to discrete time and back: exact zero-order hold; and Tustin.

use crate::linalg::from_blocks;
use crate::{Continuous, CoreError, Discrete, StateSpace};
use nalgebra::DMatrix;

/// Beyond this norm of `[A B; 0 0] T` the exponential has lost its digits to the squarings.
const LARGEST_EXPONENT: f64 = 1e6;

impl StateSpace<Continuous> {
    /// The sampled system when the input is held between samples; exact, by one matrix exponential.
    ///
    /// # Errors
    /// [`CoreError::TooStiff`] if the matrices times the sample time exceed 1e6; [`CoreError::NotFinite`] if the
    /// exponential overflows (an unstable pole much faster than the clock).
    pub fn zero_order_hold(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        let (n, m) = (self.states(), self.inputs());
        let t = clock.sample_time();
        let generator = from_blocks(&[
            &[&(self.a() * t), &(self.b() * t)],
            &[&DMatrix::zeros(m, n), &DMatrix::zeros(m, m)],
        ])?;
        let norm = generator.norm();
        if norm > LARGEST_EXPONENT {
            return Err(CoreError::TooStiff {
                norm,
                largest: LARGEST_EXPONENT,
            });
        }
        let e = if generator.is_empty() {
            generator
        } else {
            generator.exp()
        };
        StateSpace::new(
            e.view((0, 0), (n, n)).into_owned(),
            e.view((0, n), (n, m)).into_owned(),
            self.c().clone(),
            self.d().clone(),
            clock,
        )
    }

    /// The bilinear map `s = (2 / T) (z - 1) / (z + 1)`.
    ///
    /// # Errors
    /// [`CoreError::Singular`] if a pole lies at `s = 2 / T`.
    pub fn tustin(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        let n = self.states();
        let half = self.a() * (0.5 * clock.sample_time());
        let identity = DMatrix::<f64>::identity(n, n);
        let inverse = (&identity - &half).try_inverse().ok_or(CoreError::Singular {
            operation: "Tustin's map",
        })?;
        let a = &inverse * (&identity + &half);
        // The state is scaled so that B and C share the factor T: C (I - AT/2)^-1 (zI - A_d)^-1 ... stays exact.
        let b = &inverse * self.b() * clock.sample_time();
        let c = self.c() * &inverse;
        let d = self.d() + self.c() * &b * 0.5;
        StateSpace::new(a, b, c, d, clock)
    }
}

/// Halvings of the logarithm after which it is not small: a pole next to the negative real axis.
const MOST_ROOTS: usize = 40;

/// Distance from the identity from which the series of the logarithm is short.
const NEAR: f64 = 0.05;

impl StateSpace<Discrete> {
    /// The continuous system that gives this one when its input is held between samples: the inverse of
    /// [`StateSpace::zero_order_hold`], the principal logarithm of `[A B; 0 I]` by roots and a series (Higham, Functions of
    /// Matrices, 2008, chapter 11).
    ///
    /// # Errors
    /// [`CoreError::NoConvergence`] for a pole at zero or on the negative real axis: no continuous system of this order has it.
    pub fn undo_zero_order_hold(&self) -> Result<StateSpace<Continuous>, CoreError> {
        let (n, m) = (self.states(), self.inputs());
        let t = self.clock().sample_time();
        let step = from_blocks(&[
            &[self.a(), self.b()],
            &[&DMatrix::zeros(m, n), &DMatrix::identity(m, m)],
        ])?;
        let none = CoreError::NoConvergence {
            operation: "the logarithm of A (a pole at zero or on the negative real axis has no continuous counterpart)",
        };
        let generator = logarithm(step).ok_or(none)? / t;
        StateSpace::new(
            generator.view((0, 0), (n, n)).into_owned(),
            generator.view((0, n), (n, m)).into_owned(),
            self.c().clone(),
            self.d().clone(),
            Continuous,
        )
    }
}

/// The principal logarithm; none where there is none.
fn logarithm(mut x: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let identity = DMatrix::identity(x.nrows(), x.ncols());
    let mut factor = 1.0;
    for _ in 0..MOST_ROOTS {
        if (&x - &identity).norm() < NEAR {
            // log x = 2 artanh(r), r = (x - 1) (x + 1)^-1.
            let r = (&x - &identity) * (&x + &identity).try_inverse()?;
            let square = &r * &r;
            let mut power = r.clone();
            let mut sum = r;
            for k in 1..8 {
                power *= &square;
                sum += &power / f64::from(2 * k + 1);
            }
            let found = sum * (2.0 * factor);
            return found.iter().all(|v| v.is_finite()).then_some(found);
        }
        x = root(x)?;
        factor *= 2.0;
    }
    None
}

/// The principal square root, by Denman and Beavers' iteration.
fn root(x: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut inverse = DMatrix::identity(x.nrows(), x.ncols());
    let mut y = x;
    for _ in 0..60 {
        let next = 0.5 * (&y + inverse.clone().try_inverse()?);
        inverse = 0.5 * (&inverse + y.clone().try_inverse()?);
        let change = (&next - &y).norm();
        y = next;
        if change <= 1e-14 * y.norm() {
            return Some(y);
        }
        if !change.is_finite() {
            return None;
        }
    }
    // The last digits of a defective matrix may dance.
    let left = (&y * &inverse - DMatrix::identity(y.nrows(), y.ncols())).norm();
    (left < 1e-8).then_some(y)
}

#[cfg(test)]
mod tests {
    use crate::{Continuous, CoreError, Discrete, StateSpace};
    use nalgebra::dmatrix;

    #[test]
    fn what_is_sampled_comes_back() -> Result<(), CoreError> {
        // A double integrator and a mode, which the clock sees five times a period.
        let plant = StateSpace::new(
            dmatrix![0.0, 1.0, 0.0, 0.0; 0.0, 0.0, 0.0, 0.0; 0.0, 0.0, 0.0, 1.0; 0.0, 0.0, -39.0, -0.2],
            dmatrix![0.0; 2.0; 0.0; 1.0],
            dmatrix![1.0, 0.0, 1.0, 0.0],
            dmatrix![0.0],
            Continuous,
        )?;
        let back = plant
            .zero_order_hold(Discrete::new(0.2)?)?
            .undo_zero_order_hold()?;
        assert!((back.a() - plant.a()).amax() < 1e-9, "{}", back.a());
        assert!((back.b() - plant.b()).amax() < 1e-9, "{}", back.b());
        Ok(())
    }

    #[test]
    fn a_negative_pole_has_no_continuous_counterpart() -> Result<(), CoreError> {
        let plant = StateSpace::new(
            dmatrix![-0.5],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.0],
            Discrete::new(1.0)?,
        )?;
        assert!(matches!(
            plant.undo_zero_order_hold(),
            Err(CoreError::NoConvergence { .. })
        ));
        Ok(())
    }
}
