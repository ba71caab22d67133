//! An arm in the field of gravity, simulated by hand with a controller that nobody knows, over a part of a turn or more, in radians and in
//! degrees: gravity is named with its size and its phase; a shaft on a torsion spring has none.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::{Base, Trace, observer, servo_axis};
use std::f64::consts::TAU;

const SAMPLES: usize = 2600;

/// An arm in samples and radians, per unit of inertia.
#[derive(Debug, Clone, Copy)]
struct Arm {
    /// Torque of gravity, its angle at rest, and stiffness of a spring in its place.
    torque: f64,
    rest: f64,
    stiffness: f64,
    /// Angle that it goes to either side.
    travel: f64,
}

fn record(number: usize, (inertia, rate, turn): (f64, f64, f64), arm: Arm, step: f64) -> Record {
    const FINE: usize = 100;
    let h = 1.0 / FINE as f64;
    let angle = TAU / turn;
    let (mut x, mut v, mut read) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    let hold = arm.torque * arm.rest.sin();
    for k in 0..SAMPLES {
        let turn = 1.0 + 0.17 * number as f64;
        let wave = |size: f64, per_sample: f64| size * (turn * per_sample * k as f64).sin();
        let wanted = arm.travel * (wave(0.5, 0.0062) + wave(0.3, 0.0024) - wave(0.4, 0.008));
        let last = std::mem::replace(&mut read, (x / step).round() * step);
        outputs.push(read / angle);
        let u = 3.6e-3 * (wanted - read) - 0.084 * (read - last) + hold;
        // Force over motion in the unit of the output.
        inputs.push(inertia * rate * rate * u / angle);
        for _ in 0..FINE {
            let rate = |x: f64, v: f64| u - arm.torque * (x + arm.rest).sin() - arm.stiffness * x - 2e-3 * v;
            common::middle_step(&mut x, &mut v, h, rate);
        }
    }
    let mut record = common::record(&number.to_string(), vec![outputs], vec![inputs]);
    let unit = if turn == 360.0 { "deg" } else { "rad" };
    record.outputs.units = vec![unit.to_owned()];
    observer::followed(record)
}

fn find(machine: (f64, f64, f64), arm: Arm) -> Result<Trace, Box<dyn std::error::Error>> {
    let step = 1e-6 * arm.travel;
    let clock = Discrete::from_rate(machine.1)?;
    let records: Vec<Record> = (1..=4).map(|i| record(i, machine, arm, step)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let held = Held::with_judged(base, &records, 1, clock)?;
    let told = step * machine.2 / TAU;
    let mut found = held.look(&held.bare(), told, false)?;
    for _ in 0..2 {
        found = held.look_again(&found.model, told)?;
    }
    Ok(found)
}

/// Inertias over six decades, travels from a sixth of a turn to several, torques over two decades.
#[test]
fn an_arm_has_gravity() -> Result<(), Box<dyn std::error::Error>> {
    let arm = |torque: f64, rest: f64, travel: f64| Arm {
        torque,
        rest,
        stiffness: 0.0,
        travel,
    };
    for (machine, arm) in [
        ((2.0, 1000.0, TAU), arm(1e-5, 0.7, 0.9)),
        ((1e-4, 400.0, 360.0), arm(2e-5, 0.0, 2.0)),
        ((50.0, 2000.0, TAU), arm(1e-4, 2.5, 12.0)),
        ((0.3, 500.0, 360.0), arm(1e-6, -1.2, 3.0)),
    ] {
        let found = find(machine, arm)?;
        let named: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        let at = found.added.iter().find(|a| a.effect.name == "gravity");
        let at = at.ok_or_else(|| format!("{arm:?}: {named:?}"))?;
        // -torque sin(x + rest), in the unit of the input.
        let size = machine.0 * machine.1.powi(2) * machine.2 / TAU * arm.torque;
        for ((value, deviation), wanted) in at
            .values
            .iter()
            .zip([-size * arm.rest.cos(), -size * arm.rest.sin()])
        {
            let near = (4.0 * deviation).max(2e-3 * size);
            assert!(
                (value - wanted).abs() <= near,
                "{arm:?}: {value} +- {deviation}, not {wanted}"
            );
        }
        assert!(
            named.iter().all(|n| ["gravity", "quantization"].contains(n)),
            "{arm:?}: {named:?}"
        );
    }
    Ok(())
}

/// A torsion spring is one in whatever unit it is read.
#[test]
fn a_torsion_spring_has_no_gravity() -> Result<(), Box<dyn std::error::Error>> {
    for (machine, travel) in [((2.0, 1000.0, TAU), 0.02), ((1e-4, 400.0, 360.0), 1.5)] {
        let spring = Arm {
            torque: 0.0,
            rest: 0.0,
            stiffness: 2e-4,
            travel,
        };
        let found = find(machine, spring)?;
        let named: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        assert!(named.iter().all(|n| *n == "quantization"), "{travel}: {named:?}");
        assert!(matches!(&found.model.base, Base::Axis(axis) if axis.stiffness().is_some()));
    }
    Ok(())
}
