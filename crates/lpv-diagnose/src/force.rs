//! The force at the inputs that would explain an error, and how well it is known.

use crate::TraceError;
use crate::base::Pair;
use crate::fit::Explained;
use crate::track::Track;
use lpv_core::linalg::pseudo_inverse;
use lpv_core::{Continuous, ControllerState, Discrete, StateSpace};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What has to be added to the inputs of a model for its outputs to be those of the record, by sample.
#[derive(Debug, Clone, PartialEq)]
pub struct EquivalentForce {
    /// Its mean given the whole record, in units of the inputs.
    pub value: Vec<Pair>,
    /// Its standard deviation.
    pub deviation: Vec<Pair>,
    /// Motor forces that do the same.
    pub motors: Vec<Pair>,
}

/// Steps of the random walk that are tried, over the root mean square of an input; without any the force is constant.
const WALKS: [f64; 8] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Kalman filter and smoother along a moving p (Bierman, International Journal of Control 18, 1973, 65-75) for the departure of a
/// record from the closed-loop simulation of a model: the departures of inputs and outputs belong to the linear part of
/// the machine with a force at its inputs that walks at random and sensors with white `noise`. The step of the walk is the
/// likeliest of a few.
///
/// # Errors
/// [`TraceError::Diverges`]; [`TraceError::Core`] of a machine that cannot be sampled.
pub fn equivalent_force(
    model: &Explained,
    controller: &ControllerState,
    track: &Track,
    noise: Pair,
) -> Result<EquivalentForce, TraceError> {
    let smoother = Smoother::new(model, controller, track, noise)?;
    let walk = likeliest(std::slice::from_ref(&smoother));
    let (value, deviation) = smoother.smooth(walk);
    let motors = value.iter().enumerate();
    Ok(EquivalentForce {
        motors: motors
            .map(|(k, d)| model.base.commanded(track.scheduling(k)[0], *d))
            .collect(),
        value,
        deviation,
    })
}

/// Errors one step ahead by record and sample: what the filter of [`equivalent_force`] finds in a sample that the past did not
/// tell. One step of the walk serves all records, the one under which all together are the likeliest.
///
/// # Errors
/// Those of [`equivalent_force`].
pub fn prediction_errors(
    model: &Explained,
    controller: &ControllerState,
    tracks: &[Track],
    noise: Pair,
) -> Result<Vec<Vec<Pair>>, TraceError> {
    let filters = tracks
        .par_iter()
        .map(|track| Smoother::new(model, controller, track, noise))
        .collect::<Result<Vec<_>, _>>()?;
    let walk = likeliest(&filters);
    Ok(filters.par_iter().map(|f| f.filter(walk).innovations).collect())
}

/// The step of the walk under which records together are the likeliest.
fn likeliest(filters: &[Smoother]) -> f64 {
    let likelihood = |walk: f64| {
        filters
            .par_iter()
            .map(|f| f.filter(walk).likelihood)
            .collect::<Vec<_>>()
    };
    WALKS
        .par_iter()
        .map(|walk| (likelihood(*walk).iter().sum::<f64>(), *walk))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(WALKS[0], |best| best.1)
}

/// The machine from each sample to the next, at the scheduling half-way.
fn systems(model: &Explained, track: &Track) -> Result<Vec<StateSpace<Discrete>>, TraceError> {
    let clock = Discrete::new(track.step)?;
    let mut machine = model.base.clone();
    model.blocks().iter().for_each(|b| b.mount(&mut machine));
    let at = |p: f64| -> Result<StateSpace<Discrete>, TraceError> {
        let [a, b, c] = machine.frozen(p)?;
        let direct = DMatrix::zeros(c.nrows(), b.ncols());
        Ok(StateSpace::new(a, b, c, direct, Continuous)?.zero_order_hold(clock)?)
    };
    let halfway = |k: usize| track.at(k, track.fine())[0];
    let constant = (1..track.samples).all(|k| halfway(k) == halfway(0));
    if constant {
        return Ok(vec![at(halfway(0))?; track.samples]);
    }
    (0..track.samples)
        .into_par_iter()
        .map(|k| at(halfway(k)))
        .collect()
}

/// Filter and smoother of one record.
struct Smoother {
    systems: Vec<StateSpace<Discrete>>,
    inputs: Vec<DVector<f64>>,
    outputs: Vec<DVector<f64>>,
    noise: Pair,
    size: Pair,
}

/// What the filter leaves behind.
struct Filtered {
    steps: Vec<Step>,
    innovations: Vec<Pair>,
    likelihood: f64,
}

/// One sample of the filter.
struct Step {
    /// State and force given the past, and their covariance.
    predicted: (DVector<f64>, DMatrix<f64>),
    /// C of state and force.
    c: DMatrix<f64>,
    /// Covariance of the innovation, inverted, times the innovation, and times C.
    weighed: (DVector<f64>, DMatrix<f64>),
    gain: DMatrix<f64>,
}

impl Smoother {
    fn new(
        model: &Explained,
        controller: &ControllerState,
        track: &Track,
        noise: Pair,
    ) -> Result<Self, TraceError> {
        let run = model
            .closed_loop(controller, track)
            .ok_or_else(|| TraceError::Diverges {
                record: track.name.clone(),
            })?;
        let channels = model.base.channels();
        let pairs = |a: &[Pair], b: &[Pair]| -> Vec<DVector<f64>> {
            let gap = |(a, b): (&Pair, &Pair)| DVector::from_fn(channels, |i, _| a[i] - b[i]);
            a.iter().zip(b).map(gap).collect()
        };
        Ok(Self {
            systems: systems(model, track)?,
            inputs: pairs(&track.inputs, &run.inputs),
            outputs: pairs(&track.outputs, &run.outputs),
            noise: noise.map(|n| n.max(f64::MIN_POSITIVE)),
            size: std::array::from_fn(|i| {
                let sum: f64 = track.inputs.iter().map(|u| u[i] * u[i]).sum();
                (sum / track.samples as f64).sqrt().max(f64::MIN_POSITIVE)
            }),
        })
    }

    fn shape(&self) -> (usize, usize) {
        (self.systems[0].states(), self.systems[0].outputs())
    }

    /// State and force together, from a sample to the next.
    fn transition(&self, k: usize) -> DMatrix<f64> {
        let (n, m) = self.shape();
        let s = &self.systems[k];
        let mut f = DMatrix::identity(n + m, n + m);
        f.view_mut((0, 0), (n, n)).copy_from(s.a());
        f.view_mut((0, n), (n, m)).copy_from(s.b());
        f
    }

    fn filter(&self, walk: f64) -> Filtered {
        let (n, m) = self.shape();
        let square = |v: Pair, factor: f64| DVector::from_fn(m, |i, _| (factor * v[i]).powi(2));
        let noise = DMatrix::from_diagonal(&square(self.noise, 1.0));
        let walk = DMatrix::from_diagonal(&square(self.size, walk));
        let mut x = DVector::zeros(n + m);
        let mut p = DMatrix::zeros(n + m, n + m);
        // At rest, as well as the sensors tell; forces may be there from the start.
        if let Ok(inverse) = pseudo_inverse(self.systems[0].c().clone(), 1e-12) {
            p.view_mut((0, 0), (n, n))
                .copy_from(&(&inverse * &noise * inverse.transpose()));
        }
        p.view_mut((n, n), (m, m))
            .copy_from(&DMatrix::from_diagonal(&square(self.size, 0.3)));
        let mut found = Filtered {
            steps: Vec::with_capacity(self.outputs.len()),
            innovations: Vec::with_capacity(self.outputs.len()),
            likelihood: 0.0,
        };
        for k in 0..self.outputs.len() {
            let predicted = (x.clone(), p.clone());
            let mut c = DMatrix::zeros(m, n + m);
            c.columns_mut(0, n).copy_from(self.systems[k].c());
            let error = &self.outputs[k] - &c * &x;
            let cp = &c * &p;
            let spread = &cp * c.transpose() + &noise;
            let of = |i: usize| error.get(i).copied().unwrap_or(0.0);
            found.innovations.push(std::array::from_fn(of));
            let Some(root) = spread.cholesky() else {
                found.likelihood = f64::NEG_INFINITY;
                return found;
            };
            let gain = root.solve(&cp).transpose();
            let weighed = (root.solve(&error), root.solve(&c));
            found.likelihood -= 0.5 * error.dot(&weighed.0) + root.l().diagonal().map(f64::ln).sum();
            x += &gain * error;
            p -= &gain * cp;
            let f = self.transition(k);
            x = &f * x;
            x.rows_mut(0, n)
                .gemv(1.0, self.systems[k].b(), &self.inputs[k], 1.0);
            p = &f * p * f.transpose();
            p = 0.5 * (&p + p.transpose());
            let mut forces = p.view_mut((n, n), (m, m));
            forces += &walk;
            found.steps.push(Step {
                predicted,
                c,
                weighed,
                gain,
            });
        }
        found
    }

    fn smooth(&self, walk: f64) -> (Vec<Pair>, Vec<Pair>) {
        let (n, m) = self.shape();
        let found = self.filter(walk);
        let count = found.steps.len();
        let (mut value, mut deviation) = (vec![[0.0; 2]; count], vec![[0.0; 2]; count]);
        // What the future adds: the gradient and the curvature of its likelihood.
        let mut slope = DVector::zeros(n + m);
        let mut bend = DMatrix::zeros(n + m, n + m);
        for (k, step) in found.steps.iter().enumerate().rev() {
            let f = self.transition(k);
            let rest = &f - &f * &step.gain * &step.c;
            slope = rest.tr_mul(&slope) - step.c.tr_mul(&step.weighed.0);
            bend = rest.tr_mul(&(&bend * &rest)) + step.c.tr_mul(&step.weighed.1);
            let (x, p) = &step.predicted;
            let x = x - p * &slope;
            let p = p - p * &bend * p;
            for i in 0..m {
                value[k][i] = x[n + i];
                deviation[k][i] = p[(n + i, n + i)].max(0.0).sqrt();
            }
        }
        (value, deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::Smoother;
    use lpv_core::{Discrete, StateSpace};
    use nalgebra::{DMatrix, DVector, dmatrix};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// A mass of one that a force pushes as no model told: the smoother finds it, as closely as it says.
    #[test]
    fn a_force_is_found_as_closely_as_stated() -> Result<(), lpv_core::CoreError> {
        let step = 0.01;
        let mass = StateSpace::new(
            dmatrix![1.0, step; 0.0, 1.0],
            dmatrix![0.5 * step * step; step],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
            Discrete::new(step)?,
        )?;
        let n = 2000;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut draw = |size: f64| -> f64 {
            let x: f64 = StandardNormal.sample(&mut rng);
            size * x
        };
        let (noise, walk) = (1e-5, 0.02);
        let (mut x, mut force) = (DVector::zeros(2), 0.0);
        let (mut forces, mut outputs) = (Vec::new(), Vec::new());
        for _ in 0..n {
            forces.push(force);
            outputs.push(DVector::from_element(1, x[0] + draw(noise)));
            x = mass.a() * x + mass.b() * force;
            force += draw(walk);
        }
        let smoother = Smoother {
            systems: vec![mass; n],
            inputs: vec![DVector::zeros(1); n],
            outputs,
            noise: [noise, 1.0],
            size: [1.0, 1.0],
        };
        let (value, deviation) = smoother.smooth(walk);
        let departure = |k: usize| (value[k][0] - forces[k]) / deviation[k][0];
        let mean = (50..n - 50).map(|k| departure(k).powi(2)).sum::<f64>() / (n - 100) as f64;
        assert!((0.7..1.3).contains(&mean), "{mean}");
        // One step ahead the error has the variance that the stationary Riccati equation tells.
        let f: DMatrix<f64> = dmatrix![1.0, step, 0.5 * step * step; 0.0, 1.0, step; 0.0, 0.0, 1.0];
        let mut p = DMatrix::<f64>::identity(3, 3);
        for _ in 0..3000 {
            let gain: DVector<f64> = p.column(0) / (p[(0, 0)] + noise * noise);
            p = &f * (&p - &gain * p.row(0)) * f.transpose();
            p[(2, 2)] += walk * walk;
        }
        let told = p[(0, 0)] + noise * noise;
        let innovations = smoother.filter(walk).innovations;
        let ahead = innovations.iter().map(|e| e[0] * e[0]).sum::<f64>() / n as f64;
        assert!((0.9..1.1).contains(&(ahead / told)), "{ahead}, {told}");
        let likelihood = |walk: f64| smoother.filter(walk).likelihood;
        assert!(likelihood(walk) > likelihood(0.1 * walk) && likelihood(walk) > likelihood(10.0 * walk));
        Ok(())
    }
}
