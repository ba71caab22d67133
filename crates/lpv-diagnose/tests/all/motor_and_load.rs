//! A motor with a load on a spring, simulated by hand, whose controller nobody knows: the load is the base and no effect; dry friction
//! beside it is found; and where the load is rigid none is.

use crate::common::{self, Held};
use lpv_diagnose::lpv_core::{Discrete, Record};
use lpv_diagnose::observer;
use lpv_diagnose::{Base, Load, Trace, servo_axis};

const RATE: f64 = 500.0;

/// What is simulated, per unit of mass.
#[derive(Clone, Copy)]
struct Machine {
    mass: f64,
    /// Part of the load, natural frequency in Hz, damping ratio; none for a rigid axis.
    load: Option<[f64; 3]>,
    on_load: bool,
    friction: f64,
    /// Viscous friction of the load, per unit of mass.
    load_viscous: f64,
    /// Play between motor and load, and by how much their spring hardens over the square of its deflection.
    gap: f64,
    cubic: f64,
    step: f64,
}

fn record(number: usize, machine: Machine) -> Record {
    const FINE: usize = 100;
    let h = 1.0 / (RATE * FINE as f64);
    let [part, hz, ratio] = machine.load.unwrap_or([0.5, 0.0, 0.0]);
    let w = std::f64::consts::TAU * hz;
    let reduced = part * (1.0 - part);
    let mut x = [0.0_f64; 4];
    let mut read = 0.0_f64;
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..2500 {
        let t = k as f64 / RATE;
        let turn = 1.0 + 0.17 * number as f64;
        let wanted =
            0.4 * (3.1 * turn * t).sin() + 0.25 * (1.2 * turn * t).sin() - 0.3 * (4.0 * turn * t).sin();
        let seen = x[usize::from(machine.on_load)];
        let last = std::mem::replace(&mut read, (seen / machine.step).round() * machine.step);
        outputs.push(read);
        let force = 900.0 * (wanted - read) - 42.0 * (read - last) * RATE + 0.3;
        inputs.push(machine.mass * force);
        // Rates of motor and load: speeds, then accelerations.
        let rates = |[q, load, v, load_speed]: [f64; 4]| {
            let dry = machine.friction * (v / 1e-3).tanh();
            let own = force - 0.3 - 0.8 * v - dry;
            let [a, load_a] = match machine.load {
                None => [own; 2],
                Some(_) => {
                    let bent = q - load;
                    let loose = bent.signum() * bent.abs().min(0.5 * machine.gap);
                    let pull = reduced
                        * (w * w * (bent - loose) * (1.0 + machine.cubic * bent * bent)
                            + 2.0 * ratio * w * (v - load_speed));
                    let pull = match machine.gap > 0.0 && pull * (bent - loose) <= 0.0 {
                        true => 0.0,
                        false => pull,
                    };
                    [
                        (own - pull) / (1.0 - part),
                        (pull - machine.load_viscous * load_speed) / part,
                    ]
                }
            };
            [v, load_speed, a, load_a]
        };
        for _ in 0..FINE {
            let moved = |k: [f64; 4], h: f64| -> [f64; 4] { std::array::from_fn(|i| x[i] + h * k[i]) };
            let k1 = rates(x);
            let k2 = rates(moved(k1, 0.5 * h));
            let k3 = rates(moved(k2, 0.5 * h));
            let k4 = rates(moved(k3, h));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

/// With nothing but the load.
fn clean(mass: f64, load: Option<[f64; 3]>) -> Machine {
    Machine {
        mass,
        load,
        on_load: false,
        friction: 0.0,
        load_viscous: 0.0,
        gap: 0.0,
        cubic: 0.0,
        step: 1e-6,
    }
}

fn find(machine: Machine) -> Result<Trace, Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    let records: Vec<Record> = (0..3).map(|i| record(i, machine)).collect();
    let base = servo_axis(&records[..2], clock, &mut Vec::new())?;
    let held = Held::new(base, &records, clock)?;
    let mut found = held.look(&held.bare(), machine.step, true)?;
    // A beginning that a rigid axis told is wrong by what dies out, as a drift of the sensor does.
    for _ in 0..2 {
        let mut model = found.model;
        model.effects.retain(|(e, _)| e.name != "sensor-drift");
        found = held.look(&model, machine.step, true)?;
    }
    Ok(found)
}

fn load(found: &Trace) -> Option<Load> {
    match &found.model.base {
        Base::Axis(axis) => axis.load(),
        _ => None,
    }
}

/// What is named beside the rounding.
fn named(found: &Trace) -> Vec<&'static str> {
    let all = found.added.iter().map(|a| a.effect.name);
    all.filter(|name| *name != "quantization").collect()
}

/// The same without a drift of the sensor: a load that swings where a record begins leaves what dies out, which passes for one here.
fn named_beside_drift(found: &Trace) -> Vec<&'static str> {
    let all = named(found).into_iter();
    all.filter(|name| *name != "sensor-drift").collect()
}

/// Masses over five decades, soft and stiff springs, either end of the spring measured.
#[test]
fn the_load_is_the_base() -> Result<(), Box<dyn std::error::Error>> {
    for (mass, load_is, on_load) in [
        (1e-2, [0.4, 22.0, 0.03], false),
        (1e3, [0.65, 60.0, 0.06], false),
        (1.0, [0.25, 60.0, 0.1], true),
    ] {
        let found = find(Machine {
            on_load,
            ..clean(mass, Some(load_is))
        })?;
        let load = load(&found).ok_or("no load")?;
        assert_eq!(named(&found), Vec::<&str>::new(), "{load_is:?}");
        assert_eq!(load.is_measured, on_load);
        assert!(
            (load.hz / load_is[1] - 1.0).abs() < 0.02,
            "{load:?} of {load_is:?}"
        );
        let part_is_told = on_load || (load.part / load_is[0] - 1.0).abs() < 0.05;
        assert!(part_is_told, "{load:?} of {load_is:?}");
        let values = found.model.base.parameters();
        assert!(
            (values[0].value / mass - 1.0).abs() < 0.01,
            "{} of {mass}",
            values[0].value
        );
    }
    Ok(())
}

/// The guide of the load has viscous friction of its own, as that of any gear; without it none is named.
#[test]
fn viscous_friction_of_the_load() -> Result<(), Box<dyn std::error::Error>> {
    let (mass, load_is, viscous) = (3.0, [0.6, 35.0, 0.02], 0.8);
    let found = find(Machine {
        load_viscous: viscous,
        ..clean(mass, Some(load_is))
    })?;
    let load = load(&found).ok_or("no load")?;
    assert!((load.hz / load_is[1] - 1.0).abs() < 0.02, "{load:?}");
    assert_eq!(named_beside_drift(&found), ["viscous-friction"], "{load_is:?}");
    let own = found
        .added
        .iter()
        .find(|a| a.effect.name == "viscous-friction")
        .ok_or("none")?;
    let (value, deviation) = own.values[0];
    let wanted = mass * viscous;
    assert!(
        (value - wanted).abs() < (4.0 * deviation).max(0.01 * wanted),
        "{value} +- {deviation}, not {wanted}"
    );
    Ok(())
}

/// Play in the coupling, of half of the deflection and of a tenth of it, along moves that rest nowhere: a load that rests within the play may be
/// anywhere there.
#[test]
fn play_between_motor_and_load() -> Result<(), Box<dyn std::error::Error>> {
    for (mass, hz, gap) in [(2e-2, 30.0, 2e-4), (4e2, 40.0, 2e-5)] {
        let found = find(Machine {
            gap,
            step: 1e-7,
            ..clean(mass, Some([0.5, hz, 0.03]))
        })?;
        let own = found.added.iter().find(|a| a.effect.name == "backlash");
        let own = own.ok_or_else(|| format!("{mass}: {:?}", named(&found)))?;
        assert_eq!(named(&found), ["backlash"], "{mass}");
        assert!(
            (own.values[0].0 / gap - 1.0).abs() < 0.05,
            "{:?}, not {gap}",
            own.values[0]
        );
        let load = load(&found).ok_or("no load")?;
        assert!((load.hz / hz - 1.0).abs() < 0.05, "{load:?}");
    }
    Ok(())
}

/// A coupling that hardens, by a quarter at a deflection of 0.3 mm.
#[test]
fn a_coupling_that_hardens() -> Result<(), Box<dyn std::error::Error>> {
    let cubic = 3e6;
    let found = find(Machine {
        cubic,
        step: 1e-7,
        ..clean(3e-3, Some([0.5, 30.0, 0.03]))
    })?;
    assert_eq!(named_beside_drift(&found), ["cubic-stiffness"]);
    let own = found.added.iter().find(|a| a.effect.name == "cubic-stiffness");
    let (value, _) = own.ok_or("none")?.values[0];
    assert!((value / cubic - 1.0).abs() < 0.05, "{value}, not {cubic}");
    Ok(())
}

/// Dry friction and a load hide each other.
#[test]
fn dry_friction_beside_the_load() -> Result<(), Box<dyn std::error::Error>> {
    let found = find(Machine {
        friction: 1.5,
        step: 1e-4,
        ..clean(0.2, Some([0.45, 24.0, 0.04]))
    })?;
    let load = load(&found).ok_or("no load")?;
    assert!((load.hz / 24.0 - 1.0).abs() < 0.02, "{load:?}");
    // A trifle of it may be told as presliding.
    let all = found.added.iter().filter(|a| a.effect.name != "quantization");
    let level = all.clone().map(|a| a.values[0].0).sum::<f64>() / 0.2;
    assert!((level / 1.5 - 1.0).abs() < 0.03, "{level}: {:?}", named(&found));
    let is_dry = |name: &str| name.ends_with("friction") || name == "hysteresis";
    assert!(
        all.clone().count() > 0 && all.clone().all(|a| is_dry(a.effect.name)),
        "{:?}",
        named(&found)
    );
    Ok(())
}

/// A rigid axis with dry friction stays one.
#[test]
fn no_load_where_there_is_none() -> Result<(), Box<dyn std::error::Error>> {
    for friction in [0.0, 1.5] {
        let found = find(Machine {
            friction,
            step: 1e-5,
            ..clean(3.0, None)
        })?;
        assert_eq!(load(&found), None, "friction {friction}: {:?}", named(&found));
    }
    Ok(())
}
