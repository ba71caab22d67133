//! One step ahead: the model with a Kalman gain.

use super::Frozen;
use super::simulate::Steps;
use crate::PipelineError;
use lpv_core::nalgebra::{Cholesky, DMatrix, DVector, LU};
use lpv_core::{Discrete, Record, StateSpace};

/// Gain K of the stationary Kalman filter `x+ = A x + B u + K (y - C x - D u)` for process noise of covariance `q`
/// (`n x n`) and measurement noise of covariance `r` (`n_y x n_y`), by the structure-preserving doubling algorithm.
/// Eigenvalues of A on the unit circle are fine where `q` reaches them.
///
/// # Errors
/// [`PipelineError::Structure`] if the iteration does not settle: a state on or outside the unit circle that no output sees
/// or no noise drives.
pub fn riccati_gain(
    system: &StateSpace<Discrete>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, PipelineError> {
    let failed = PipelineError::Structure {
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
        if change <= 1e-12 * h.amax() {
            let s = c * &h * c.transpose() + r;
            let Some(s_inverse) = Cholesky::new(s).map(|f| f.inverse()) else {
                return Err(failed);
            };
            return Ok(system.a() * &h * c.transpose() * s_inverse);
        }
    }
    Err(failed)
}

/// A model with its gain at a few positions, interpolated in between.
pub struct Predictor<'a, M: Frozen> {
    model: &'a M,
    /// Scheduling value and gain, increasing; one entry for a time-invariant model.
    gains: Vec<(f64, DMatrix<f64>)>,
}

impl<'a, M: Frozen> Predictor<'a, M> {
    /// One gain everywhere.
    pub fn with_gain(model: &'a M, gain: DMatrix<f64>) -> Self {
        Self {
            model,
            gains: vec![(0.0, gain)],
        }
    }

    /// Gains for inputs that are disturbed by white noise of the given deviations and outputs that are measured with
    /// `noise`, at each of `positions` (none for a time-invariant model).
    ///
    /// # Errors
    /// Those of [`riccati_gain`]; positions outside the range.
    pub fn for_disturbance(
        model: &'a M,
        positions: &[f64],
        disturbance: &[f64],
        noise: &[f64],
    ) -> Result<Self, PipelineError> {
        let r = DMatrix::from_diagonal(&DVector::from_iterator(noise.len(), noise.iter().map(|s| s * s)));
        let places: Vec<(f64, Vec<f64>)> = if positions.is_empty() {
            vec![(0.0, Vec::new())]
        } else {
            positions.iter().map(|&p| (p, vec![p])).collect()
        };
        let gains = places
            .into_iter()
            .map(|(at, p)| {
                let frozen = model.at(&p)?;
                let mut b = frozen.b().clone();
                for (mut column, s) in b.column_iter_mut().zip(disturbance) {
                    column *= *s;
                }
                Ok((at, riccati_gain(&frozen, &(&b * b.transpose()), &r)?))
            })
            .collect::<Result<_, PipelineError>>()?;
        Ok(Self { model, gains })
    }

    fn gain(&self, p: Option<f64>) -> DMatrix<f64> {
        let p = p.unwrap_or(0.0);
        let above = self.gains.partition_point(|(at, _)| *at <= p);
        if above == 0 || self.gains.len() == 1 {
            return self.gains[0].1.clone();
        }
        if above == self.gains.len() {
            return self.gains[above - 1].1.clone();
        }
        let ((low, k0), (high, k1)) = (&self.gains[above - 1], &self.gains[above]);
        let t = (p - low) / (high - low);
        k0 * (1.0 - t) + k1 * t
    }

    /// Errors `y - yhat` of the one-step prediction over the first `samples` samples, `n_y x samples`.
    ///
    /// # Errors
    /// Channels that do not fit; p outside the range.
    pub fn errors(
        &self,
        record: &Record,
        initial_state: Option<&DVector<f64>>,
        samples: usize,
    ) -> Result<DMatrix<f64>, PipelineError> {
        let steps = Steps::new(self.model, record);
        let first = steps.at(0)?;
        let (nu, ny) = (record.inputs.channels(), record.outputs.channels());
        if first.inputs() != nu || first.outputs() != ny {
            return Err(PipelineError::Structure {
                problem: "prediction: the record has another number of inputs or outputs than the model",
            });
        }
        let mut x = initial_state.map_or_else(|| DVector::zeros(first.states()), DVector::clone);
        let samples = samples.min(record.len());
        let mut errors = DMatrix::zeros(ny, samples);
        let mut frozen = first;
        for k in 0..samples {
            if !steps.stays(k) {
                frozen = steps.at(k)?;
            }
            let mut u = DVector::from_fn(nu, |j, _| record.inputs.columns[j][k]);
            let mut y = DVector::from_fn(ny, |i, _| record.outputs.columns[i][k]);
            if let Some((u0, y0)) = self.model.offsets() {
                u -= u0;
                y -= y0;
            }
            let e = y - frozen.c() * &x - frozen.d() * &u;
            errors.set_column(k, &e);
            let p = record.scheduling.columns.first().map(|c| c[k]);
            x = frozen.a() * &x + frozen.b() * &u + self.gain(p) * e;
        }
        Ok(errors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::nalgebra::dmatrix;

    /// The scalar random walk: P = P - P^2/(P + r) + q has the positive root of P^2 = q (P + r).
    #[test]
    fn gain_of_the_random_walk() {
        let clock = Discrete::new(1.0).unwrap();
        let one = dmatrix![1.0];
        let walk = StateSpace::new(one.clone(), one.clone(), one.clone(), dmatrix![0.0], clock).unwrap();
        let (q, r) = (0.5, 2.0);
        let p: f64 = (q + f64::sqrt(q * q + 4.0 * q * r)) / 2.0;
        let k = riccati_gain(&walk, &(&one * q), &(&one * r)).unwrap();
        assert!((k[(0, 0)] - p / (p + r)).abs() < 1e-12);
        // An integrator that nothing drives has no stationary gain but zero, and one that nobody sees has none.
        let blind = StateSpace::new(one.clone(), one.clone(), dmatrix![0.0], dmatrix![0.0], clock).unwrap();
        assert!(riccati_gain(&blind, &one, &one).is_err());
    }
}
