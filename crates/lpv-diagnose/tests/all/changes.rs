//! An axis whose mass or force changes, in one record or in the middle of each, simulated by hand with a controller that nobody knows:
//! the change is named, with its size and its time, whatever the mass and the rate are; and a steady axis has none.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::{Trace, observer, servo_axis};

const SAMPLES: usize = 2200;

/// What changes, per unit of mass; times in samples.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    /// Mass that the record of this number has more.
    payload: Option<(usize, f64)>,
    /// Mass from a sample on, in all records.
    jump: Option<(f64, f64)>,
    /// Force from a sample on: in all records, or in the one of a number.
    force: Option<(f64, f64, usize)>,
    /// Force over the square of the speed.
    quadratic: f64,
    /// Dry friction in which the axis sticks: at the start, its change, and the time constant of that.
    dry: Option<[f64; 3]>,
}

/// Everything in samples: what one rate does, every rate does.
fn record(number: usize, (mass, rate): (f64, f64), change: Change, step: f64) -> Record {
    const FINE: usize = 40;
    let h = 1.0 / FINE as f64;
    let payload = change
        .payload
        .filter(|(of, _)| *of == number)
        .map_or(0.0, |p| p.1);
    let begun = |since: Option<(f64, f64)>, t: f64| {
        since.map_or(0.0, |(from, size)| if t >= from { size } else { 0.0 })
    };
    let force = change
        .force
        .filter(|(_, _, of)| [0, number].contains(of))
        .map(|(from, size, _)| (from, size));
    let (mut x, mut v, mut read) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let turn = 1.0 + 0.17 * number as f64;
        let wave = |size: f64, per_sample: f64| size * (turn * per_sample * k as f64).sin();
        let wanted = wave(0.4, 0.0062) + wave(0.25, 0.0024) - wave(0.3, 0.008);
        let last = std::mem::replace(&mut read, (x / step).round() * step);
        outputs.push(read);
        let u = 3.6e-3 * (wanted - read) - 0.084 * (read - last) + 1e-6;
        inputs.push(mass * rate * rate * u);
        for part in 0..FINE {
            let t = (k * FINE + part) as f64 * h;
            let body = 1.0 + payload + begun(change.jump, t);
            let dry = change.dry.map_or(0.0, |[level, more, time]| {
                level + more * (1.0 - (-t / time).exp())
            });
            let driven = |v: f64| u - 1e-6 - 2e-3 * v + begun(force, t) - change.quadratic * v * v.abs();
            if v == 0.0 && driven(v).abs() <= dry {
                continue;
            }
            let way = if v == 0.0 { driven(v).signum() } else { v.signum() };
            let rate = |_: f64, v: f64| (driven(v) - dry * way) / body;
            common::middle_step(&mut x, &mut v, h, rate);
            if dry > 0.0 && v * way < 0.0 {
                v = 0.0;
            }
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

fn find(machine: (f64, f64), change: Change, step: f64) -> Result<Trace, Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(machine.1)?;
    let records: Vec<Record> = (1..=4).map(|i| record(i, machine, change, step)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let held = Held::with_judged(base, &records, 1, clock)?;
    let mut found = held.look(&held.bare(), step, false)?;
    // A beginning that a steady axis told is wrong by what dies out, as a drift of the sensor does.
    for _ in 0..2 {
        let mut model = found.model;
        model.effects.retain(|(e, _)| e.name != "sensor-drift");
        found = held.look(&model, step, false)?;
    }
    Ok(found)
}

/// The one effect that is named beside the rounding, and its values with their deviations.
fn only(found: &Trace) -> Option<(&'static str, Vec<(f64, f64)>)> {
    let mut all = found.added.iter().filter(|a| a.effect.name != "quantization");
    let first = all.next()?;
    all.next()
        .is_none()
        .then(|| (first.effect.name, first.values.clone()))
}

/// Dry friction that grows or falls along a record, of an axis that sticks at each reversal, which no smooth friction tells down to the noise.
#[test]
fn friction_that_changes_in_time() -> Result<(), Box<dyn std::error::Error>> {
    for ((mass, rate), [level, more, time]) in [
        ((2e-3, 4000.0), [3e-6, 3e-6, 500.0]),
        ((60.0, 250.0), [6e-6, -4e-6, 900.0]),
    ] {
        let change = Change {
            dry: Some([level, more, time]),
            ..Change::default()
        };
        let found = find((mass, rate), change, 1e-6)?;
        let own = found.added.iter().find(|a| a.effect.name == "friction-drift");
        let own = own.ok_or_else(|| format!("{mass}: {:?}", only(&found)))?;
        let force = mass * rate * rate;
        for (i, wanted) in [(0, level * force), (1, more * force), (3, time / rate)] {
            let (value, _) = own.values[i];
            assert!((value / wanted - 1.0).abs() < 0.05, "{value}, not {wanted}");
        }
    }
    Ok(())
}

/// Masses over six decades, rates over two; each machine with its change, and what is to be named with which values.
#[test]
fn changes_are_named() -> Result<(), Box<dyn std::error::Error>> {
    let one = Change::default();
    // Units of force over those of one unit of mass and one sample.
    /// Name; mass and rate; what changes; the values to be found.
    type Case = (&'static str, (f64, f64), Change, [Option<f64>; 3]);
    let all: [Case; 6] = [
        (
            "payload",
            (1e-3, 300.0),
            Change {
                payload: Some((2, 0.01)),
                ..one
            },
            [Some(1e-5), Some(2.0), None],
        ),
        (
            "payload",
            (900.0, 8000.0),
            Change {
                payload: Some((3, -0.2)),
                ..one
            },
            [Some(-180.0), Some(3.0), None],
        ),
        (
            "mass-jump",
            (5.0, 1000.0),
            Change {
                jump: Some((1300.0, 0.05)),
                ..one
            },
            [Some(0.25), Some(1.3), Some(0.0)],
        ),
        (
            "constant-force",
            (0.02, 2000.0),
            Change {
                force: Some((900.0, 1e-7, 0)),
                ..one
            },
            [Some(0.02 * 4e6 * 1e-7), Some(0.45), Some(0.0)],
        ),
        (
            "constant-force",
            (60.0, 400.0),
            Change {
                force: Some((1500.0, -3e-6, 1)),
                ..one
            },
            [Some(-60.0 * 16e4 * 3e-6), Some(3.75), Some(1.0)],
        ),
        (
            "quadratic-friction",
            (2.0, 500.0),
            Change {
                quadratic: 0.05,
                ..one
            },
            [Some(0.1), None, None],
        ),
    ];
    for (name, machine, change, wanted) in all {
        let found = find(machine, change, 1e-5)?;
        let (named, values) = only(&found).ok_or(format!("{name}: {:?}", found.added))?;
        assert_eq!(named, name, "{change:?}");
        for ((value, deviation), wanted) in values.into_iter().zip(wanted) {
            let wanted = wanted.unwrap_or(value);
            let near = (4.0 * deviation).max(0.02 * wanted.abs());
            assert!(
                (value - wanted).abs() <= near,
                "{name}: {value} +- {deviation}, not {wanted}"
            );
        }
    }
    Ok(())
}

/// Nothing changes, and nothing is named.
#[test]
fn a_steady_axis_changes_nothing() -> Result<(), Box<dyn std::error::Error>> {
    for machine in [(1e-3, 300.0), (5.0, 1000.0), (900.0, 8000.0)] {
        let found = find(machine, Change::default(), 1e-5)?;
        let named: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        assert!(named.iter().all(|n| *n == "quantization"), "{named:?}");
    }
    Ok(())
}
