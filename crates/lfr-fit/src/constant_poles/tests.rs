#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use super::*;
use crate::test_kit::{random, rng};
use lpv_core::{Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::DMatrix;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

const RATE: f64 = 1000.0;

/// A machine of a rigid body and modes whose shapes are waves over the stroke: `phi(x) = cos(k x + a)` at sensors and actuators.
struct Machine {
    /// Frequencies and dampings.
    modes: Vec<(f64, f64)>,
    waves: Vec<(f64, f64)>,
    sensors: Vec<f64>,
    actuators: Vec<f64>,
    shapes: ShapesAt,
    /// Relative change of the frequencies over the half-range.
    softening: f64,
}

impl Machine {
    fn new(seed: u64, shapes: ShapesAt) -> Self {
        let mut rng = rng(seed);
        let modes = [60.0, 110.0, 190.0];
        Self {
            modes: modes
                .map(|f| (f * rng.random_range(0.9..1.1), rng.random_range(0.003..0.02)))
                .to_vec(),
            waves: (0..3)
                .map(|k| (0.4 + 0.3 * f64::from(k), rng.random_range(0.0..6.0)))
                .collect(),
            sensors: (0..3).map(|_| rng.random_range(-3.0..3.0)).collect(),
            actuators: (0..2).map(|_| rng.random_range(-3.0..3.0)).collect(),
            shapes,
            softening: 0.0,
        }
    }

    fn frozen(&self, p: f64) -> StateSpace<Continuous> {
        // Heave and tilt, then the modes.
        let shape = |x: f64| -> Vec<f64> {
            let rigid = [1.0, 0.3 * x].into_iter();
            rigid
                .chain(self.waves.iter().map(|(k, a)| (k * x + a).cos()))
                .collect()
        };
        let seen = if self.shapes.has_outputs() { p } else { 0.0 };
        let moved = if self.shapes.has_inputs() { p } else { 0.0 };
        let n = 2 + self.modes.len();
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        let mut b = DMatrix::zeros(2 * n, self.actuators.len());
        let mut c = DMatrix::zeros(self.sensors.len(), 2 * n);
        for i in 0..n {
            a[(i, n + i)] = 1.0;
            if let Some((f, zeta)) = i.checked_sub(2).map(|k| self.modes[k]) {
                let w = std::f64::consts::TAU * f * (1.0 + self.softening * p);
                a[(n + i, i)] = -w * w;
                a[(n + i, n + i)] = -2.0 * zeta * w;
            }
            for (j, x) in self.actuators.iter().enumerate() {
                b[(n + i, j)] = shape(x - moved)[i];
            }
            for (j, x) in self.sensors.iter().enumerate() {
                c[(j, i)] = shape(x - seen)[i];
            }
        }
        let d = DMatrix::zeros(c.nrows(), b.ncols());
        StateSpace::new(a, b, c, d, Continuous).unwrap()
    }

    fn poles(&self, p: f64) -> Vec<C64> {
        let pole = |(f, zeta): &(f64, f64)| {
            let w = std::f64::consts::TAU * f * (1.0 + self.softening * p);
            (C64::new(-zeta * w, w * (1.0 - zeta * zeta).sqrt()) / RATE).exp()
        };
        self.modes.iter().map(pole).collect()
    }

    fn response(&self, p: f64, clock: Discrete) -> Frf {
        let lines: Vec<f64> = (1..=800).map(|k| 0.5 * f64::from(k)).collect();
        crate::sampled(&self.frozen(p), clock)
            .unwrap()
            .unwrap()
            .frequency_response(&lines)
            .unwrap()
    }

    /// With noise of this part of the median response, the same on every line.
    fn data(&self, positions: &[f64], part: f64, seed: u64) -> (FrozenData, f64) {
        let clock = Discrete::new(1.0 / RATE).unwrap();
        let mut rng = rng(seed);
        let mut sizes: Vec<f64> = (0..800)
            .map(|k| self.response(0.0, clock).line(k).norm())
            .collect();
        sizes.sort_by(f64::total_cmp);
        let noise = part * sizes[400] / 6f64.sqrt();
        let estimates: Vec<(Vec<f64>, FrfEstimate)> = positions
            .iter()
            .map(|&p| {
                let mut frf = self.response(p, clock);
                let lines = frf.len();
                for k in 0..lines {
                    for v in frf.line_slice_mut(k) {
                        let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
                        *v += C64::new(one(), one()) * (noise / 2f64.sqrt());
                    }
                }
                let covariance = |n: usize, v: f64| {
                    let one = DMatrix::<C64>::identity(n, n) * C64::from(v);
                    (0..lines)
                        .flat_map(|_| one.as_slice().to_vec())
                        .collect::<Vec<_>>()
                };
                let (c, s) = (covariance(3, noise * noise), covariance(2, 1.0));
                (vec![p], FrfEstimate::new(frf, c, s, f64::INFINITY, None).unwrap())
            })
            .collect();
        let poles: Vec<Vec<C64>> = positions.iter().map(|p| self.poles(*p)).collect();
        let data = FrozenData::weighted(clock, &estimates, 0.0)
            .unwrap()
            .with_poles(&poles)
            .unwrap();
        (data, noise)
    }
}

fn positions(count: usize) -> Vec<f64> {
    (0..count)
        .map(|i| 2.0 * i as f64 / (count - 1) as f64 - 1.0)
        .collect()
}

/// The median over the lines of the error between the positions over the noise of a response, the largest of several places.
fn between(found: &ConstantPoles, machine: &Machine, noise: f64) -> f64 {
    let clock = Discrete::new(1.0 / RATE).unwrap();
    let at = |p: f64| {
        let model = crate::sampled(&found.refined.candidate.frozen(&[p]).unwrap(), clock)
            .unwrap()
            .unwrap();
        let truth = machine.response(p, clock);
        let model = model.frequency_response(truth.frequencies_hz()).unwrap();
        let mut errors: Vec<f64> = (0..truth.len())
            .map(|k| (model.line(k) - truth.line(k)).norm() / (noise * 6f64.sqrt()))
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    [-0.93, -0.61, -0.2, 0.13, 0.47, 0.85]
        .map(at)
        .into_iter()
        .fold(0.0, f64::max)
}

/// Sensors, actuators or both see waves pass by: over decades of noise the model is at the noise at the positions and below it between
/// them, with the states of the machine and no more.
#[test]
fn shapes_are_found_over_decades_of_noise() {
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    for (seed, shapes) in [
        (1, ShapesAt::Outputs),
        (2, ShapesAt::Inputs),
        (3, ShapesAt::Both),
        (4, ShapesAt::Both),
    ] {
        for part in [1e-2, 1e-4] {
            let machine = Machine::new(seed, shapes);
            let (data, noise) = machine.data(&positions(7), part, 10 + seed);
            let found = constant_poles(&data, true, &range, &GrowSettings::default()).unwrap();
            let found = found.unwrap_or_else(|| panic!("{shapes:?}, {part}: nothing found"));
            let what = format!("{shapes:?}, {part}: {:?}, degree {}", found.sizes, found.degree);
            assert_eq!((found.shapes, found.rank), (shapes, 2), "{what}");
            assert_eq!(found.refined.candidate.states(), 10, "{what}");
            let rms = residual(&found.refined.candidate, &data).unwrap();
            assert!((0.97..1.1).contains(&rms), "{what}: {rms}");
            let error = between(&found, &machine, noise);
            assert!(error < 1.0, "{what}: {error} between the positions");
        }
    }
}

/// A mode that is out of sight at one position, with a pole of nothing found there in its place.
#[test]
fn a_pole_that_one_position_misses_is_found_at_the_others() {
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let machine = Machine::new(1, ShapesAt::Outputs);
    let (data, noise) = machine.data(&positions(7), 1e-3, 3);
    let mut poles: Vec<Vec<C64>> = positions(7).iter().map(|p| machine.poles(*p)).collect();
    poles[2][1] = (C64::new(-30.0, 1900.0) / RATE).exp();
    poles[5].pop();
    let data = data.with_poles(&poles).unwrap();
    let found = constant_poles(&data, true, &range, &GrowSettings::default())
        .unwrap()
        .unwrap();
    assert_eq!(found.refined.candidate.states(), 10);
    assert!(between(&found, &machine, noise) < 1.0);
}

#[test]
fn poles_that_move_are_not_constant() {
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let mut machine = Machine::new(5, ShapesAt::Outputs);
    // A frequency that moves by a twentieth, and by a few of its half-widths.
    for softening in [0.05, 0.01] {
        machine.softening = softening;
        let (data, _) = machine.data(&positions(5), 1e-3, 1);
        let found = constant_poles(&data, true, &range, &GrowSettings::default()).unwrap();
        assert!(found.is_none(), "{softening}");
    }
    // Two positions tell no function of p.
    machine.softening = 0.0;
    let (data, _) = machine.data(&positions(2), 1e-3, 1);
    assert!(
        constant_poles(&data, true, &range, &GrowSettings::default())
            .unwrap()
            .is_none()
    );
}

/// The realisation of a polynomial is the polynomial, and cut to fewer directions is near it.
#[test]
fn a_polynomial_is_realised() {
    let mut rng = rng(3);
    let coefficients: Vec<DMatrix<f64>> = (0..3).map(|_| random(2, 4, &mut rng)).collect();
    let found = crate::ho_kalman::HoKalman::new(&coefficients).unwrap();
    let whole = found.cut(usize::MAX);
    for delta in [-1.0, -0.3, 0.7] {
        let wanted: DMatrix<f64> = coefficients
            .iter()
            .enumerate()
            .fold(DMatrix::zeros(2, 4), |sum, (k, s)| {
                sum + s * f64::powi(delta, k as i32 + 1)
            });
        let size = whole.inner.nrows();
        let inverse = (DMatrix::identity(size, size) - &whole.inner * delta)
            .try_inverse()
            .unwrap();
        let got = &whole.left * (inverse * delta) * &whole.right;
        assert!((got - wanted).norm() < 1e-10, "{delta}");
    }
    assert_eq!(found.cut(2).left.ncols(), 2);
}
