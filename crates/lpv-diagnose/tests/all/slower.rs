//! A free axis with a force that depends on its position, simulated by hand. It may be so small that an observer takes it away: a slower one shows it
//! and names it, and on a clean axis it shows nothing.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Base, Slower, Trace, Verdict, servo_axis};
use std::f64::consts::TAU;

const SAMPLES: usize = 2000;
/// Step of the readings over the stroke, which is one.
const STEP: f64 = 1e-5;

/// Force over the mass, by position; units of length and samples.
type Force = fn(f64) -> f64;

/// Everything in samples: what one rate does, every rate does. The command was computed beforehand: nothing answers the force.
fn record(number: usize, (mass, rate): (f64, f64), force: Force) -> Record {
    const FINE: usize = 20;
    let h = 1.0 / FINE as f64;
    let (mut x, mut v) = (0.2, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let turn = TAU * (1.0 + 0.23 * number as f64) / 400.0;
        let u = 0.3 * turn * turn * (turn * k as f64).cos();
        outputs.push((x / STEP).round() * STEP);
        inputs.push(mass * rate * rate * u);
        for _ in 0..FINE {
            common::middle_step(&mut x, &mut v, h, |x, v| u - 4e-3 * v + force(x));
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

/// Three records to fit and one to judge by, held by an observer.
fn held(
    machine: (f64, f64),
    force: Force,
) -> Result<(Held, Observer, Vec<Observer>), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(machine.1)?;
    let records: Vec<Record> = (1..=4).map(|i| record(i, machine, force)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let fast = Observer::new(&base, &records[..3], clock)?;
    let slower = fast.slower(&base, &records[..3], clock);
    Ok((Held::with_judged(base, &records, 1, clock)?, fast, slower))
}

/// What the observer and then the slowest one show.
fn find(machine: (f64, f64), force: Force) -> Result<(Trace, Option<Slower>), Box<dyn std::error::Error>> {
    let (held, fast, slower) = held(machine, force)?;
    let slowest = slower.last().ok_or("no slower one")?;
    assert!(slowest.hz < fast.hz);
    let found = held.look(&held.bare(), STEP, false)?;
    let slower = held.look_slower(slowest, &found, STEP)?;
    Ok((found, slower))
}

/// The effects that are named beside the rounding.
fn named(found: &Trace) -> Vec<(&'static str, Vec<(f64, f64)>)> {
    let added = found.added.iter().filter(|a| a.effect.name != "quantization");
    added.map(|a| (a.effect.name, a.values.clone())).collect()
}

/// Masses over six decades, rates over three.
const MACHINES: [(f64, f64); 3] = [(1e-3, 100.0), (2.0, 3e3), (1e3, 1e5)];

#[test]
fn a_small_spring_is_seen_through_a_slower_observer() -> Result<(), Box<dyn std::error::Error>> {
    const SLOPE: f64 = 2e-8;
    for (mass, rate) in MACHINES {
        let (fast, slower) = find((mass, rate), |x| -SLOPE * x)?;
        assert_eq!(fast.verdict, Verdict::Explained, "{mass}");
        assert_eq!(named(&fast), [], "{mass}");
        let slower = slower.ok_or("the records are lost")?;
        assert!(slower.over_noise > 3.0, "{mass}: {}", slower.over_noise);
        let (found, _) = slower.found.ok_or("no name")?;
        let all = named(&found);
        let [(name, values)] = &all[..] else {
            return Err(format!("{mass}: {all:?}").into());
        };
        assert!(["cable-stiffness", "position-force"].contains(name), "{name}");
        let (slope, deviation) = values[0];
        let wanted = mass * rate * rate * SLOPE;
        assert!(
            (slope - wanted).abs() < 0.2 * wanted + 4.0 * deviation && deviation < 0.3 * wanted,
            "{mass}: {slope} ({deviation}) of {wanted}"
        );
    }
    Ok(())
}

#[test]
fn two_orders_of_cogging_are_one_effect() -> Result<(), Box<dyn std::error::Error>> {
    const SIZE: f64 = 3e-6;
    const PITCH: f64 = 0.11;
    for (mass, rate) in MACHINES {
        let force: Force = |x| SIZE * ((TAU * x / PITCH).sin() + 0.6 * (3.0 * TAU * x / PITCH).cos());
        let (fast, slower) = find((mass, rate), force)?;
        let found = slower.and_then(|s| s.found).map_or(fast, |(found, _)| found);
        let all = named(&found);
        let [("cogging", values)] = &all[..] else {
            return Err(format!("{mass}: {all:?}").into());
        };
        let mut pitches = [values[4].0, values[5].0];
        pitches.sort_by(f64::total_cmp);
        for (pitch, wanted) in pitches.into_iter().zip([PITCH / 3.0, PITCH]) {
            assert!((pitch / wanted - 1.0).abs() < 1e-3, "{mass}: {pitch} of {wanted}");
        }
    }
    Ok(())
}

#[test]
fn a_clean_axis_is_clean_through_a_slower_observer() -> Result<(), Box<dyn std::error::Error>> {
    for (mass, rate) in MACHINES {
        let (fast, slower) = find((mass, rate), |_| 0.0)?;
        assert_eq!(named(&fast), [], "{mass}");
        assert!(matches!(fast.model.base, Base::Axis(_)));
        let slower = slower.ok_or("the records are lost")?;
        assert!(slower.over_noise < 1.1, "{mass}: {}", slower.over_noise);
        assert!(slower.found.is_none(), "{mass}");
    }
    Ok(())
}

/// A bump over a quarter of the stroke, which no cubic tells: the polynomials over the stroke do, and give its height.
#[test]
fn a_force_of_any_shape_is_told_along_the_stroke() -> Result<(), Box<dyn std::error::Error>> {
    const SIZE: f64 = 1e-5;
    let bump: Force = |x| SIZE * (-((x - 0.6) / 0.3).powi(2)).exp();
    for (mass, rate) in MACHINES {
        let (held, ..) = held((mass, rate), bump)?;
        // Where the records begin, a model with the force tells.
        let mut told = held.look(&held.bare(), STEP, false)?.model;
        told.effects.retain(|(e, _)| e.name == "position-force");
        let found = held.look(&told, STEP, false)?;
        let all = named(&found);
        let [("position-force", values)] = &all[..] else {
            return Err(format!("{mass}: {all:?}").into());
        };
        let [(from, _), (to, _), weights @ ..] = &values[..] else {
            return Err(format!("{mass}: no stroke").into());
        };
        assert_eq!(weights.len(), 16, "{mass}");
        // What is taken from the force of the motor, over the force that moves the mass.
        let force = |y: f64| -> f64 {
            let angle = ((2.0 * y - from - to) / (to - from)).clamp(-1.0, 1.0).acos();
            let terms = weights
                .iter()
                .enumerate()
                .map(|(i, (w, _))| w * ((i + 1) as f64 * angle).cos());
            -terms.sum::<f64>() / (mass * rate * rate)
        };
        for x in [0.4, 0.5, 0.6, 0.8, 1.0] {
            let (found, wanted) = (force(x) - force(0.25), bump(x) - bump(0.25));
            assert!(
                (found - wanted).abs() < 0.05 * SIZE,
                "{mass}: {found} of {wanted} at {x}"
            );
        }
    }
    Ok(())
}
