//! Machines whose modes are known by construction: ranks, states, deviations, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use modal_fit::lpv_core::num_complex::Complex;
use modal_fit::lpv_core::{Discrete, Frf, FrfEstimate};
use modal_fit::{ModalFit, ModalFitError, ModalSettings, modal_fit};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

type C64 = Complex<f64>;

const RATE: f64 = 1000.0;

struct Machine {
    poles: Vec<C64>,
    shapes: Vec<Vec<f64>>,
    rigid: Vec<Vec<f64>>,
    size: (usize, usize),
}

impl Machine {
    /// Modes between 20 and 400 Hz, one shape each, and a rigid body of the given rank.
    fn new(modes: usize, rank: usize, size: (usize, usize), rng: &mut ChaCha8Rng) -> Self {
        let gap = 380.0 / modes as f64;
        let poles = (0..modes).map(|i| {
            let f = 20.0 + gap * (i as f64 + rng.random_range(0.1..0.9));
            let (w, d) = (
                std::f64::consts::TAU * f,
                10f64.powf(rng.random_range(-2.6..-1.6)),
            );
            (C64::new(-d * w, w * (1.0 - d * d).sqrt()) / RATE).exp()
        });
        let poles: Vec<C64> = poles.collect();
        let mut shape = || {
            (0..size.0 + size.1)
                .map(|_| StandardNormal.sample(rng))
                .collect::<Vec<f64>>()
        };
        let shapes = (0..modes).map(|_| shape()).collect();
        let rigid = (0..rank).map(|_| shape()).collect();
        Self {
            poles,
            shapes,
            rigid,
            size,
        }
    }

    fn response(&self, f: f64) -> Vec<C64> {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f / RATE);
        let phi = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (0.5 / RATE / RATE);
        let mut values = Vec::new();
        for j in 0..self.size.1 {
            for i in 0..self.size.0 {
                let mode = |(l, s): (&C64, &Vec<f64>)| {
                    let residue = C64::i() * (s[i] * s[self.size.0 + j] * 1e-3);
                    residue / (z - l) + residue.conj() / (z - l.conj())
                };
                let flexible: C64 = self.poles.iter().zip(&self.shapes).map(mode).sum();
                let body: f64 = self.rigid.iter().map(|s| s[i] * s[self.size.0 + j]).sum();
                values.push(flexible + phi * (body * 100.0));
            }
        }
        values
    }

    /// With noise of one deviation everywhere, correlated between outputs where `correlation` is not zero.
    fn estimate(&self, deviation: f64, correlation: f64, rng: &mut ChaCha8Rng) -> FrfEstimate {
        let (n_y, n_u) = self.size;
        let lines: Vec<f64> = (4..960).map(|k| 0.5 * f64::from(k)).collect();
        let mut values = Vec::new();
        for &f in &lines {
            let mut line = self.response(f);
            for column in line.chunks_exact_mut(n_y) {
                let mut one = || {
                    let (re, im): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
                    C64::new(re, im) / 2f64.sqrt()
                };
                let common = one();
                for v in column.iter_mut() {
                    *v += (one() * (1.0 - correlation).sqrt() + common * correlation.sqrt()) * deviation;
                }
            }
            values.extend(line);
        }
        let entry = |i: usize| {
            if i.is_multiple_of(n_y + 1) {
                1.0
            } else {
                correlation
            }
        };
        let c_v = (0..lines.len())
            .flat_map(|_| (0..n_y * n_y).map(|i| C64::from(entry(i) * deviation * deviation)));
        let s = (0..lines.len())
            .flat_map(|_| (0..n_u * n_u).map(|i| C64::from(f64::from(u8::from(i.is_multiple_of(n_u + 1))))));
        let (c_v, s) = (c_v.collect(), s.collect());
        FrfEstimate::new(
            Frf::new(lines, n_y, n_u, values).unwrap(),
            c_v,
            s,
            f64::INFINITY,
            None,
        )
        .unwrap()
    }

    fn fit(&self, estimate: &FrfEstimate, integrators: usize) -> ModalFit {
        let clock = Discrete::from_rate(RATE).unwrap();
        let near: Vec<C64> = self
            .poles
            .iter()
            .map(|l| l * C64::from_polar(0.9999, 1e-4))
            .collect();
        let settings = ModalSettings {
            integrators,
            ..ModalSettings::default()
        };
        modal_fit(estimate, clock, &near, &settings).unwrap()
    }
}

#[test]
fn states_are_those_of_the_machine_and_deviations_hold() {
    let (mut within, mut all, mut cost) = (0, 0, Vec::new());
    for seed in 0..12 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let size = (2 + seed as usize % 4, 2 + seed as usize % 3);
        let modes = 2 + seed as usize % 6;
        let rank = seed as usize % 3;
        let machine = Machine::new(modes, rank, size, &mut rng);
        let correlation = [0.0, 0.5, 0.9][seed as usize % 3];
        let estimate = machine.estimate(1e-4, correlation, &mut rng);
        let found = machine.fit(&estimate, if rank == 0 { 0 } else { 2 });
        assert_eq!(found.rigid_rank, rank, "seed {seed}");
        assert_eq!(found.model.states(), 2 * modes + 2 * rank, "seed {seed}");
        cost.push(found.account.cost / found.account.expected_cost);
        for (mode, truth) in found.modes.iter().zip(&machine.poles) {
            assert_eq!(mode.rank, 1);
            let s = truth.ln() * RATE;
            let (f, d) = (s.norm() / std::f64::consts::TAU, -s.re / s.norm());
            within += usize::from((mode.frequency_hz - f).abs() < 2.0 * mode.frequency_deviation_hz);
            within += usize::from((mode.damping - d).abs() < 2.0 * mode.damping_deviation);
            all += 2;
        }
        // The state space is the fitted model: its response errs by less than the noise.
        let lines = estimate.frf().frequencies_hz();
        let response = found.model.frequency_response(lines).unwrap();
        let mut error = 0.0;
        for (k, &f) in lines.iter().enumerate() {
            for (a, b) in response.line_slice(k).iter().zip(machine.response(f)) {
                error += (a - b).norm_sqr();
            }
        }
        let channels = (lines.len() * size.0 * size.1) as f64;
        // The Cramer-Rao bound without correlation: half an unknown a complex equation.
        let bound = 0.5 * found.account.unknowns as f64 / channels;
        let over = (error / channels).sqrt() / (1e-4 * bound.sqrt());
        assert!(over < 1.6, "seed {seed}: {over}");
    }
    assert!(cost.iter().all(|c| (c - 1.0).abs() < 0.1), "{cost:?}");
    // 95.4 % are expected; of some 100 values, 88 % is three deviations below.
    assert!(within as f64 > 0.88 * f64::from(all), "{within} of {all}");
}

#[test]
fn two_shapes_at_one_pole_are_kept() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut machine = Machine::new(3, 0, (3, 3), &mut rng);
    let twin = machine.poles[1];
    machine.poles.push(twin);
    machine.shapes.push(vec![1.0, -2.0, 0.5, 0.3, 1.0, -1.0]);
    let estimate = machine.estimate(1e-4, 0.0, &mut rng);
    machine.poles.pop();
    let found = machine.fit(&estimate, 0);
    let ranks: Vec<usize> = found.modes.iter().map(|m| m.rank).collect();
    assert_eq!(ranks, [1, 2, 1]);
    assert!(found.account.cost < 1.1 * found.account.expected_cost);
}

#[test]
fn what_cannot_be_fitted_is_refused_by_name() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let machine = Machine::new(2, 0, (2, 2), &mut rng);
    let estimate = machine.estimate(1e-4, 0.0, &mut rng);
    let clock = Discrete::from_rate(RATE).unwrap();
    let settings = ModalSettings::default();
    let of = |poles: &[C64], settings: &ModalSettings| modal_fit(&estimate, clock, poles, settings);
    let twice = [machine.poles[0], machine.poles[0]];
    assert!(matches!(
        of(&twice, &settings),
        Err(ModalFitError::Pole { index: 1, .. })
    ));
    assert!(matches!(
        of(&[], &settings),
        Err(ModalFitError::Empty { what: "poles" })
    ));
    let nan = [C64::new(f64::NAN, 0.0)];
    assert!(matches!(
        of(&nan, &settings),
        Err(ModalFitError::Pole { index: 0, .. })
    ));
    let three = ModalSettings {
        integrators: 3,
        ..settings
    };
    assert!(matches!(
        of(&machine.poles, &three),
        Err(ModalFitError::Integrators { found: 3 })
    ));
    let few = estimate.select(|k, _| k < 2);
    let refused = modal_fit(&few, clock, &machine.poles, &settings);
    assert!(
        matches!(refused, Err(ModalFitError::TooFewEquations { .. })),
        "{refused:?}"
    );
}
