//! From continuous to discrete time and back: exact zero-order hold; and Tustin.

use crate::linalg::{balanced, finite, from_blocks};
use crate::{Continuous, CoreError, Discrete, StateSpace};
use nalgebra::DMatrix;

/// Beyond this norm of the balanced `A T` the exponential has lost its digits to the squarings.
const LARGEST_EXPONENT: f64 = 1e6;

impl StateSpace<Continuous> {
    /// The sampled system when the input is held between samples; exact, by one matrix exponential. Units of inputs, outputs and
    /// states do not matter: inputs and states are scaled by powers of two, which rounds nothing.
    ///
    /// # Errors
    /// [`CoreError::TooStiff`] if the balanced A times the sample time exceeds 1e6; [`CoreError::NotFinite`] if A or B times the sample
    /// time overflows, or the exponential does (an unstable pole much faster than the clock).
    pub fn zero_order_hold(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        let (n, m) = (self.states(), self.inputs());
        let t = clock.sample_time();
        let mut a = self.a() * t;
        let states = balanced(&mut a);
        finite("zero-order hold: A times the sample time", &a)?;
        let norm = a.norm();
        if norm > LARGEST_EXPONENT {
            return Err(CoreError::TooStiff {
                norm,
                largest: LARGEST_EXPONENT,
            });
        }
        let mut b = self.b() * t;
        scale_rows(&mut b, &states, f64::recip);
        // An entry that is not finite would be squared without end.
        finite("zero-order hold: B times the sample time", &b)?;
        // Each input in a unit in which its column is no larger than A, or 1: B must not set the squarings.
        let inputs: Vec<f64> = b
            .column_iter()
            .map(|c| {
                // The squares of large entries overflow, and those of small ones underflow.
                let largest = power_of_two(c.amax());
                power_of_two((c / largest).norm() / norm.max(1.0)) * largest
            })
            .collect();
        for (mut column, unit) in b.column_iter_mut().zip(&inputs) {
            column /= *unit;
        }
        let generator = from_blocks(&[&[&a, &b], &[&DMatrix::zeros(m, n), &DMatrix::zeros(m, m)]])?;
        let e = if generator.is_empty() {
            generator
        } else {
            generator.exp()
        };
        let mut a = e.view((0, 0), (n, n)).into_owned();
        let mut b = e.view((0, n), (n, m)).into_owned();
        scale_rows(&mut a, &states, |s| s);
        scale_rows(&mut b, &states, |s| s);
        for (mut column, unit) in a.column_iter_mut().zip(&states) {
            column /= *unit;
        }
        for (mut column, unit) in b.column_iter_mut().zip(&inputs) {
            column *= *unit;
        }
        StateSpace::new(a, b, self.c().clone(), self.d().clone(), clock)
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

fn scale_rows(m: &mut DMatrix<f64>, units: &[f64], factor: impl Fn(f64) -> f64) {
    for (mut row, unit) in m.row_iter_mut().zip(units) {
        row *= factor(*unit);
    }
}

/// The power of two next below a size; 1 for zero.
fn power_of_two(size: f64) -> f64 {
    if size.is_normal() {
        size.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
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
    use nalgebra::{DMatrix, DVector, dmatrix, dvector};

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

    /// The squares of B overflow or underflow: as many squarings of the exponential as for a B of 1, and the same samples.
    #[test]
    fn the_size_of_an_input_does_not_matter() -> Result<(), CoreError> {
        let sampled = |size: f64| {
            StateSpace::new(
                dmatrix![0.0, 1.0; -39.0, -0.2],
                dmatrix![0.0; size],
                dmatrix![1.0, 0.0],
                dmatrix![0.0],
                Continuous,
            )?
            .zero_order_hold(Discrete::new(0.2)?)
        };
        let plain = sampled(1.0)?;
        for exponent in (-1000..=1000).step_by(100) {
            let size = f64::from(exponent).exp2();
            assert_eq!(*sampled(size)?.b(), plain.b() * size, "2^{exponent}");
        }
        Ok(())
    }

    #[test]
    fn what_overflows_in_a_sample_time_is_refused() -> Result<(), CoreError> {
        for (a, b) in [(1e300, 1.0), (1.0, 1e300)] {
            let plant = StateSpace::new(
                dmatrix![-1.0, a; 0.0, -1.0],
                dmatrix![b; 1.0],
                dmatrix![1.0, 0.0],
                dmatrix![0.0],
                Continuous,
            )?;
            let clock = Discrete::new(1e10)?;
            assert!(plant.zero_order_hold(clock).is_err(), "{a} {b}");
        }
        Ok(())
    }

    /// A double integrator and a mode in any units of time, input and states: the same samples.
    #[test]
    fn units_do_not_matter_to_what_is_sampled() -> Result<(), CoreError> {
        let random = |k: usize| 24.0 * (((k * 7919 + 13) % 101) as f64 / 100.0 - 0.5);
        let a = dmatrix![0.0, 1.0, 0.0, 0.0; 0.0, 0.0, 0.0, 0.0; 0.0, 0.0, 0.0, 1.0; 0.0, 0.0, -39.0, -0.2];
        let b = dmatrix![0.0, 0.0; 2.0, 0.5; 0.0, 0.0; 1.0, -3.0];
        let c = dmatrix![1.0, 0.0, 1.0, 0.0];
        let d = DMatrix::zeros(1, 2);
        let plain = StateSpace::new(a.clone(), b.clone(), c.clone(), d.clone(), Continuous)?;
        let plain = plain.zero_order_hold(Discrete::new(0.2)?)?;
        for trial in 0..40 {
            let power = |k: usize| 10f64.powf(random(8 * trial + k));
            let time = power(0);
            let states = DMatrix::from_diagonal(&DVector::from_fn(4, |i, _| power(1 + i)));
            let back = DMatrix::from_diagonal(&states.diagonal().map(f64::recip));
            let inputs = DMatrix::from_diagonal(&dvector![power(5), power(6)]);
            let scaled = StateSpace::new(
                &states * (&a / time) * &back,
                &states * (&b / time) * &inputs,
                &c * &back,
                &d * &inputs,
                Continuous,
            )?;
            let scaled = scaled.zero_order_hold(Discrete::new(0.2 * time)?)?;
            for k in 0..6 {
                let markov = |m: &StateSpace<Discrete>| m.c() * m.a().pow(k) * m.b();
                let (expected, found) = (markov(&plain) * &inputs, markov(&scaled));
                for (e, f) in expected.iter().zip(&found) {
                    assert!((e - f).abs() < 1e-11 * e.abs(), "trial {trial}, {k}: {e} {f}");
                }
            }
        }
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
