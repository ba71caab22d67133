//! What wears, has play or another scale, simulated by hand with a controller that nobody knows: it is named, with its size, whatever
//! the mass and the rate are.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::{Trace, observer, servo_axis};
use std::error::Error;

const SAMPLES: usize = 2600;

/// What is hidden, per unit of mass; times in samples.
#[derive(Debug, Clone, Copy, Default)]
struct Hidden {
    /// Dry friction.
    level: f64,
    /// Play between motor and encoder.
    gap: f64,
    /// Part by which the drive gives more in one record, and the number of that.
    gain: (f64, usize),
    /// Spring to ground, what it changes by along a record, and the time constant.
    spring: (f64, f64, f64),
}

/// Everything in samples: what one rate does, every rate does.
fn record(number: usize, (mass, rate): (f64, f64), hidden: Hidden, step: f64) -> Record {
    const FINE: usize = 150;
    let h = 1.0 / FINE as f64;
    let (mut x, mut v, mut read, mut played) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let turn = 1.0 + 0.17 * number as f64;
        let wave = |size: f64, per_sample: f64| size * (turn * per_sample * k as f64).sin();
        let wanted = wave(0.4, 0.0062) + wave(0.25, 0.0024) - wave(0.3, 0.008);
        played = played.clamp(x - 0.5 * hidden.gap, x + 0.5 * hidden.gap);
        let last = std::mem::replace(&mut read, (played / step).round() * step);
        outputs.push(read);
        let u = 3.6e-3 * (wanted - read) - 0.084 * (read - last) + 1e-6;
        inputs.push(mass * rate * rate * u);
        let driven = if number == hidden.gain.1 {
            1.0 + hidden.gain.0
        } else {
            1.0
        } * u;
        for part in 0..FINE {
            let t = (k * FINE + part) as f64 * h;
            let grown = |(change, time): (f64, f64)| {
                if time > 0.0 {
                    change * (1.0 - (-t / time).exp())
                } else {
                    0.0
                }
            };
            let stiffness = hidden.spring.0 + grown((hidden.spring.1, hidden.spring.2));
            let other = |x: f64, v: f64| -1e-6 - 2e-3 * v - stiffness * x;
            // Friction takes the speed away and no more: the motor rests where it would turn.
            let free = v + h * (driven + other(x, v));
            let s = if v == 0.0 { free.signum() } else { v.signum() };
            let dry = hidden.level;
            let next = free - h * s * dry;
            let is_turned = dry > 0.0 && next * s <= 0.0;
            let next = if is_turned { 0.0 } else { next };
            x += 0.5 * h * (v + next);
            v = next;
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

fn find(machine: (f64, f64), hidden: Hidden, step: f64) -> Result<Trace, Box<dyn Error>> {
    let clock = Discrete::from_rate(machine.1)?;
    let records: Vec<Record> = (1..=4).map(|i| record(i, machine, hidden, step)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let held = Held::with_judged(base, &records, 1, clock)?;
    Ok(held.look(&held.bare(), step, false)?)
}

/// The one effect that is named beside the rounding, and the value of a parameter with its deviation.
fn only(found: &Trace, parameter: &str) -> Option<(&'static str, (f64, f64))> {
    let mut all = found.added.iter().filter(|a| a.effect.name != "quantization");
    let first = all.next().filter(|_| all.next().is_none())?;
    let place = first.effect.parameters.iter().position(|p| p.name == parameter)?;
    Some((first.effect.name, first.values[place]))
}

/// Masses over six decades, rates over two.
#[test]
fn what_wears_is_named() -> Result<(), Box<dyn Error>> {
    let none = Hidden::default();
    let force = |(mass, rate): (f64, f64), f: f64| mass * rate * rate * f;
    type Case = (&'static str, &'static str, (f64, f64), Hidden, fn(f64) -> f64);
    let all: [Case; 3] = [
        (
            "backlash",
            "gap",
            (0.02, 2000.0),
            Hidden { gap: 2e-3, ..none },
            |_| 2e-3,
        ),
        (
            "input-gain",
            "gain",
            (5.0, 1000.0),
            Hidden {
                gain: (-0.05, 2),
                ..none
            },
            |_| -0.05,
        ),
        (
            "stiffness-drift",
            "change",
            (2.0, 500.0),
            Hidden {
                spring: (1e-3, -2e-4, 800.0),
                ..none
            },
            |unit| -2e-4 * unit,
        ),
    ];
    for (name, parameter, machine, hidden, wanted) in all {
        let found = find(machine, hidden, 1e-5)?;
        let named = || {
            found
                .added
                .iter()
                .map(|a| (a.effect.name, &a.values))
                .collect::<Vec<_>>()
        };
        let (said, (value, deviation)) = only(&found, parameter).ok_or(format!("{name}: {:?}", named()))?;
        let wanted = wanted(force(machine, 1.0));
        let near = (4.0 * deviation).max(0.05 * wanted.abs());
        assert_eq!(said, name, "{:?}", named());
        assert!(
            (value - wanted).abs() <= near,
            "{name}: {value} +- {deviation}, not {wanted}"
        );
    }
    Ok(())
}

/// Dry friction that stays the same is told as that.
#[test]
fn what_stays_is_dry_friction() -> Result<(), Box<dyn Error>> {
    for machine in [(1e-3, 300.0), (900.0, 8000.0)] {
        let hidden = Hidden {
            level: 4e-6,
            ..Hidden::default()
        };
        let found = find(machine, hidden, 1e-5)?;
        let (said, (level, _)) = only(&found, "level").ok_or(format!("{:?}", found.added))?;
        let wanted = machine.0 * machine.1 * machine.1 * 4e-6;
        assert_eq!(
            said,
            "coulomb-friction",
            "{:?}",
            found.added.iter().map(|a| &a.values).collect::<Vec<_>>()
        );
        assert!((level / wanted - 1.0).abs() < 0.02, "{level} {wanted}");
    }
    Ok(())
}
