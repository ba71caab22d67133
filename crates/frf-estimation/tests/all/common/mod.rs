//! A closed loop to estimate: two resonances, two inputs, two outputs, static controller, noise on the outputs.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Purpose, Record, RecordKind, Signals, StateSpace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use realfft::RealFftPlanner;

pub const RATE: f64 = 20.0;

pub fn clock() -> Discrete {
    Discrete::from_rate(RATE).unwrap()
}

/// Poles of radius `radius` at the angles 0.5 and 1.2.
pub fn plant(radius: f64) -> StateSpace<Discrete> {
    let mut a = DMatrix::zeros(4, 4);
    for (i, angle) in [0.5f64, 1.2].into_iter().enumerate() {
        let (s, c) = angle.sin_cos();
        let block = DMatrix::from_row_slice(2, 2, &[c, s, -s, c]) * radius;
        a.view_mut((2 * i, 2 * i), (2, 2)).copy_from(&block);
    }
    let b = DMatrix::from_row_slice(4, 2, &[0.3, 0.1, 0.2, -0.1, -0.1, 0.3, 0.1, 0.2]);
    let c = DMatrix::from_row_slice(2, 4, &[0.5, 0.2, 0.1, 0.2, -0.1, 0.2, 0.6, 0.1]);
    StateSpace::new(a, b, c, DMatrix::zeros(2, 2), clock()).unwrap()
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A period of a random-phase multisine with unit amplitude at the given lines.
pub fn multisine(period: usize, lines: &[usize], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(period);
    let mut spectrum = plan.make_input_vec();
    for &k in lines {
        spectrum[k] = Complex::from_polar(0.5, rng.random::<f64>() * std::f64::consts::TAU);
    }
    let mut out = plan.make_output_vec();
    plan.process(&mut spectrum, &mut out).unwrap();
    out
}

/// What the loop does besides being linear.
#[derive(Clone, Copy, Default)]
pub struct Loop {
    pub noise: f64,
    pub cubic: f64,
    pub quadratic: f64,
    /// Gain of the static controller; zero opens the loop.
    pub gain: f64,
    pub initial_state: f64,
}

/// One record: `u = r - gain y` reaches the plant as `u + cubic u^3 + quadratic u^2`.
pub fn simulate(
    plant: &StateSpace<Discrete>,
    r: &[Vec<f64>],
    samples: usize,
    what: Loop,
    rng: &mut ChaCha8Rng,
) -> Record {
    let period = r[0].len();
    let mut x = DVector::from_element(plant.states(), what.initial_state);
    let mut columns = vec![vec![Vec::new(); 2]; 3];
    for t in 0..samples {
        let mut y = plant.c() * &x;
        y.iter_mut().for_each(|v| *v += what.noise * normal(rng));
        let reference = DVector::from_fn(2, |i, _| r[i][t % period]);
        let u = &reference - &y * what.gain;
        let acting = u.map(|u| u + what.cubic * u * u * u + what.quadratic * u * u);
        x = plant.a() * x + plant.b() * acting;
        for (c, v) in columns.iter_mut().zip([&y, &u, &reference]) {
            c[0].push(v[0]);
            c[1].push(v[1]);
        }
    }
    let references = columns.pop().unwrap();
    let inputs = columns.pop().unwrap();
    let outputs = columns.pop().unwrap();
    Record {
        name: "loop".into(),
        kind: RecordKind::Periodic { period },
        purpose: Purpose::Estimation,
        position: Some(0.1.into()),
        outputs: Signals::new(&["y1", "y2"], outputs),
        inputs: Signals::new(&["u1", "u2"], inputs),
        references: Signals::new(&["r1", "r2"], references),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    }
}

/// Two experiments with orthogonal excitation `[r1, r2]` and `[r1, -r2]`.
pub fn orthogonal_pair(
    plant: &StateSpace<Discrete>,
    lines: &[usize],
    period: usize,
    periods: [usize; 2],
    what: Loop,
    rng: &mut ChaCha8Rng,
) -> Vec<Record> {
    let r1 = multisine(period, lines, rng);
    let r2 = multisine(period, lines, rng);
    [1.0, -1.0]
        .iter()
        .zip(periods)
        .map(|(sign, count)| {
            let r = [r1.clone(), r2.iter().map(|v| v * sign).collect()];
            simulate(plant, &r, count * period, what, rng)
        })
        .collect()
}

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}
