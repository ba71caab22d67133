//! Axes made by hand and simulated.

use crate::{normal, record};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Discrete, Record, Signals};
use lti_ident::rigid_body::{Estimator, RigidBodySettings, identify};
use lti_ident::{LtiIdentError, Segment};

const T: f64 = 1e-3;

/// Position, velocity and acceleration of a sum of three waves.
fn waves(k: f64) -> [f64; 3] {
    let t = k * T;
    [(0.3, 0.05), (1.1, 0.01), (3.0, 0.002)]
        .iter()
        .fold([0.0; 3], |[q, v, a], &(f, size)| {
            let w = std::f64::consts::TAU * f;
            [
                q + size * (w * t).sin(),
                v + size * w * (w * t).cos(),
                a - size * w * w * (w * t).sin(),
            ]
        })
}

#[test]
fn two_axes_without_noise() {
    let n = 10_000;
    let motion: Vec<[f64; 3]> = (0..n).map(|k| waves(k as f64)).collect();
    // A held force acts as its value in the middle of the sample does.
    let middle: Vec<[f64; 3]> = (0..n).map(|k| waves(k as f64 + 0.5)).collect();
    let q = DMatrix::from_fn(2, n, |i, k| motion[k][0] * if i == 0 { 1.0 } else { -2.0 });
    let truth = [[3.0, 20.0, -1.5], [0.4, 1.0, 0.2]];
    let u = DMatrix::from_fn(2, n, |i, k| {
        let sign = if i == 0 { 1.0 } else { -2.0 };
        truth[i][0] * sign * middle[k][2] + truth[i][1] * sign * middle[k][1] + truth[i][2]
    });
    let record = record(&u, &q);
    let settings = RigidBodySettings::default();
    let fit = identify(&[Segment::whole(&record)], Discrete::new(T).unwrap(), &settings).unwrap();
    for ((axis, account), truth) in fit.model.axes().iter().zip(&fit.axes).zip(truth) {
        assert!(
            (axis.inertia / truth[0] - 1.0).abs() < 1e-3,
            "{axis:?} {account:?}"
        );
        assert!((axis.viscous / truth[1] - 1.0).abs() < 3e-3, "{axis:?}");
        assert!((axis.offset - truth[2]).abs() < 1e-3 * truth[1], "{axis:?}");
        assert!(account.relative_force_error_percent < 0.5 && account.condition_number < 10.0);
    }
}

/// Without it the viscous friction takes what dry friction does.
#[test]
fn dry_friction_is_told_apart() {
    let n = 10_000;
    let motion: Vec<[f64; 3]> = (0..n).map(|k| waves(k as f64)).collect();
    let middle: Vec<[f64; 3]> = (0..n).map(|k| waves(k as f64 + 0.5)).collect();
    let q = DMatrix::from_fn(1, n, |_, k| motion[k][0]);
    let (inertia, viscous, level) = (3.0, 20.0, 40.0);
    let u = DMatrix::from_fn(1, n, |_, k| {
        let [_, v, a] = middle[k];
        inertia * a + viscous * v + level * v.signum()
    });
    let record = record(&u, &q);
    let fit = |is_estimated: bool| {
        let settings = RigidBodySettings {
            dry_friction: is_estimated,
            ..RigidBodySettings::default()
        };
        let fit = identify(&[Segment::whole(&record)], Discrete::new(T).unwrap(), &settings).unwrap();
        fit.model.axes()[0]
    };
    let (without, with) = (fit(false), fit(true));
    assert!(without.viscous > 2.0 * viscous, "{without:?}");
    assert!((with.inertia / inertia - 1.0).abs() < 1e-2, "{with:?}");
    assert!((with.viscous / viscous - 1.0).abs() < 5e-2, "{with:?}");
}

/// `J = 2`, `F_v = 10`, `o = 1` under a stiff PD loop that feeds the noise of the sensor back to the force.
fn servo(seed: u64, disturbance_n: f64) -> Record {
    let (inertia, viscous, offset) = (2.0, 10.0, 1.0);
    let n = 8_000;
    let noise = normal(1, n, seed) * 2e-6;
    let disturbance = normal(1, n, seed + 1) * disturbance_n;
    let (mut q, mut v, mut before) = (0.0, 0.0, 0.0);
    let [mut position, mut force, mut reference] = [(); 3].map(|()| vec![0.0; n]);
    for k in 0..n {
        let [r, r_v, _] = waves(k as f64);
        let measured = q + noise[k];
        let derivative = if k == 0 { 0.0 } else { (measured - before) / T };
        before = measured;
        let u = 5000.0 * (r - measured) + 150.0 * (r_v - derivative);
        (position[k], force[k], reference[k]) = (measured, u, r);
        // Exact for a force that is held.
        let rate = viscous / inertia;
        let drive = (u + disturbance[k] - offset) / viscous;
        let decay = (-rate * T).exp();
        q += drive * T + (v - drive) * (1.0 - decay) / rate;
        v = drive + (v - drive) * decay;
    }
    let row = |v: Vec<f64>| DMatrix::from_row_slice(1, n, &v);
    let mut made = record(&row(force), &row(position));
    made.references = Signals::new(&["r"], vec![reference]);
    made
}

#[test]
fn in_a_noisy_loop_the_bias_is_below_the_stated_deviation() {
    // The noise of the sensor alone, and forces that the motion answers: only instruments stand these.
    for (estimator, disturbance_n) in [(Estimator::LeastSquares, 0.0), (Estimator::Automatic, 2.0)] {
        let settings = RigidBodySettings {
            estimator,
            ..RigidBodySettings::default()
        };
        let runs = 24;
        let (mut errors, mut stated) = ([0.0; 2], [0.0; 2]);
        for seed in 0..runs {
            let record = servo(10 * seed, disturbance_n);
            let fit = identify(&[Segment::whole(&record)], Discrete::new(T).unwrap(), &settings).unwrap();
            let axis = fit.model.axes()[0];
            assert_eq!(
                fit.axes[0].estimator == Estimator::LeastSquares,
                disturbance_n == 0.0
            );
            let found = [axis.inertia - 2.0, axis.viscous - 10.0];
            for (i, deviation) in [axis.inertia_deviation, axis.viscous_deviation]
                .into_iter()
                .enumerate()
            {
                errors[i] += found[i] / runs as f64;
                stated[i] += deviation / runs as f64;
            }
        }
        println!("{estimator:?}: bias {errors:?}, stated {stated:?}");
        for i in 0..2 {
            assert!(
                errors[i].abs() < stated[i],
                "{estimator:?}, parameter {i}: {errors:?} {stated:?}"
            );
        }
        assert!(stated[0] < 0.1 && stated[1] < 1.0, "{stated:?}");
    }
}

#[test]
fn refusals_name_the_facts() {
    let clock = Discrete::new(T).unwrap();
    let settings = RigidBodySettings::default();
    let two = DMatrix::from_fn(2, 2000, |_, k| waves(k as f64)[0]);
    let one = two.rows(0, 1).into_owned();
    let unequal = record(&two, &one);
    assert!(matches!(
        identify(&[Segment::whole(&unequal)], clock, &settings),
        Err(LtiIdentError::Axes { inputs, outputs }) if inputs.len() == 2 && outputs.len() == 1
    ));
    let plain = record(&one, &one);
    let instruments = RigidBodySettings {
        estimator: Estimator::ReferenceInstruments,
        ..RigidBodySettings::default()
    };
    assert!(matches!(
        identify(&[Segment::whole(&plain)], clock, &instruments),
        Err(LtiIdentError::Channels {
            what: "references",
            ..
        })
    ));
    // Force along the position: a spring with a negative inertia.
    assert!(matches!(
        identify(&[Segment::whole(&plain)], clock, &settings),
        Err(LtiIdentError::Inertia { .. })
    ));
    let still = record(&one, &DMatrix::zeros(1, 2000));
    assert!(matches!(
        identify(&[Segment::whole(&still)], clock, &settings),
        Err(LtiIdentError::Singular { .. })
    ));
    let fast = RigidBodySettings {
        position_cutoff_hz: Some(600.0),
        ..RigidBodySettings::default()
    };
    assert!(matches!(
        identify(&[Segment::whole(&plain)], clock, &fast),
        Err(LtiIdentError::Setting {
            name: "position_cutoff_hz",
            ..
        })
    ));
    let short = Segment::new(&plain, 0..5);
    assert!(identify(&[short], clock, &settings).is_err());
    assert!(
        RigidBodySettings {
            regression_cutoff_hz: Some(f64::NAN),
            ..RigidBodySettings::default()
        }
        .check()
        .is_err()
    );
}

/// Mass, friction and force of an axis over three decades, driven by the waves above.
fn axis(k: u32) -> (Record, f64) {
    let n = 10_000;
    let inertia = 10f64.powf(f64::from(k) - 2.0);
    let q = DMatrix::from_fn(1, n, |_, k| waves(k as f64)[0]);
    let e = normal(1, n, u64::from(k) + 3);
    let u = DMatrix::from_fn(1, n, |_, k| {
        let [_, v, a] = waves(k as f64 + 0.5);
        inertia * (a + 4.0 * v + 0.02 * e[k])
    });
    (record(&u, &q), inertia)
}

#[test]
fn what_is_wrong_with_the_channels_is_named() {
    let clock = Discrete::new(T).unwrap();
    let settings = RigidBodySettings::default();
    let of = |r: &Record| identify(&[Segment::whole(r)], clock, &settings);
    for k in 0..5 {
        let (right, inertia) = axis(k);
        let found = of(&right).unwrap().model.axes()[0].inertia;
        assert!((found / inertia - 1.0).abs() < 0.05, "{found}, {inertia}");
        let mut turned = right.clone();
        turned.inputs.columns[0].iter_mut().for_each(|u| *u = -*u);
        assert!(
            matches!(of(&turned), Err(LtiIdentError::OppositeSigns { .. })),
            "{:?}",
            of(&turned)
        );
        // A spring that is stronger than the inertia below its resonance is no other sign.
        let mut sprung = right.clone();
        let q = sprung.outputs.columns[0].clone();
        sprung.inputs.columns[0]
            .iter_mut()
            .zip(&q)
            .for_each(|(u, q)| *u += 4000.0 * inertia * q);
        assert!(
            !matches!(of(&sprung), Err(LtiIdentError::OppositeSigns { .. })),
            "{:?}",
            of(&sprung)
        );
        let mut speed = right.clone();
        speed.outputs.columns[0] = (0..right.len()).map(|k| waves(k as f64)[1]).collect();
        assert!(
            matches!(of(&speed), Err(LtiIdentError::SpeedOutput { .. })),
            "{:?}",
            of(&speed)
        );
        // A reference that is the input is no instrument.
        let mut same = right.clone();
        same.references = same.inputs.clone();
        let fit = of(&same).unwrap();
        assert_ne!(fit.axes[0].estimator, Estimator::ReferenceInstruments);
        assert!((fit.model.axes()[0].inertia / found - 1.0).abs() < 1e-9);
    }
}
