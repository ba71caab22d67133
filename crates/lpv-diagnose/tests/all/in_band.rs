//! Axes in which more is wrong than any catalogue holds, simulated by hand: what every machine has is named with its size, and nothing else.

use crate::common::{self, middle_step};
use lpv_diagnose::lpv_core::{ControllerState, Discrete, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Added, Axis, Base, Case, Explained, Trace, Track, trace, trace_in_band};

const RATE: f64 = 200.0;
const RECORDS: usize = 6;
const SAMPLES: usize = 2000;

/// What acts on the axis, over its inertia.
#[derive(Clone, Copy, Default)]
struct Acts {
    friction: f64,
    /// Force that grows with the position; below zero a pendulum on its head.
    slope: f64,
    /// Size of three sines that nothing else tells of, other ones in each record.
    unknown: f64,
    viscous: f64,
}

/// A record of an axis of this inertia that travels about `reach`.
fn record(number: usize, (inertia, reach): (f64, f64), acts: Acts) -> Record {
    const FINE: usize = 50;
    let h = 1.0 / (RATE * FINE as f64);
    let step = 1e-5 * reach;
    let (mut x, mut v, mut read) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let t = k as f64 / RATE;
        let turn = 1.0 + 0.13 * number as f64;
        let wanted = 0.4 * (1.9 * turn * t).sin() + 0.3 * (0.7 * turn * t).sin();
        let last = std::mem::replace(&mut read, (reach * x / step).round() * step);
        outputs.push(read);
        let force = 900.0 * (wanted - read / reach) - 40.0 * (read - last) / reach * RATE;
        inputs.push(inertia * reach * force);
        let sine = |j: usize| {
            let hz = [0.23, 0.61, 1.17][j] * (1.0 + 0.21 * number as f64);
            (std::f64::consts::TAU * hz * t + 2.4 * (3 * number + j) as f64).sin()
        };
        let unknown = acts.unknown * (0..3).map(sine).sum::<f64>();
        for _ in 0..FINE {
            let rate = |x: f64, v: f64| {
                force - acts.viscous * v - acts.friction * (v / 1e-3).tanh() - acts.slope * x + unknown
            };
            middle_step(&mut x, &mut v, h, rate);
        }
    }
    observer::followed(common::record(&number.to_string(), vec![outputs], vec![inputs]))
}

fn tracks(records: &[Record], controller: &ControllerState) -> Result<Vec<Track>, lpv_diagnose::TraceError> {
    let one = |r: &Record| Track::new(r, 1.0 / RATE, 2, Some(controller));
    records.iter().map(one).collect()
}

/// What is said of the axis, down to the noise and in the band of the motion.
fn find(
    (inertia, reach): (f64, f64),
    acts: Acts,
) -> Result<(Trace, Option<Trace>), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(RATE)?;
    let records: Vec<Record> = (0..RECORDS).map(|i| record(i, (inertia, reach), acts)).collect();
    let base = Base::Axis(Axis::new(inertia, inertia * acts.viscous, 0.0));
    let observer = Observer::new(&base, &records, clock)?;
    let controller = observer.controller.start()?;
    let bare = Explained {
        base: base.clone(),
        effects: Vec::new(),
    };
    let (fitted, judged) = records.split_at(RECORDS / 2);
    let settled = |records: &[Record]| -> Result<Vec<Track>, lpv_diagnose::TraceError> {
        Ok(observer::settled(
            &bare,
            &controller,
            &tracks(records, &controller)?,
        ))
    };
    let (fitted, judged) = (settled(fitted)?, settled(judged)?);
    let case = Case {
        base: &base,
        prior: None,
        free: None,
        controller: &controller,
        noise: [1e-5 * reach / 12_f64.sqrt(), 0.0],
        fitted: &fitted,
        judged: &judged,
        own: &[],
        seeks_load: false,
        on_fit: &|_, _| {},
    };
    let strict = trace(&case)?;
    let in_band = trace_in_band(&case, observer.hz, &strict)?;
    Ok((strict, in_band))
}

/// All that is named but the rounding of the readings.
fn named(found: &Trace) -> Vec<&Added> {
    found
        .added
        .iter()
        .filter(|a| a.effect.name != "quantization")
        .collect()
}

fn names(found: &Trace) -> Vec<&'static str> {
    named(found).iter().map(|a| a.effect.name).collect()
}

/// Inertias over six decades, units of length over three, friction over one.
#[test]
fn dry_friction_beside_what_nobody_knows() -> Result<(), Box<dyn std::error::Error>> {
    for (inertia, reach, friction) in [(1e-3, 1.0, 2.0), (1e3, 50.0, 0.7), (0.2, 0.05, 6.0)] {
        let acts = Acts {
            friction,
            unknown: 0.15 * friction,
            viscous: 0.4,
            ..Acts::default()
        };
        let (strict, in_band) = find((inertia, reach), acts)?;
        let found = in_band.as_ref().unwrap_or(&strict);
        assert_eq!(names(found), ["coulomb-friction"], "{inertia} {reach} {friction}");
        let (level, deviation) = named(found)[0].values[0];
        let wanted = inertia * reach * friction;
        assert!(
            (level / wanted - 1.0).abs() < 0.15 && (level - wanted).abs() < 4.0 * deviation,
            "{inertia} {reach} {friction}: {level} ({deviation}) of {wanted}"
        );
    }
    Ok(())
}

/// A pendulum on its head, of which the inertia takes the place where the slope is left out.
#[test]
fn a_force_that_grows_with_the_position_beside_friction() -> Result<(), Box<dyn std::error::Error>> {
    for (inertia, reach) in [(5e-3, 30.0), (40.0, 0.2)] {
        let acts = Acts {
            friction: 1.5,
            slope: -6.0,
            unknown: 0.2,
            viscous: 0.3,
        };
        let (strict, in_band) = find((inertia, reach), acts)?;
        let found = in_band.as_ref().unwrap_or(&strict);
        let mut names = names(found);
        names.sort_unstable();
        assert_eq!(names, ["coulomb-friction", "position-force"], "{inertia} {reach}");
        for added in named(found) {
            let wanted = match added.effect.name {
                "coulomb-friction" => inertia * reach * acts.friction,
                _ => inertia * acts.slope,
            };
            let (value, _) = added.values[0];
            assert!(
                (value / wanted - 1.0).abs() < 0.2,
                "{}: {value} of {wanted}",
                added.effect.name
            );
        }
    }
    Ok(())
}

/// A force that has no cause in the catalogue has no name, however large it is.
#[test]
fn what_nobody_knows_has_no_name() -> Result<(), Box<dyn std::error::Error>> {
    for (inertia, reach, unknown) in [(1e-3, 1.0, 0.3), (1e2, 20.0, 2.0), (1.0, 0.01, 0.05)] {
        let acts = Acts {
            unknown,
            viscous: 0.4,
            ..Acts::default()
        };
        let (strict, in_band) = find((inertia, reach), acts)?;
        assert!(names(&strict).is_empty(), "{inertia}: {:?}", names(&strict));
        let said = in_band.as_ref().map(names);
        assert!(said.is_none(), "{inertia}: {said:?}");
    }
    Ok(())
}

/// Of an axis that lacks nothing, nothing is sought in the band.
#[test]
fn a_clean_axis_stays_clean() -> Result<(), Box<dyn std::error::Error>> {
    for (inertia, reach) in [(1e-3, 1.0), (1e3, 0.02)] {
        let acts = Acts {
            viscous: 0.4,
            ..Acts::default()
        };
        let (strict, in_band) = find((inertia, reach), acts)?;
        assert!(in_band.is_none());
        assert!(
            names(&strict).iter().all(|n| *n == "quantization"),
            "{:?}",
            names(&strict)
        );
    }
    Ok(())
}
