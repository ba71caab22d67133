//! An axis whose controller nobody knows, simulated by hand: dry friction and gravity over less than a turn; and nothing.

use crate::common::{self, Held, middle_step};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Axis, Base, Explained, Trace, Track, Verdict, servo_axis, steady_forces};

const RATE: f64 = 250.0;

/// One record: inertia J, dry friction and gravity in units of the inertia, readings on a grid of this step, about an origin.
fn record(number: usize, inertia: f64, forces: [f64; 2], grid: (f64, f64)) -> Record {
    loaded(number, inertia, (forces, 0.0), grid)
}

/// The same with a constant force.
fn loaded(
    number: usize,
    inertia: f64,
    ([friction, gravity], load): ([f64; 2], f64),
    (step, origin): (f64, f64),
) -> Record {
    const FINE: usize = 40;
    let h = 1.0 / (RATE * FINE as f64);
    let (mut x, mut v, mut read) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..2500 {
        let t = k as f64 / RATE;
        let turn = 1.0 + 0.17 * number as f64;
        let wanted = 0.4 * (1.9 * turn * t).sin() + 0.25 * (0.7 * turn * t).sin();
        let last = std::mem::replace(&mut read, (x / step).round() * step);
        outputs.push(origin + read);
        // Per inertia: a drive of 6 Hz with a force for gravity at its middle.
        let force = 1400.0 * (wanted - read) - 45.0 * (read - last) * RATE;
        inputs.push(inertia * force);
        for _ in 0..FINE {
            let rate = |x: f64, v: f64| {
                let dry = friction * (v / 1e-3).tanh();
                force - 0.6 * v - dry - gravity * (x + 0.5).cos() - load
            };
            // Its error is far below the finest step of the readings.
            middle_step(&mut x, &mut v, h, rate);
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

fn find(
    inertia: f64,
    forces: [f64; 2],
    (step, origin): (f64, f64),
) -> Result<Trace, Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    let records: Vec<Record> = (0..3)
        .map(|i| record(i, inertia, forces, (step, origin)))
        .collect();
    let base = servo_axis(&records[..2], clock, &mut Vec::new())?;
    // Gravity about its middle may look like a spring: here the free axis is what effects join.
    let base = match base {
        Base::Axis(axis) if axis.stiffness().is_some() => Base::Axis(Axis::new(inertia, 0.0, 0.0)),
        other => other,
    };
    let held = Held::new(base, &records, clock)?;
    let first = held.look(&held.bare(), step, false)?;
    Ok(match first.verdict {
        Verdict::NothingMissing => first,
        _ => held.look(&first.model, step, false)?,
    })
}

/// Level of the dry friction that was found.
fn friction(found: &Trace) -> Option<f64> {
    let is = |name: &str| name.ends_with("friction") || name == "hysteresis";
    let one = found.added.iter().find(|a| is(a.effect.name));
    one.map(|a| a.values[0].0)
}

/// Inertias over four decades; the friction and gravity are those of a robot's axis in proportion.
#[test]
fn friction_and_gravity() -> Result<(), Box<dyn std::error::Error>> {
    for inertia in [1e-3, 10.0] {
        let found = find(inertia, [3.0, 8.0], (1e-5, 0.0))?;
        let level = friction(&found).ok_or("no friction")? / inertia;
        assert!((level - 3.0).abs() < 0.15, "{level} {:?}", found.verdict);
        let names: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        assert!(names.contains(&"position-force"), "{names:?}");
        assert!(found.after.closed_loop[0] < 0.2 * found.before.closed_loop[0]);
    }
    Ok(())
}

/// Where a scale begins is the maker's choice: an axis that turns within a part in a thousand of its readings turns.
#[test]
fn the_origin_of_the_readings_changes_no_effect() -> Result<(), Box<dyn std::error::Error>> {
    for origin in [-1e3, 0.0, 30.0, 1e3] {
        let found = find(0.2, [3.0, 0.0], (1e-5, origin))?;
        let level = friction(&found).ok_or(format!("no friction about {origin}"))? / 0.2;
        assert!((level - 3.0).abs() < 0.15, "{origin}: {level}");
    }
    Ok(())
}

/// Encoders over three decades.
#[test]
fn nothing_beside_the_rounding() -> Result<(), Box<dyn std::error::Error>> {
    for step in [1e-6, 1e-5, 1e-4, 1e-3] {
        let found = find(0.2, [0.0; 2], (step, 0.0))?;
        let names: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        assert!(names.iter().all(|n| *n == "quantization"), "{step}: {names:?}");
        assert!(
            found.verdict != Verdict::Unexplained,
            "{step}: {:?} {:?}",
            found.before,
            found.left[1]
        );
    }
    Ok(())
}

/// A load of its own in each record, over four decades of the inertia: its force is told to a hundredth; and where there is one load, or dry
/// friction beside it, nothing is.
#[test]
fn a_load_of_each_record() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    for (inertia, loads, friction) in [
        (1e-3, [2.0, -1.0, 5.0], 0.0),
        (1e1, [0.2, 0.9, -0.4], 0.0),
        (1.0, [2.0, 2.0, 2.0], 0.0),
        (1.0, [2.0, 2.0, 2.0], 1.0),
    ] {
        let records: Vec<Record> = (0..3)
            .map(|i| loaded(i, inertia, ([friction, 0.0], loads[i]), (1e-5, 0.0)))
            .collect();
        let base = Base::Axis(Axis::new(inertia, 0.6 * inertia, 2.0 * inertia));
        let start = Observer::new(&base, &records, clock)?.controller.start()?;
        let model = Explained {
            base,
            effects: Vec::new(),
        };
        let one = |r: &Record| Track::new(r, 1.0 / RATE, 2, Some(&start));
        let tracks: Vec<Track> = records.iter().map(one).collect::<Result<_, _>>()?;
        let tracks = observer::settled(&model, &start, &tracks);
        let found = steady_forces(&model, &start, &tracks.iter().collect::<Vec<_>>());
        if loads[0] == loads[1] {
            assert_eq!(found, None, "{loads:?}, friction {friction}");
            continue;
        }
        for (force, load) in found.ok_or("no load")?.iter().zip(loads) {
            let force = force / inertia;
            assert!((force - load).abs() < 0.05, "{force} of {load}");
        }
    }
    Ok(())
}
