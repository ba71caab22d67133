//! An axis whose friction, force constant or encoder changes with a temperature that was measured, simulated by hand with a controller
//! that nobody knows: the change is named, with its size, and told from one in time; and a temperature that changes nothing is not.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record, Signals};
use lpv_diagnose::{Trace, observer, servo_axis};

const SAMPLES: usize = 3000;

/// What a degree changes; forces per unit of mass, times in samples.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    viscous: f64,
    /// Of dry friction at 25 degrees.
    dry: [f64; 2],
    gain: f64,
    reading: f64,
    force: f64,
}

/// A machine that warms up along each record from where the last one left it, and beside it the draught of the hall.
fn degrees(number: usize, k: f64) -> f64 {
    let warm = -8.0 * (-k / 1200.0).exp_m1();
    25.0 + 4.0 * number as f64 - 8.0 + warm + 0.3 * (9e-4 * k + number as f64).sin()
}

/// Everything in samples: what one rate does, every rate does.
fn record(number: usize, (mass, rate): (f64, f64), change: Change, step: f64) -> Record {
    const FINE: usize = 100;
    let h = 1.0 / FINE as f64;
    let (mut x, mut v, mut read) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs, mut warm) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let turn = 1.0 + 0.17 * number as f64;
        let wave = |size: f64, per_sample: f64| size * (turn * per_sample * k as f64).sin();
        let wanted = wave(0.4, 0.0062) + wave(0.25, 0.0024) - wave(0.3, 0.008);
        let hot = degrees(number, k as f64) - 25.0;
        let tells = x + change.reading * hot;
        let last = std::mem::replace(&mut read, (tells / step).round() * step);
        outputs.push(read);
        warm.push(hot + 25.0);
        let u = 3.6e-3 * (wanted - read) - 0.084 * (read - last) + 1e-6;
        inputs.push(mass * rate * rate * u);
        for part in 0..FINE {
            let hot = degrees(number, k as f64 + part as f64 * h) - 25.0;
            let level = change.dry[0] + change.dry[1] * hot;
            let rate = |_: f64, v: f64| {
                (1.0 + change.gain * hot) * u + change.force * hot
                    - 1e-6
                    - (2e-3 + change.viscous * hot) * v
                    - level * (v / 1e-5).tanh()
            };
            common::middle_step(&mut x, &mut v, h, rate);
        }
    }
    let record = common::record(&number.to_string(), vec![outputs], vec![inputs]);
    observer::followed(Record {
        auxiliary: Signals {
            units: vec!["degC".to_owned()],
            ..Signals::new(&["coil"], vec![warm])
        },
        ..record
    })
}

fn find(machine: (f64, f64), change: Change) -> Result<Trace, Box<dyn std::error::Error>> {
    const STEP: f64 = 1e-6;
    let clock = Discrete::from_rate(machine.1)?;
    let records: Vec<Record> = (0..4).map(|i| record(i, machine, change, STEP)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let held = Held::with_judged(base, &records, 1, clock)?;
    let mut found = held.look(&held.bare(), STEP, false)?;
    for _ in 0..2 {
        found = held.look_again(&found.model, STEP)?;
    }
    Ok(found)
}

/// Masses over six decades, rates over two, changes over two.
#[test]
fn what_a_temperature_changes_is_named() -> Result<(), Box<dyn std::error::Error>> {
    let one = Change::default();
    /// What changes, mass and rate, and the size to be found.
    type Case = (&'static str, (f64, f64), Change, f64);
    let all: [Case; 6] = [
        (
            "force_per_degree",
            (0.4, 700.0),
            Change { force: 3e-7, ..one },
            0.4 * 700.0 * 700.0 * 3e-7,
        ),
        (
            "viscous_per_degree",
            (5.0, 1000.0),
            Change {
                viscous: -6e-5,
                ..one
            },
            5.0 * 1000.0 * -6e-5,
        ),
        (
            "viscous_per_degree",
            (1e-3, 300.0),
            Change { viscous: 1e-6, ..one },
            1e-3 * 300.0 * 1e-6,
        ),
        (
            "level_per_degree",
            (0.02, 2000.0),
            Change {
                dry: [4e-6, -1.2e-7],
                ..one
            },
            0.02 * 4e6 * -1.2e-7,
        ),
        (
            "gain_per_degree",
            (900.0, 8000.0),
            Change { gain: -2e-3, ..one },
            -2e-3,
        ),
        (
            "reading_per_degree",
            (60.0, 400.0),
            Change { reading: 2e-3, ..one },
            2e-3,
        ),
    ];
    for (name, machine, change, wanted) in all {
        let found = find(machine, change)?;
        let named: Vec<_> = found.added.iter().map(|a| (a.effect.name, &a.values)).collect();
        let at = found.added.iter().find_map(|a| {
            let at = a.effect.parameters.iter().position(|p| p.name == name)?;
            Some(a.values[at])
        });
        let (value, deviation) = at.ok_or_else(|| format!("{name}: {named:?}"))?;
        let near = (4.0 * deviation).max(0.02 * wanted.abs());
        assert!(
            (value - wanted).abs() <= near,
            "{name}: {value} +- {deviation}, not {wanted}"
        );
        let others = named
            .iter()
            .filter(|(n, _)| !["temperature", "quantization"].contains(n));
        assert_eq!(others.count(), 0, "{name}: {named:?}");
    }
    Ok(())
}

/// A hall that warms up changes nothing of an axis with dry friction.
#[test]
fn a_temperature_beside_an_axis_changes_nothing() -> Result<(), Box<dyn std::error::Error>> {
    let dry = Change {
        dry: [4e-6, 0.0],
        ..Change::default()
    };
    for change in [Change::default(), dry] {
        let found = find((5.0, 1000.0), change)?;
        let named: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
        assert!(!named.contains(&"temperature"), "{named:?}");
    }
    Ok(())
}
