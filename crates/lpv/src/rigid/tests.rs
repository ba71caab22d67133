use super::*;
use crate::{RigidBody, RigidTerms};
use lpv_core::nalgebra::dmatrix;
use lpv_core::{Continuous, StateSpace};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// Mass matrix, friction to ground and one flexible mode at `hz` behind a hold at 2 kHz, with relative noise.
fn estimate(
    mass: &DMatrix<f64>,
    friction: &DMatrix<f64>,
    (hz, noise): (f64, f64),
    position: f64,
    seed: u64,
) -> (FrfEstimate, Discrete) {
    let clock = Discrete::from_rate(2000.0).unwrap();
    let n = mass.nrows();
    let gain = mass.clone().try_inverse().unwrap();
    let mut a = DMatrix::zeros(2 * n + 2, 2 * n + 2);
    a.view_mut((0, n), (n, n)).fill_with_identity();
    a.view_mut((n, n), (n, n)).copy_from(&(-&gain * friction));
    let w = std::f64::consts::TAU * hz;
    a[(2 * n, 2 * n + 1)] = 1.0;
    a[(2 * n + 1, 2 * n)] = -w * w;
    a[(2 * n + 1, 2 * n + 1)] = -0.03 * w;
    let mut b = DMatrix::zeros(2 * n + 2, n);
    b.rows_mut(n, n).copy_from(&gain);
    b.row_mut(2 * n + 1).fill(0.3 * gain[(0, 0)]);
    let mut c = DMatrix::zeros(n, 2 * n + 2);
    c.view_mut((0, 0), (n, n)).fill_with_identity();
    c.column_mut(2 * n).fill(1.0);
    let machine = StateSpace::new(a, b, c, DMatrix::zeros(n, n), Continuous).unwrap();
    let lines: Vec<f64> = (1..400).map(|k| 2.0 * f64::from(k)).collect();
    let exact = machine
        .zero_order_hold(clock)
        .unwrap()
        .frequency_response(&lines)
        .unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let (mut values, mut c_v, mut s) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..lines.len() {
        let deviation = noise * exact.line(k).norm() / n as f64;
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for v in exact.line_slice(k) {
            values.push(v + C64::new(normal(), normal()) * (deviation / 2f64.sqrt()));
        }
        let eye = |i: usize| f64::from(u8::from(i.is_multiple_of(n + 1)));
        c_v.extend((0..n * n).map(|i| C64::from(eye(i) * deviation * deviation)));
        s.extend((0..n * n).map(|i| C64::from(eye(i))));
    }
    let frf = lpv_core::Frf::new(lines, n, n, values).unwrap();
    (
        FrfEstimate::new(frf, c_v, s, f64::INFINITY, Some(position.into())).unwrap(),
        clock,
    )
}

fn said(estimates: &[FrfEstimate], clock: Discrete, first_mode_hz: f64) -> Vec<String> {
    RigidEvidence::of(estimates, clock, first_mode_hz).map_or_else(Vec::new, |found| found.lines(true, true))
}

#[test]
fn friction_over_three_decades_is_named_with_its_deviation() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let (mut within, mut all) = (0, 0);
    for seed in 0..40 {
        let mass = 10f64.powf(rng.random_range(-2.0..2.0));
        let rate = 10f64.powf(rng.random_range(-1.0..2.0));
        let (noise, hz) = (
            10f64.powf(rng.random_range(-4.0..-2.5)),
            rng.random_range(60.0..300.0),
        );
        let (machine, clock) = estimate(&dmatrix![mass], &dmatrix![mass * rate], (hz, noise), 0.0, seed);
        let body = body(&machine, clock, BELOW_MODES * hz).unwrap();
        let (value, deviation) = (body.friction[(0, 0)], body.friction_deviation[(0, 0)]);
        // The mode bends the lowest lines by a part of a thousand of the inertial force at most.
        let bend = 1e-3 * mass * std::f64::consts::TAU * body.lowest;
        within += usize::from((value - mass * rate).abs() < 3.0 * deviation + bend);
        all += 1;
        let said = said(std::slice::from_ref(&machine), clock, hz);
        if mass * rate > 10.0 * (deviation + bend) {
            assert!(
                said.iter().any(|s| s.contains("viscous friction to ground:")),
                "seed {seed}: {said:?}"
            );
        }
    }
    assert!(within >= all - 1, "{within} of {all}");
}

#[test]
fn a_free_mass_has_no_friction_and_constant_axes_no_coupling() {
    for seed in 0..40 {
        let noise = [1e-5, 1e-4, 1e-3, 1e-2][seed as usize % 4];
        let mass = dmatrix![3.0, 0.0; 0.0, 0.2];
        let zero = DMatrix::zeros(2, 2);
        let places: Vec<FrfEstimate> = [-0.1, 0.0, 0.1]
            .iter()
            .enumerate()
            .map(|(i, p)| estimate(&mass, &zero, (120.0, noise), *p, 3 * seed + i as u64).0)
            .collect();
        let clock = Discrete::from_rate(2000.0).unwrap();
        let said = said(&places, clock, 120.0);
        assert!(said.is_empty(), "seed {seed}: {said:?}");
    }
}

#[test]
fn a_gain_that_changes_along_the_stroke_is_named() {
    let zero = DMatrix::zeros(2, 2);
    let places: Vec<FrfEstimate> = [-0.2, 0.0, 0.2]
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let mass = dmatrix![3.0, 2.0 * p; 2.0 * p, 1.0 + p * p];
            estimate(&mass, &zero, (120.0, 1e-3), *p, i as u64).0
        })
        .collect();
    let clock = Discrete::from_rate(2000.0).unwrap();
    let said = said(&places, clock, 120.0);
    assert!(
        said.len() == 1 && said[0].contains("the axes are coupled"),
        "{said:?}"
    );
}

#[test]
fn axes_whose_masses_change_apart_are_not_called_coupled() {
    let zero = DMatrix::zeros(2, 2);
    let places: Vec<FrfEstimate> = [-0.2, 0.0, 0.2]
        .iter()
        .enumerate()
        .map(|(i, p)| {
            estimate(
                &dmatrix![3.0 + p, 0.0; 0.0, 1.0],
                &zero,
                (120.0, 1e-3),
                *p,
                i as u64,
            )
            .0
        })
        .collect();
    let clock = Discrete::from_rate(2000.0).unwrap();
    let said = said(&places, clock, 120.0);
    assert!(
        said.len() == 1 && said[0].contains("rigid body varies") && !said[0].contains("coupled"),
        "{said:?}"
    );
}

fn stage(estimates: &[FrfEstimate], clock: Discrete) -> crate::PoleStage {
    crate::fit_poles(estimates, clock, &crate::IdentifyConfig::default()).unwrap()
}

/// Friction on both axes, on one, on none, over three decades: integrators and slow poles as the machine has them.
#[test]
fn poles_follow_the_friction() {
    let mass = dmatrix![2.0, 0.0; 0.0, 5.0];
    for (d1, d2) in [
        (0.0, 0.0),
        (0.4, 0.0),
        (4.0, 0.0),
        (40.0, 0.0),
        (4.0, 40.0),
        (40.0, 8.0),
    ] {
        let friction = dmatrix![d1, 0.0; 0.0, d2];
        let places: Vec<FrfEstimate> = (0..3)
            .map(|i| {
                let p = f64::from(i);
                estimate(&mass, &friction, (110.0 + 5.0 * p, 1e-3), p, 40 + i as u64).0
            })
            .collect();
        let clock = Discrete::from_rate(2000.0).unwrap();
        let found = stage(&places, clock);
        let rigid = found.rigid.as_ref().unwrap();
        let seen: Vec<bool> = rigid.friction.iter().map(Option::is_some).collect();
        assert_eq!(seen, [d1 > 0.0, d2 > 0.0], "{d1}, {d2}: {:?}", rigid.friction);
        assert_eq!(found.slow_poles, d1 + d2 > 0.0, "{d1}, {d2}: {:?}", found.reasons);
        // A model without it says so where the machine has some, and nothing where it has none.
        let (modelled, not) = (rigid.lines(true, true), rigid.lines(false, true));
        assert_eq!(modelled.len(), seen.iter().filter(|s| **s).count());
        assert!(modelled.iter().all(|l| !l.contains("warning")), "{modelled:?}");
        assert!(not.iter().all(|l| l.starts_with("warning: ")) && not.len() == modelled.len());
        if d1 + d2 == 0.0 {
            assert_eq!(found.rigid_terms(), crate::RigidTerms::Constant);
        }
        assert!(!rigid.gain_varies());
        let cost = found
            .fits
            .iter()
            .map(|f| f.account.cost / f.account.expected_cost);
        assert!(cost.fold(0.0, f64::max) < 1.5, "{d1}, {d2}: {:?}", found.reasons);
    }
}

/// What is given about the rigid body goes before what the lowest lines show, and contradictions are said.
#[test]
fn a_given_rigid_body_is_taken() {
    let clock = Discrete::from_rate(2000.0).unwrap();
    for (coupling, friction) in [(0.0, 0.0), (0.3, 0.0), (0.0, 4.0)] {
        let places: Vec<FrfEstimate> = (0..4)
            .map(|i| {
                let p = f64::from(i);
                let off = coupling * (1.0 + p);
                let mass = dmatrix![2.0, off; off, 5.0];
                let friction = dmatrix![friction, 0.0; 0.0, friction];
                estimate(&mass, &friction, (110.0 + 5.0 * p, 1e-3), p, 60 + i as u64).0
            })
            .collect();
        let with = |rigid_body, integrators| {
            let config = crate::IdentifyConfig {
                rigid_body,
                integrators,
                ..crate::IdentifyConfig::default()
            };
            crate::fit_poles(&places, clock, &config)
        };
        let decoupled = with(Some(RigidBody::Decoupled), None).unwrap();
        assert_eq!((decoupled.integrators, decoupled.slow_poles), (2, false));
        assert_eq!(decoupled.rigid_terms(), RigidTerms::Constant);
        let lines = decoupled.rigid.as_ref().unwrap().lines(false, false);
        assert_eq!(lines.is_empty(), coupling + friction == 0.0, "{lines:?}");
        assert!(lines.iter().all(|l| l.starts_with("warning: ")), "{lines:?}");
        let coupled = with(Some(RigidBody::Coupled), None).unwrap();
        assert!(matches!(coupled.rigid_terms(), RigidTerms::Varying { .. }));
        let refused = with(Some(RigidBody::Decoupled), Some(1)).unwrap_err();
        assert!(refused.to_string().contains("`integrators`"), "{refused}");
    }
}

/// A speed has no mass in position, and a spring no friction, whatever bends the lowest lines.
#[test]
fn speeds_and_springs_are_no_friction() {
    let clock = Discrete::from_rate(2000.0).unwrap();
    let lines: Vec<f64> = (1..400).map(|k| 2.0 * f64::from(k)).collect();
    let of = |position: f64, numerator: [f64; 2], denominator: [f64; 3]| {
        // (n0 + n1 s) / (d0 + d1 s + d2 s^2) beside a mode that moves.
        let w = std::f64::consts::TAU * (110.0 + position);
        let a = dmatrix![
            0.0, 1.0, 0.0, 0.0;
            -denominator[0] / denominator[2], -denominator[1] / denominator[2], 0.0, 0.0;
            0.0, 0.0, 0.0, 1.0;
            0.0, 0.0, -w * w, -0.03 * w
        ];
        let b = dmatrix![0.0; 1.0 / denominator[2]; 0.0; 0.3];
        let c = dmatrix![numerator[0], numerator[1], 1.0, 0.0];
        let machine = StateSpace::new(a, b, c, dmatrix![0.0], Continuous).unwrap();
        let held = machine.zero_order_hold(clock).unwrap();
        let frf = held.frequency_response(&lines).unwrap();
        let deviation: Vec<C64> = (0..frf.len())
            .map(|k| C64::from((1e-3 * frf.line(k).norm()).powi(2)))
            .collect();
        let one = vec![C64::from(1.0); frf.len()];
        FrfEstimate::new(frf, deviation, one, f64::INFINITY, Some(position.into())).unwrap()
    };
    for (numerator, denominator) in [
        // A speed without and with friction, a spring of 5 Hz without and with.
        ([0.0, 1.0], [0.0, 0.0, 5.0]),
        ([0.0, 1.0], [0.0, 30.0, 5.0]),
        ([1.0, 0.0], [5000.0, 1.0, 5.0]),
        ([1.0, 0.0], [5000.0, 30.0, 5.0]),
    ] {
        let places: Vec<FrfEstimate> = [0.0, 5.0, 10.0].map(|p| of(p, numerator, denominator)).to_vec();
        let found = stage(&places, clock);
        assert!(!found.slow_poles, "{denominator:?}: {:?}", found.reasons);
        assert!(
            found.reasons.iter().all(|r| !r.contains("viscous friction")),
            "{:?}",
            found.reasons
        );
    }
}
