//! Records in motion, and a lag by hand.

use super::late::{Lag, delayed};
use super::{Pair, Run, side_by_side};
use crate::{Axis, Base, Explained, Track};
use lpv_core::{Controller, Purpose, Record, RecordKind, Signals};
use proptest::prelude::*;

/// A move with these outputs, inputs and references.
fn record(signals: [Vec<f64>; 3]) -> Record {
    let [outputs, inputs, references] = signals.map(|s| Signals::new(&["a"], vec![s]));
    Record {
        outputs,
        inputs,
        references,
        ..Record::empty("move", RecordKind::Transient, Purpose::Estimation)
    }
}

/// Records of several lengths, with machines of several kinds, one of which leaves all bounds: side by side each does what it does alone.
#[test]
fn side_by_side_as_alone() -> Result<(), Box<dyn std::error::Error>> {
    let controller = Controller {
        reference_numerator: vec![vec![1.2e3]],
        feedback_numerator: vec![vec![5.2e3, 0.0, -4.0e3]],
        denominator: vec![vec![1.0]],
        limit: None,
    }
    .start()?;
    let track = |samples: u32, rate: f64| -> Result<Track, crate::TraceError> {
        let r: Vec<f64> = (0..samples).map(|k| (rate * f64::from(k)).sin()).collect();
        let [y, u, r] = [r.clone(), r.iter().map(|r| 3.0 * r).collect(), r];
        Track::new(&record([y, u, r]), 1e-3, 3, None)
    };
    let tracks = [track(300, 0.01)?, track(170, 0.1)?.running_on(), track(41, 0.03)?];
    let effect = |name: &str| crate::catalogue::all().find(|e| e.name == name);
    let friction = effect("coulomb-friction").ok_or("no friction")?;
    let delay = effect("delay").ok_or("no delay")?;
    let model = |mass: f64, effects| Explained {
        base: Base::Axis(Axis::new(mass, 2.0, -0.3)),
        effects,
    };
    let models = [
        model(0.8, Vec::new()),
        model(-0.01, Vec::new()),
        model(2.0, vec![(friction, vec![0.4, 1e-3])]),
        model(0.8, vec![(friction, vec![0.1, 1e-2]), (delay, vec![0.7e-3])]),
    ];
    let blocks: Vec<_> = models.iter().map(Explained::blocks).collect();
    let mut runs = Vec::new();
    for (model, blocks) in models.iter().zip(&blocks) {
        for track in &tracks {
            runs.push(Run::new(&model.base, blocks, track).in_loop(&controller));
            runs.push(
                Run::new(&model.base, blocks, track)
                    .in_loop(&controller)
                    .in_parts(1),
            );
        }
    }
    let alone: Vec<_> = runs.iter().map(Run::response).collect();
    assert!(alone.iter().any(Option::is_none) && alone.iter().any(Option::is_some));
    for parts in [0, 1] {
        for lanes in [2, 3, 12] {
            let (runs, alone): (Vec<_>, Vec<_>) = runs
                .iter()
                .zip(&alone)
                .skip(parts)
                .step_by(2)
                .map(|(r, a)| (r, a.clone()))
                .unzip();
            let found = runs.chunks(lanes).flat_map(side_by_side).collect::<Vec<_>>();
            assert_eq!(found, alone, "{lanes} lanes");
        }
    }
    let mixed: Vec<&Run<'_>> = runs.iter().collect();
    assert_eq!(side_by_side(&mixed), alone);
    Ok(())
}

/// An axis with dry friction driven by these forces, held over samples; its positions where a sample is simulated in `parts`.
fn rubbing(
    (mass, level, creep): (f64, f64, f64),
    u: &[f64],
    (step, parts): (f64, usize),
) -> Result<(Track, Vec<f64>), TestCaseError> {
    let fail = |what: &str| TestCaseError::fail(what.to_owned());
    let friction = crate::catalogue::all().find(|e| e.name == "coulomb-friction");
    let friction = friction.ok_or_else(|| fail("no friction"))?;
    let record = record([vec![0.0; u.len()], u.to_vec(), vec![0.0; u.len()]]);
    let track = Track::new(&record, step, parts, None).map_err(|e| fail(&e.to_string()))?;
    let model = Explained {
        base: Base::Axis(Axis::new(mass, 0.0, 0.0)),
        effects: vec![(friction, vec![level, creep])],
    };
    let blocks = model.blocks();
    let found = Run::new(&model.base, &blocks, &track).response();
    let found = found.ok_or_else(|| fail("diverges"))?;
    Ok((track, found.outputs.iter().map(|y| y[0]).collect()))
}

/// A number between powers of ten.
fn decades(least: f64, most: f64) -> impl Strategy<Value = f64> {
    (least..most).prop_map(|e| 10.0_f64.powf(e))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// An axis that starts, stops, stays and turns under dry friction, in two parts of a sample: as the classical rule has it in parts in which the speed at
    /// rest dies out by a tenth.
    #[test]
    fn friction_that_creeps_in_few_parts(
        (mass, level) in (decades(-1.5, 1.5), decades(-1.5, 1.5)),
        creeps in decades(-2.0, 1.0),
        drive in decades(0.05, 1.5),
        pace in decades(-2.0, 0.0),
    ) {
        const STEP: f64 = 5e-4;
        let u: Vec<f64> = (0..100).map(|k| drive * level * (pace * f64::from(k)).sin()).collect();
        // In units of what friction does in a part.
        let (speed, way) = (level / mass * STEP / 2.0, level / mass * (STEP / 2.0).powi(2));
        let creep = creeps * speed;
        let (track, found) = rubbing((mass, level, creep), &u, (STEP, 2))?;
        let acceleration = |v: f64, u: f64| (u - level * (v / creep).tanh()) / mass;
        let parts = (20.0 * drive / creeps).ceil().max(100.0);
        let h = STEP / parts;
        let (mut y, mut v, mut worst) = (track.start.position[0], track.start.speed[0], 0.0_f64);
        for (told, u) in found.iter().zip(u) {
            worst = worst.max((told - y).abs());
            for _ in 0..parts as usize {
                let a = acceleration(v, u);
                let b = acceleration(v + h / 2.0 * a, u);
                let c = acceleration(v + h / 2.0 * b, u);
                let d = acceleration(v + h * c, u);
                y += h * v + h * h / 6.0 * (a + b + c);
                v += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
        }
        prop_assert!(worst < 0.1 * way, "{} of the way", worst / way);
    }

    /// One that hardly creeps, under forces that jump: between its stops and starts it is accelerated evenly, which is a sum.
    #[test]
    fn friction_that_sticks_in_few_parts(
        (mass, level) in (decades(-1.5, 1.5), decades(-1.5, 1.5)),
        creeps in decades(-12.0, -5.0),
        drives in proptest::collection::vec((decades(-2.0, 2.0), proptest::bool::ANY), 100),
    ) {
        const STEP: f64 = 5e-4;
        let u: Vec<f64> = drives.iter().map(|(u, back)| level * if *back { -u } else { *u }).collect();
        let (speed, way) = (level / mass * STEP / 2.0, level / mass * (STEP / 2.0).powi(2));
        let (track, found) = rubbing((mass, level, creeps * speed), &u, (STEP, 2))?;
        let (mut y, mut v, mut worst) = (track.start.position[0], track.start.speed[0], 0.0_f64);
        for (told, u) in found.iter().zip(u) {
            worst = worst.max((told - y).abs());
            let mut left = STEP;
            while left > 0.0 {
                let friction = if v == 0.0 { u.clamp(-level, level) } else { level * v.signum() };
                let a = (u - friction) / mass;
                let stops = if v * a < 0.0 { -v / a } else { f64::INFINITY };
                let time = left.min(stops);
                y += time * (v + 0.5 * time * a);
                v = if stops <= left { 0.0 } else { v + time * a };
                left -= time;
            }
        }
        prop_assert!(worst < 0.1 * way, "{} of the way", worst / way);
    }
}

/// The second part of a record, which begins in motion, is the second part of its simulation.
#[test]
fn a_record_that_begins_in_motion() -> Result<(), Box<dyn std::error::Error>> {
    let step = 1e-3;
    let model = Explained {
        base: Base::Axis(Axis::new(80.0, 200.0, -3.0)),
        effects: Vec::new(),
    };
    let controller = Controller {
        reference_numerator: vec![vec![1.2e6]],
        feedback_numerator: vec![vec![5.2e6, 0.0, -4.0e6]],
        denominator: vec![vec![1.0]],
        limit: None,
    }
    .start()?;
    let r: Vec<f64> = (0..900)
        .map(|k| 0.1 * (1.0 - (4e-3 * f64::from(k)).cos()))
        .collect();
    let still = record([r.clone(), vec![0.0; 900], r.clone()]);
    let track = Track::new(&still, step, 2, None)?;
    let whole = model.closed_loop(&controller, &track).ok_or("diverges")?;
    let first = |v: &[Pair]| -> Vec<f64> { v[300..].iter().map(|v| v[0]).collect() };
    let cut = record([first(&whole.outputs), first(&whole.inputs), r[300..].to_vec()]);
    let error = |known: bool| -> Result<f64, Box<dyn std::error::Error>> {
        let track = Track::new(&cut, step, 2, known.then_some(&controller))?;
        let part = model.closed_loop(&controller, &track).ok_or("diverges")?;
        let pairs = whole.outputs[300..].iter().zip(&part.outputs);
        Ok(pairs.fold(0.0_f64, |m, (a, b)| m.max((a[0] - b[0]).abs())))
    };
    let (from_rest, in_motion) = (error(false)?, error(true)?);
    assert!(from_rest > 1e-3 && in_motion < 1e-6, "{from_rest} {in_motion}");
    Ok(())
}

/// A lag of 0.3 behind a ramp from 2 with slope 5: `2 + 5 (t - 0.3) + (0.3 * 5 - 1) exp(-t / 0.3)` from 1.
#[test]
fn a_lag_behind_a_ramp() -> Result<(), Box<dyn std::error::Error>> {
    let exact = |t: f64| 2.0 + 5.0 * (t - 0.3) + 0.5 * (-t / 0.3_f64).exp();
    let lag = Lag::new(0.3, 0.4).ok_or("no lag")?;
    let mut state = 1.0;
    let slope = lag.follow(&mut state, [0.0, 0.2, 0.4].map(|t| 2.0 + 5.0 * t));
    assert!((state - exact(0.4)).abs() < 1e-12, "{state}");
    let (n, mut mean, mut moment) = (4000, 0.0, 0.0);
    for k in 0..n {
        let s = (f64::from(k) + 0.5) / f64::from(n);
        mean += exact(0.4 * s) / f64::from(n);
        moment += exact(0.4 * s) * (s - 0.5) / f64::from(n);
    }
    assert!((slope.mean - mean).abs() < 1e-7, "{} {mean}", slope.mean);
    assert!((slope.moment - moment).abs() < 1e-7, "{} {moment}", slope.moment);
    Ok(())
}

/// A command of 1, then 3, then 7, late by 0.25 samples: over the first half of sample 2 it changes after a quarter, in the middle
/// of the part.
#[test]
fn a_command_that_comes_late() {
    let sent = |k: Option<usize>| k.map_or(0.0, |k| [1.0, 3.0, 7.0][k]);
    let slope = delayed(sent, 2, [1.75, 2.25]);
    assert!((slope.mean - 5.0).abs() < 1e-12, "{}", slope.mean);
    // 4 (1 - s) s / 2 at s = 1/2.
    assert!((slope.moment - 0.5).abs() < 1e-12, "{}", slope.moment);
    let first = delayed(sent, 0, [-0.25, 0.25]);
    assert!((first.mean - 0.5).abs() < 1e-12, "{}", first.mean);
}
