//! Axes with encoders, drawn over decades and simulated, against the masses and frictions that made them.

use crate::record;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Discrete, Record, Signals};
use lti_ident::rigid_body::{Estimator, RigidBodySettings, identify};
use lti_ident::{LtiIdentError, Segment};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Loop {
    /// Force and position, nothing else.
    Open,
    /// A PD loop whose reference is known.
    Closed,
    /// A PD loop whose reference is not.
    Blind,
}

#[derive(Debug)]
struct Axis {
    clock: Discrete,
    record: Record,
    inertia: f64,
    viscous: f64,
    about: String,
}

/// A wave, a sum of eight or a sweep of amplitude one and frequency `f`.
fn shape(rng: &mut ChaCha8Rng, f: f64, n: usize, t: f64) -> (Vec<f64>, &'static str) {
    let phases: Vec<f64> = (0..8).map(|_| rng.random_range(0.0..TAU)).collect();
    let end = n as f64 * t;
    let (kind, name) = [(0, "sine"), (1, "eight sines"), (2, "sweep")][rng.random_range(0..3)];
    let value = |time: f64| match kind {
        0 => (TAU * f * time + phases[0]).sin(),
        1 => {
            let wave = |j: usize| (TAU * f * time * (j as f64 + 1.0) / 8.0 + phases[j]).sin();
            (0..8).map(wave).sum::<f64>() / 8f64.sqrt()
        }
        _ => (TAU * (0.1 * f * time + 0.45 * f * time * time / end)).sin(),
    };
    ((0..n).map(|k| value(k as f64 * t)).collect(), name)
}

/// Encoders of 1e3 to 1e6 counts a turn, 0.1 to 50 Hz, 20 to 3e4 counts of amplitude, time constants over three
/// decades, masses over five.
fn axis(rng: &mut ChaCha8Rng, kind: Loop) -> Axis {
    let decades = |rng: &mut ChaCha8Rng, from: f64, to: f64| 10f64.powf(rng.random_range(from..to));
    let f = decades(rng, -1.0, 1.7);
    let rate = if f < 1.0 { 200.0 } else { 1000.0f64.max(20.0 * f) };
    let t = 1.0 / rate;
    let n = ((12.0 / f).max(4.0) * rate) as usize;
    let step = TAU / decades(rng, 3.0, 6.0);
    let counts = decades(rng, 1.3, 4.5);
    let inertia = decades(rng, -5.0, 0.0);
    let viscous = inertia * TAU * f * decades(rng, -2.0, 1.0);
    let noise = [0.0, decades(rng, -1.0, 0.5)][rng.random_range(0..2)] * step;
    let (wave, name) = shape(rng, f, n, t);
    let start = rng.random_range(0.0..3.0);
    let force = counts * step * TAU * f * (TAU * f * inertia).hypot(viscous);
    let bandwidth = TAU * (rate / 40.0).min(f * decades(rng, -0.3, 1.0));
    let reference: Vec<f64> = wave
        .iter()
        .map(|w| start + counts * step * (w - wave[0]))
        .collect();
    let decay = (-viscous * t / inertia).exp();
    let (mut q, mut v, mut before, mut speed) = (start, 0.0, None, 0.0);
    let [mut u, mut y] = [vec![0.0; n], vec![0.0; n]];
    for k in 0..n {
        let normal: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
        y[k] = ((q + noise * normal) / step).round() * step;
        speed = 0.8 * speed + 0.2 * (y[k] - before.unwrap_or(y[k])) / t;
        before = Some(y[k]);
        let wanted = (reference[k] - reference[k.saturating_sub(1)]) / t;
        let error = 0.5 * bandwidth * (reference[k] - y[k]) + wanted - speed;
        u[k] = match kind {
            Loop::Open => force * wave[k],
            Loop::Closed | Loop::Blind => inertia * bandwidth * error,
        };
        let drive = u[k] / viscous;
        q += drive * t + (v - drive) * (1.0 - decay) * inertia / viscous;
        v = drive + (v - drive) * decay;
    }
    let row = |v: &[f64]| DMatrix::from_row_slice(1, n, v);
    let mut record = record(&row(&u), &row(&y));
    if kind == Loop::Closed {
        record.references = Signals::new(&["r"], vec![reference]);
    }
    Axis {
        clock: Discrete::new(t).unwrap(),
        record,
        inertia,
        viscous,
        about: format!(
            "{name} of {f:.2} Hz at {rate:.0} Hz, {n} samples, {counts:.0} counts, noise {:.1} counts, F/(J w) {:.2}",
            noise / step,
            viscous / inertia / (TAU * f)
        ),
    }
}

#[test]
fn stated_deviations_cover_the_errors_of_axes_over_decades() {
    for (kind, seed) in [(Loop::Open, 1), (Loop::Closed, 2), (Loop::Blind, 3)] {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let axes = 60;
        let (mut covered, mut refused, mut errors) = ([0; 2], 0, Vec::new());
        for _ in 0..axes {
            let axis = axis(&mut rng, kind);
            let fit = identify(
                &[Segment::whole(&axis.record)],
                axis.clock,
                &RigidBodySettings::default(),
            );
            let Ok(fit) = fit else {
                refused += 1;
                println!("{kind:?}, {}: {}", axis.about, fit.unwrap_err());
                continue;
            };
            let found = fit.model.axes()[0];
            let scores = [
                (found.inertia - axis.inertia) / found.inertia_deviation,
                (found.viscous - axis.viscous) / found.viscous_deviation,
            ];
            for (covered, score) in covered.iter_mut().zip(scores) {
                *covered += usize::from(score.abs() <= 2.0);
            }
            if scores.iter().any(|s| s.abs() > 2.0) {
                println!("{kind:?}, {}: {scores:.1?} deviations", axis.about);
            }
            errors.push((found.inertia / axis.inertia - 1.0).abs());
        }
        errors.sort_by(f64::total_cmp);
        let (median, high) = (errors[errors.len() / 2], errors[errors.len() * 9 / 10]);
        println!("{kind:?}: {covered:?} of {axes}, {refused} refused, errors {median:.1e} and {high:.1e}");
        assert!(refused <= 1, "{kind:?}: {refused}");
        assert!(
            covered.iter().all(|c| 100 * c >= 93 * (axes - refused)),
            "{kind:?}: {covered:?}"
        );
        assert!(median < 2e-3 && high < 2e-2, "{kind:?}: {median} {high}");
    }
}

#[test]
fn twelve_periods_of_a_tenth_of_a_hertz_are_enough() {
    let t = 0.05;
    let (inertia, viscous, w) = (2e-3, 1e-3, TAU * 0.1);
    let q = DMatrix::from_fn(1, 2400, |_, k| (40.0 * (w * k as f64 * t).sin()).round() / 40.0);
    let u = DMatrix::from_fn(1, 2400, |_, k| {
        let (sin, cos) = (w * (k as f64 + 0.5) * t).sin_cos();
        viscous * w * cos - inertia * w * w * sin
    });
    let record = record(&u, &q);
    let fit = identify(
        &[Segment::whole(&record)],
        Discrete::new(t).unwrap(),
        &RigidBodySettings::default(),
    );
    let (fit, estimator) = fit.map(|f| (f.model.axes()[0], f.axes[0].estimator)).unwrap();
    assert_eq!(estimator, Estimator::InputInstruments);
    assert!((fit.inertia / inertia - 1.0).abs() < 0.01, "{fit:?}");
    assert!(
        (fit.inertia - inertia).abs() < 2.0 * fit.inertia_deviation,
        "{fit:?}"
    );
}

#[test]
fn noise_without_motion_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let clock = Discrete::new(1e-3).unwrap();
    let mut refused = 0;
    for _ in 0..10 {
        // What the force moves is far below the noise of the position.
        let u = DMatrix::from_fn(1, 8000, |_, k| (TAU * 1e-3 * k as f64).sin());
        let q = DMatrix::from_fn(1, 8000, |_, _| rng.random_range(-1.0..1.0));
        let record = record(&u, &q);
        match identify(&[Segment::whole(&record)], clock, &RigidBodySettings::default()) {
            Ok(fit) => {
                let axis = fit.model.axes()[0];
                assert!(axis.inertia < 3.0 * axis.inertia_deviation, "{axis:?}");
            }
            Err(LtiIdentError::NotExcited { .. } | LtiIdentError::Inertia { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    println!("{refused} of 10 refused");
}
