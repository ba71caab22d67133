//! Axes of which a linear start is far from the records, simulated by hand: pushed abruptly in the first samples, which no polynomial follows, on a
//! spring that hardens by as much as it is stiff, and with a drive that clips.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::{Trace, Verdict, observer, servo_axis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::TAU;

const SAMPLES: usize = 2000;
/// Masses and sample rates, each over three decades and more.
const MACHINES: [(f64, f64); 3] = [(1e-3, 100.0), (2.0, 3e3), (1e3, 1e5)];
/// Deviations of white readings over the stroke.
const NOISES: [f64; 2] = [1e-7, 1e-4];

/// Acceleration by position, speed and command over the mass; units of length and samples.
type Motion = fn(f64, f64, f64) -> f64;

/// A command that begins at once in one of the first samples, to rest for a while in the middle.
fn record(number: usize, (mass, rate): (f64, f64), noise: f64, motion: Motion) -> Record {
    /// So many that the rule of the middle errs by less than the finest readings.
    const FINE: usize = 100;
    let mut draw = ChaCha8Rng::seed_from_u64(number as u64);
    let normal = Normal::new(0.0, noise).unwrap();
    let (mut x, mut v) = (0.1, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let turn = TAU * (1.0 + 0.23 * number as f64) / 400.0;
        let t = k.saturating_sub(2 * number) as f64;
        let pushes = (2 * number..2 * number + 6).contains(&k);
        let resting = (900..1000).contains(&k);
        let wave = 0.3 * turn * turn * ((turn * t).cos() + 0.6 * (2.3 * turn * t + number as f64).sin());
        let u = match (pushes, resting) {
            (true, _) => 2e-3,
            (_, true) => 0.0,
            _ => wave,
        };
        outputs.push(x + normal.sample(&mut draw));
        inputs.push(mass * rate * rate * u);
        for _ in 0..FINE {
            common::middle_step(&mut x, &mut v, 1.0 / FINE as f64, |x, v| motion(x, v, u));
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

/// What is found, looked at again from where the model that was found lets the records begin.
fn find((mass, rate): (f64, f64), noise: f64, motion: Motion) -> Result<Trace, Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(rate)?;
    let records: Vec<Record> = (0..4).map(|i| record(i, (mass, rate), noise, motion)).collect();
    let base = servo_axis(&records[..3], clock, &mut Vec::new())?;
    let held = Held::with_judged(base, &records, 1, clock)?;
    let step = noise * 12_f64.sqrt();
    let first = held.look(&held.bare(), step, false)?;
    let second = held.look_again(&first.model, step)?;
    // Without a drift of the sensor that told a wrong beginning, as `lpv diagnose` looks.
    let mut model = second.model.clone();
    model.effects.retain(|(e, _)| e.name != "sensor-drift");
    match model.effects.len() < second.model.effects.len() {
        true => Ok(held.look(&model, step, false)?),
        false => Ok(second),
    }
}

/// The values of the one effect that is to be named, with their deviations.
fn only(found: &Trace, name: &str) -> Vec<(f64, f64)> {
    let [added] = &found.added[..] else {
        panic!(
            "{:?}",
            found.added.iter().map(|a| a.effect.name).collect::<Vec<_>>()
        );
    };
    let left = (found.before.cost, found.after.cost, &added.values);
    assert_eq!(
        (added.effect.name, found.verdict),
        (name, Verdict::Explained),
        "{left:?}"
    );
    added.values.clone()
}

/// Within four deviations, and a thousandth for the integration by hand.
fn is_near((value, deviation): (f64, f64), wanted: f64) -> bool {
    (value - wanted).abs() < 4.0 * deviation + 1e-3 * wanted.abs()
}

#[test]
fn an_abrupt_beginning_has_no_name() -> Result<(), Box<dyn std::error::Error>> {
    for machine in MACHINES {
        for noise in NOISES {
            let found = find(machine, noise, |_, v, u| u - 4e-3 * v)?;
            assert_eq!(found.verdict, Verdict::NothingMissing, "{machine:?} {noise}");
            let mass = found.model.base.parameters()[0].value;
            assert!(is_near((mass, found.deviations[0]), machine.0), "{mass}");
        }
    }
    Ok(())
}

#[test]
fn a_spring_that_hardens_far_from_a_linear_one() -> Result<(), Box<dyn std::error::Error>> {
    const STIFF: f64 = 4e-4;
    const HARD: f64 = 2e-3;
    for machine in MACHINES {
        for noise in NOISES {
            let found = find(machine, noise, |x, v, u| {
                u - 1e-2 * v - STIFF * x - HARD * x * x * x
            })?;
            let values = only(&found, "cubic-stiffness");
            let unit = machine.0 * machine.1 * machine.1;
            assert!(is_near(values[1], HARD * unit), "{values:?} {machine:?} {noise}");
            let stiffness = found.model.base.parameters()[3].value;
            assert!(
                is_near((stiffness, found.deviations[3]), STIFF * unit),
                "{stiffness}"
            );
        }
    }
    Ok(())
}

#[test]
fn a_drive_that_clips() -> Result<(), Box<dyn std::error::Error>> {
    const LIMIT: f64 = 1e-4;
    for machine in MACHINES {
        let found = find(machine, 1e-5, |_, v, u| u.clamp(-LIMIT, LIMIT) - 4e-3 * v)?;
        let values = only(&found, "actuator-saturation");
        let unit = machine.0 * machine.1 * machine.1;
        assert!(is_near(values[0], LIMIT * unit), "{values:?} {machine:?}");
    }
    Ok(())
}
