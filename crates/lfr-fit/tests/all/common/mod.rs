//! Models and responses for the tests.

#![allow(dead_code, reason = "each test program uses a part")]

use lfr_fit::{Candidate, FrozenData};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, Lfr, LfrBlocks, SchedulingRange, StateSpace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn random(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
}

pub(crate) fn clock() -> Discrete {
    Discrete::new(0.5).unwrap()
}

/// How a frozen model is sampled.
pub(crate) trait Sampled {
    /// The response of the model held at p, sampled by [`clock`].
    fn response(&self, p: &[f64], frequencies_hz: &[f64]) -> Frf;
}

impl Sampled for Candidate<Discrete> {
    fn response(&self, p: &[f64], frequencies_hz: &[f64]) -> Frf {
        self.frozen(p)
            .unwrap()
            .frequency_response(frequencies_hz)
            .unwrap()
    }
}

impl Sampled for Candidate<Continuous> {
    fn response(&self, p: &[f64], frequencies_hz: &[f64]) -> Frf {
        let held = self.frozen(p).unwrap().zero_order_hold(clock()).unwrap();
        held.frequency_response(frequencies_hz).unwrap()
    }
}

pub(crate) fn lines(count: usize) -> Vec<f64> {
    (0..count).map(|k| (k as f64 + 0.5) / count as f64).collect()
}

/// Two lightly damped states, `n_u = n_y = channels`, deltas of the parameters given; D22 is zero.
pub(crate) fn blocks(a: [f64; 4], channels: usize, deltas: usize, seed: u64) -> LfrBlocks {
    let mut rng = rng(seed);
    LfrBlocks {
        a: DMatrix::from_row_slice(2, 2, &a),
        b1: random(2, deltas, &mut rng) * 0.3,
        b2: random(2, channels, &mut rng) + DMatrix::from_element(2, channels, 1.5),
        c1: random(deltas, 2, &mut rng) * 0.5,
        d11: random(deltas, deltas, &mut rng) * 0.3,
        d12: random(deltas, channels, &mut rng) * 0.5,
        c2: random(channels, 2, &mut rng) + DMatrix::from_element(channels, 2, 1.5),
        d21: random(channels, deltas, &mut rng) * 0.3,
        d22: DMatrix::zeros(channels, channels),
    }
}

pub(crate) const SLOW: [f64; 4] = [-0.2, 1.1, -1.1, -0.2];
pub(crate) const INSIDE: [f64; 4] = [0.6, 0.5, -0.5, 0.6];

pub(crate) fn interval() -> SchedulingRange {
    SchedulingRange::interval(1.0, 3.0).unwrap()
}

pub(crate) fn one_parameter(repetitions: usize) -> Vec<DeltaBlock> {
    vec![DeltaBlock {
        parameter: 0,
        repetitions,
    }]
}

pub(crate) fn continuous(deltas: usize, seed: u64) -> Candidate<Continuous> {
    let blocks = blocks(SLOW, 2, deltas, seed);
    let lfr = Lfr::new(blocks, one_parameter(deltas), interval(), Continuous).unwrap();
    Candidate::from_lfr(&lfr).unwrap()
}

pub(crate) fn discrete(deltas: usize, seed: u64) -> Candidate<Discrete> {
    let blocks = blocks(INSIDE, 2, deltas, seed);
    let lfr = Lfr::new(blocks, one_parameter(deltas), interval(), clock()).unwrap();
    Candidate::from_lfr(&lfr).unwrap()
}

/// Responses at positions of one parameter.
pub(crate) fn responses(model: &impl Sampled, positions: &[f64], count: usize) -> Vec<(Vec<f64>, Frf)> {
    let at = |p: &f64| (vec![*p], model.response(&[*p], &lines(count)));
    positions.iter().map(at).collect()
}

pub(crate) fn relative(model: &impl Sampled, positions: &[f64], count: usize) -> FrozenData {
    FrozenData::relative(clock(), &responses(model, positions, count)).unwrap()
}

pub(crate) const POSITIONS: [f64; 7] = [1.0, 1.3, 1.7, 2.0, 2.3, 2.6, 3.0];

/// Largest relative difference of two models over positions between those of the data.
pub(crate) fn largest_error(found: &impl Sampled, truth: &impl Sampled) -> f64 {
    let errors = (0..=40).flat_map(|i| {
        let p = [1.0 + 0.05 * f64::from(i)];
        let truth = truth.response(&p, &lines(33));
        found.response(&p, &lines(33)).relative_error(&truth).unwrap()
    });
    errors.fold(0.0, f64::max)
}

/// The blocks with every entry but those of D22 changed by up to `part` of its size.
pub(crate) fn perturbed(m: &LfrBlocks, part: f64, seed: u64) -> LfrBlocks {
    let mut rng = rng(seed);
    let mut near = |m: &DMatrix<f64>| m.map(|v| v * (1.0 + part * rng.random_range(-1.0..1.0)));
    LfrBlocks {
        a: near(&m.a),
        b1: near(&m.b1),
        b2: near(&m.b2),
        c1: near(&m.c1),
        d11: near(&m.d11),
        d12: near(&m.d12),
        c2: near(&m.c2),
        d21: near(&m.d21),
        d22: m.d22.clone(),
    }
}

/// `a / (z - b)` as a state space of one state.
pub(crate) fn lag(gain: f64, pole: f64) -> StateSpace<Discrete> {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    StateSpace::new(one(pole), one(gain), one(1.0), one(0.0), clock()).unwrap()
}

pub(crate) fn diagonal(values: &[f64]) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_row_slice(values))
}
