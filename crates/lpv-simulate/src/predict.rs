//! One step ahead: the model with a Kalman gain.

use crate::Frozen;
use crate::SimulateError;
use crate::run::Steps;
use lpv_core::{Discrete, Record, StateSpace};
use nalgebra::{Cholesky, DMatrix, DVector, LU};

/// Covariance P of the state that the stationary Kalman filter predicts, for process noise of covariance `q` (`n x n`) and
/// measurement noise of covariance `r` (`n_y x n_y`), by the structure-preserving doubling algorithm. Eigenvalues of A on the unit
/// circle are fine where `q` reaches them.
///
/// # Errors
/// [`SimulateError::Structure`] if the iteration does not settle: a state on or outside the unit circle that no output sees
/// or no noise drives.
pub fn stationary_covariance(
    system: &StateSpace<Discrete>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, SimulateError> {
    let failed = SimulateError::Structure {
        problem: "one-step prediction: no stationary Kalman gain; a state that does not decay is not seen by the outputs",
    };
    let (n, c) = (system.states(), system.c());
    let identity = DMatrix::identity(n, n);
    let Some(r_inverse) = Cholesky::new(r.clone()).map(|f| f.inverse()) else {
        return Err(failed);
    };
    // P = A P (I + G P)^-1 A^T + Q with G = C^T R^-1 C; doubled in each step.
    let (mut a, mut g, mut h) = (system.a().transpose(), c.transpose() * r_inverse * c, q.clone());
    const MOST: usize = 60;
    for _ in 0..MOST {
        let Some(w) = LU::new(&identity + &g * &h).try_inverse() else {
            return Err(failed);
        };
        let next_h = &h + a.transpose() * &h * &w * &a;
        let change = (&next_h - &h).amax();
        g += &a * &w * &g * a.transpose();
        a = &a * &w * &a;
        h = (&next_h + next_h.transpose()) * 0.5;
        if !h.iter().all(|v| v.is_finite()) {
            return Err(failed);
        }
        if change <= SETTLED * h.amax() {
            return Ok(h);
        }
    }
    Err(failed)
}

/// Relative change of a covariance that counts as none.
const SETTLED: f64 = 1e-12;

/// Gain K of `x+ = A x + B u + K (y - C x - D u)` where x is known up to the covariance `p`; none
/// where that of the outputs is not positive definite in numbers.
fn kalman_gain(system: &StateSpace<Discrete>, p: &DMatrix<f64>, r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let to_output = p * system.c().transpose();
    let inverse = Cholesky::new(system.c() * &to_output + r)?.inverse();
    Some(system.a() * to_output * inverse)
}

/// What corrects a prediction.
enum Correction {
    /// A gain of the model itself.
    Gain(DMatrix<f64>),
    /// The Kalman filter for inputs with white disturbances of these deviations, and outputs with noise of this covariance.
    Disturbance(Vec<f64>, DMatrix<f64>),
}

/// A model that predicts one sample ahead.
pub struct Predictor<'a, M: Frozen> {
    model: &'a M,
    correction: Correction,
}

impl<'a, M: Frozen> Predictor<'a, M> {
    /// One gain everywhere.
    pub fn with_gain(model: &'a M, gain: DMatrix<f64>) -> Self {
        Self {
            model,
            correction: Correction::Gain(gain),
        }
    }

    /// The Kalman filter for inputs that are disturbed by white noise of the given deviations and outputs that are measured with
    /// `noise`. Its covariance begins at the stationary one where the record begins, and then follows p from
    /// sample to sample: gains of constant positions may lose a machine that moves fast.
    pub fn for_disturbance(model: &'a M, disturbance: &[f64], noise: &[f64]) -> Self {
        let r = DMatrix::from_diagonal(&DVector::from_iterator(noise.len(), noise.iter().map(|s| s * s)));
        Self {
            model,
            correction: Correction::Disturbance(disturbance.to_vec(), r),
        }
    }

    /// Errors `y - yhat` of the one-step prediction over the first `samples` samples, `n_y x samples`.
    ///
    /// # Errors
    /// Channels that do not fit; p outside the range; those of [`stationary_covariance`] where the record begins; a state that is lost on
    /// the way.
    pub fn errors(
        &self,
        record: &Record,
        initial_state: Option<&DVector<f64>>,
        samples: usize,
    ) -> Result<DMatrix<f64>, SimulateError> {
        let steps = Steps::new(self.model, record);
        let mut frozen = steps.at(0)?;
        let (nu, ny) = (record.inputs.channels(), record.outputs.channels());
        if frozen.inputs() != nu || frozen.outputs() != ny {
            return Err(SimulateError::Structure {
                problem: "prediction: the record has another number of inputs or outputs than the model",
            });
        }
        let mut filter = Filter::new(&self.correction, &frozen)?;
        let mut x = initial_state.map_or_else(|| DVector::zeros(frozen.states()), DVector::clone);
        let samples = samples.min(record.len());
        let mut errors = DMatrix::zeros(ny, samples);
        for k in 0..samples {
            if !steps.stays(k) {
                let next = steps.at(k)?;
                let same = next.a() == frozen.a() && next.b() == frozen.b() && next.c() == frozen.c();
                filter.settled &= same;
                frozen = next;
            }
            let mut u = DVector::from_fn(nu, |j, _| record.inputs.columns[j][k]);
            let mut y = DVector::from_fn(ny, |i, _| record.outputs.columns[i][k]);
            if let Some((u0, y0)) = self.model.offsets() {
                u -= u0;
                y -= y0;
            }
            let e = y - frozen.c() * &x - frozen.d() * &u;
            errors.set_column(k, &e);
            filter.step(&frozen)?;
            x = frozen.a() * &x + frozen.b() * &u + &filter.gain * e;
        }
        Ok(errors)
    }
}

/// The gain along a record.
struct Filter<'a> {
    /// That of the present sample.
    gain: DMatrix<f64>,
    /// Covariance of the present state; none with a gain of the model itself.
    covariance: Option<DMatrix<f64>>,
    correction: &'a Correction,
    /// Whether the next gain is the present one.
    settled: bool,
}

impl<'a> Filter<'a> {
    fn new(correction: &'a Correction, first: &StateSpace<Discrete>) -> Result<Self, SimulateError> {
        let (gain, covariance) = match correction {
            Correction::Gain(gain) => (gain.clone(), None),
            Correction::Disturbance(deviations, r) => {
                let q = process_noise(first, deviations);
                let gain = DMatrix::zeros(first.states(), first.outputs());
                (gain, Some(stationary_covariance(first, &q, r)?))
            }
        };
        Ok(Self {
            gain,
            covariance,
            correction,
            settled: false,
        })
    }

    /// Sets the gain for the step of `frozen`, and goes on to the covariance after it.
    ///
    /// # Errors
    /// [`SimulateError::Structure`] where the covariance is lost.
    fn step(&mut self, frozen: &StateSpace<Discrete>) -> Result<(), SimulateError> {
        let (Some(p), Correction::Disturbance(deviations, r)) = (&mut self.covariance, self.correction)
        else {
            return Ok(());
        };
        if self.settled {
            return Ok(());
        }
        self.gain = kalman_gain(frozen, p, r).ok_or(SimulateError::Structure {
            problem: "one-step prediction: the covariance of the state is lost; a state that does not decay is not seen by the outputs",
        })?;
        // Joseph's form keeps the covariance positive.
        let left = frozen.a() - &self.gain * frozen.c();
        let next = &left * &*p * left.transpose()
            + &self.gain * r * self.gain.transpose()
            + process_noise(frozen, deviations);
        let next = (&next + next.transpose()) * 0.5;
        self.settled = (&next - &*p).amax() <= SETTLED * next.amax();
        *p = next;
        Ok(())
    }
}

/// Covariance that disturbances of the inputs add to the state in a sample.
fn process_noise(system: &StateSpace<Discrete>, deviations: &[f64]) -> DMatrix<f64> {
    let mut b = system.b().clone();
    for (mut column, s) in b.column_iter_mut().zip(deviations) {
        column *= *s;
    }
    &b * b.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    /// A pole at p, seen with the gain 1.
    struct Moving;

    impl Frozen for Moving {
        fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
            let one = dmatrix![1.0];
            Ok(StateSpace::new(
                dmatrix![p[0]],
                one.clone(),
                one,
                dmatrix![0.0],
                Discrete::new(1.0)?,
            )?)
        }
    }

    /// The filter along a moving p beside the recursion by hand; it begins at the stationary one.
    #[test]
    fn the_covariance_follows_p() {
        let p: Vec<f64> = (0..40)
            .map(|k| {
                if k < 20 {
                    0.5
                } else {
                    0.5 + 0.02 * f64::from(k - 20)
                }
            })
            .collect();
        let y: Vec<f64> = (0..40).map(|k| f64::from(k * 7 % 11) - 5.0).collect();
        let record = Record {
            name: String::new(),
            kind: lpv_core::RecordKind::Transient,
            purpose: lpv_core::Purpose::Validation,
            position: None,
            outputs: lpv_core::Signals::new(&["y"], vec![y.clone()]),
            inputs: lpv_core::Signals::new(&["u"], vec![vec![0.0; 40]]),
            references: lpv_core::Signals::default(),
            scheduling: lpv_core::Signals::new(&["p"], vec![p.clone()]),
            auxiliary: lpv_core::Signals::default(),
            injection: lpv_core::Signals::default(),
        };
        let (q, r) = (0.3 * 0.3, 0.7 * 0.7);
        let found = Predictor::for_disturbance(&Moving, &[0.3], &[0.7])
            .errors(&record, None, 40)
            .unwrap();
        // P = a^2 P r / (P + r) + q at rest.
        let mut cov = (0..500).fold(1.0, |c: f64, _| 0.25 * c * r / (c + r) + q);
        let mut x = 0.0;
        for k in 0..40 {
            let e = y[k] - x;
            assert!((found[(0, k)] - e).abs() < 1e-9, "{k}");
            x = p[k] * (x + cov / (cov + r) * e);
            cov = p[k] * p[k] * cov * r / (cov + r) + q;
        }
    }

    /// The scalar random walk: P = P - P^2/(P + r) + q has the positive root of P^2 = q (P + r).
    #[test]
    fn gain_of_the_random_walk() {
        let clock = Discrete::new(1.0).unwrap();
        let one = dmatrix![1.0];
        let walk = StateSpace::new(one.clone(), one.clone(), one.clone(), dmatrix![0.0], clock).unwrap();
        let (q, r) = (0.5, 2.0);
        let p: f64 = (q + f64::sqrt(q * q + 4.0 * q * r)) / 2.0;
        let found = stationary_covariance(&walk, &(&one * q), &(&one * r)).unwrap();
        assert!((found[(0, 0)] - p).abs() < 1e-12 * p);
        let k = kalman_gain(&walk, &found, &(&one * r)).unwrap();
        assert!((k[(0, 0)] - p / (p + r)).abs() < 1e-12);
        // An integrator that nothing drives has no stationary gain but zero, and one that nobody sees has none.
        let blind = StateSpace::new(one.clone(), one.clone(), dmatrix![0.0], dmatrix![0.0], clock).unwrap();
        assert!(stationary_covariance(&blind, &one, &one).is_err());
    }
}
