//! From continuous to discrete time: exact zero-order hold, and Tustin.

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
