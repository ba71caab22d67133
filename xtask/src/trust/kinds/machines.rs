//! Machines that ask much of a model: coupled rigid bodies, many modes, friction at all places, decades of frequency.

use super::records::Places;
use super::{Draw, Judged, Lab, TaskError, Words};
use crate::trust::bundle::{Description, Table};
use crate::trust::judge::{Line, Truth};
use crate::trust::loops::{Controller, Run, Signals, loop_radius, moves, multisine, repeated, rms, simulate};
use crate::trust::machine::{Linear, Mechanics};
use crate::trust::rig::{Rig, size};
use lpv_core::nalgebra::{self, DMatrix, dmatrix};
use std::f64::consts::TAU;

/// A beam on two drives with a carriage on a spring across it; forces and positions are those of the drives.
fn gantry(p: f64, mass: f64, length: f64, mode_hz: f64) -> Option<Linear> {
    let (beam, carriage) = (mass, 0.5 * mass);
    let inertia = 0.085 * mass * length * length;
    // The carriage is held at the beam at `x = p`; its spring has this frequency at the middle.
    let reduced = beam * carriage / (beam + carriage);
    let k = reduced * (TAU * mode_hz).powi(2);
    let d = 2.0 * 0.02 * (k * reduced).sqrt();
    let h = dmatrix![1.0; p; -1.0];
    let half = 0.5 * length;
    let b = dmatrix![1.0, 1.0; -half, half; 0.0, 0.0];
    Mechanics {
        m: DMatrix::from_diagonal(&dmatrix![beam; inertia; carriage].column(0).into_owned()),
        d: &h * h.transpose() * d,
        k: &h * h.transpose() * k,
        c: b.transpose(),
        b,
        measures_speed: false,
    }
    .linear()
}

/// An H-gantry whose channels are not decoupled for the rigid body.
pub(super) fn gantry_undecoupled(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rate = draw.decades(200.0, 2e4);
    let h = 1.0 / rate;
    let (mass, length) = (draw.decades(0.1, 100.0), draw.decades(0.05, 5.0));
    let mode = rate * draw.uniform(0.03, 0.06);
    let period = 1000;
    let lines: Vec<usize> = (1..350).collect();
    let force = draw.decades(0.1, 100.0);
    let places: Vec<f64> = (0..5)
        .map(|i| 0.3 * length * (f64::from(i) / 2.0 - 1.0))
        .collect();
    let sampled = |p: f64| -> Result<Linear, TaskError> {
        Ok(gantry(p, mass, length, mode)
            .ok_or("a gantry has masses")?
            .sampled(h))
    };
    // Each drive sees about a quarter of the mass.
    let mut controller = Controller::lead(0.25 * mass, mode / 10.0, h);
    while places.iter().any(|p| {
        sampled(*p).is_ok_and(|m| loop_radius(&m, &[controller.clone(), controller.clone()]) > 0.997)
    }) {
        controller.feedback.iter_mut().for_each(|v| *v *= 0.7);
        if controller.feedback[0].abs() < 1e-6 * mass {
            return Err("no controller for this gantry".into());
        }
    }
    controller.reference.clone_from(&controller.denominator);
    let mut description = Description::new(rate, &["y1", "y2"], &["u1", "u2"])
        .referred(&["r1", "r2"])
        .scheduled("x_pos");
    let mut truth_lines = Vec::new();
    let mut machines = Vec::new();
    for (i, p) in places.iter().enumerate() {
        let machine = sampled(*p)?;
        let (one, two) = (multisine(draw, period, &lines), multisine(draw, period, &lines));
        for (sign, letter) in [(1.0, 'a'), (-1.0, 'b')] {
            let scaled =
                |v: &[f64], s: f64| repeated(&v.iter().map(|v| v * s * force).collect::<Vec<_>>(), 8);
            let mut run = Run {
                reference: vec![scaled(&one, 1.0), scaled(&two, sign)],
                noise: vec![0.0; 2],
                ..Run::default()
            };
            let loops = [controller.clone(), controller.clone()];
            let clean = simulate(&machine, &loops, &run, draw);
            // The mode stays well above the noise: its line is a ten-thousandth of the rigid motion.
            let noise = rms(&clean.y[0][6 * period..]) * 1e-5;
            run.noise = vec![noise; 2];
            let signals = simulate(&machine, &loops, &run, draw);
            let file = format!("pos{}{letter}.csv", i + 1);
            let at = vec![*p; signals.y[0].len()];
            Table::of(&signals).with("x_pos", &at).write(&lab.path(&file))?;
            description = description.periodic(&file, period, false);
            if truth_lines.is_empty() {
                let last = 4 * period;
                let line = |k: &usize| Line {
                    cycles: *k as f64 / period as f64,
                    input: size(&signals.u[0][last..], *k as f64 / period as f64),
                    noise: noise * (last as f64).sqrt(),
                };
                truth_lines = lines.iter().map(line).collect();
            }
        }
        machines.push((*p, machine));
    }
    description.write(&lab.folder)?;
    let truth = Truth {
        places: machines,
        h,
        lines: truth_lines,
        share: 60.0 / (40.0 * 350.0),
    };
    lab.identify(
        ".",
        Some(&truth),
        &[],
        &Words::none().or_approximate(),
        "the machine, or that the model is not good",
    )
}

/// More modes than an order of twelve has.
pub(super) fn many_modes(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let count = draw.integer(9, 30);
    let mut rig = Rig::open(draw, count);
    let low = rig
        .axis
        .modes
        .iter()
        .map(|m| m[0] * m[1])
        .fold(f64::INFINITY, f64::min)
        / rig.rate;
    // Long enough for the slowest decay.
    rig.period = ((3.0 / low) as usize).clamp(1000, 4000);
    rig.lines = (1..rig.period * 2 / 5).collect();
    rig.noise = 0.0;
    let force = rig.excitation(draw);
    let input = repeated(&force, 6);
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * 1e-3;
    let signals = rig.follow(draw, &input);
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    Description::single(rig.rate)
        .periodic("a.csv", rig.period, false)
        .write(&lab.folder)?;
    let words = Words::cause(&[
        &["order", "states", "modes"],
        &[
            "suffice",
            "largest",
            "more than",
            "not enough",
            "too few",
            "beyond",
            "too small",
        ],
    ])
    .or_approximate();
    lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &words,
        &format!("{count} modes, or that the order does not suffice"),
    )
}

/// Viscous friction to ground, one axis at five places, judged along a move too.
pub(super) fn viscous_friction(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut places = Places::new(draw, 5);
    let cross = TAU * places.rig.axis.modes[0][0] / 9.0;
    let viscous = places.rig.axis.mass * cross * draw.decades(1e-3, 1.0);
    places.axes.iter_mut().for_each(|a| a.viscous = viscous);
    places.rig.axis.viscous = viscous;
    let mut description = places.description();
    let mut any = None;
    for i in 0..5 {
        let (table, signals) = places.record(draw, i, 8);
        table.write(&lab.path(&format!("pos{}.csv", i + 1)))?;
        if i == 2 {
            let rig = places.rig_at(i);
            let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
            let reach = rms(&signals.y[0]) * 30.0;
            let moved = rig.follow(draw, &moves(&[reach, 0.0], 40 * slow, 10 * slow));
            let at = vec![places.positions[i]; moved.y[0].len()];
            Rig::table(&moved).with("p", &at).write(&lab.path("m.csv"))?;
            any = Some(signals);
        }
    }
    if let Some(c) = &places.rig.controller {
        description = description.controlled(c);
    }
    description.transient("m.csv", true).write(&lab.folder)?;
    let truth = any.map(|s| places.truth(&s));
    let words = Words::cause(&[&["friction", "viscous"]]).or_approximate();
    let wanted = format!("the machine with its viscous friction of {viscous:.3e}, or a word of it");
    let identified = lab.identify(".", truth.as_ref(), &[], &words, &wanted)?;
    Ok(identified)
}

/// Steps at nine places of a lag with dead time, short records, several sessions.
pub(super) fn nine_positions_steps(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rate = draw.decades(10.0, 1e4);
    let h = 1.0 / rate;
    let reach = draw.decades(1e-2, 1e2);
    let gain = draw.decades(1e-2, 1e2);
    let lag = rate * draw.uniform(0.1, 0.2);
    let dead = draw.integer(2, 4);
    let mut description = Description::single(rate).scheduled("p");
    let mut places = Vec::new();
    let noise = draw.uniform(0.01, 0.03);
    for i in 0..9 {
        let p = reach * (f64::from(i) / 4.0 - 1.0);
        // A second-order lag whose bandwidth changes by a fifth over the stroke.
        let w = lag * (1.0 + 0.1 * p / reach);
        let machine = Mechanics {
            m: dmatrix![1.0],
            d: dmatrix![1.6 * w],
            k: dmatrix![w * w],
            b: dmatrix![gain * w * w],
            c: dmatrix![1.0],
            measures_speed: false,
        };
        let machine = machine.linear().ok_or("a lag has a mass")?.sampled(h);
        for session in 0..8 {
            let height = draw.uniform(0.5, 1.5);
            let step: Vec<f64> = (0..70)
                .map(|k| if k < 10 + dead { 0.0 } else { height })
                .collect();
            let run = Run {
                reference: vec![step.clone()],
                noise: vec![noise * gain * height],
                ..Run::default()
            };
            let signals = simulate(&machine, &[], &run, draw);
            let logged: Vec<f64> = step[dead..]
                .iter()
                .copied()
                .chain([height].repeat(dead))
                .collect();
            let file = format!("s{session}p{i}.csv");
            Table::default()
                .with("y", &signals.y[0])
                .with("u", &logged)
                .with("p", &vec![p; 70])
                .write(&lab.path(&file))?;
            description = description.transient(&file, session == 7);
        }
        places.push((p, super::clock::delayed(&machine, dead)));
    }
    description.write(&lab.folder)?;
    // A step has most of its power at low lines.
    let lines = (1..60)
        .map(|k| Line {
            cycles: f64::from(k) / 140.0,
            input: 22.0 / f64::from(k),
            noise: noise * gain * 70.0_f64.sqrt(),
        })
        .collect();
    let truth = Truth {
        places,
        h,
        lines,
        // A lag and its dead time at each place, from seven short records of each.
        share: 6.0 / (7.0 * 70.0),
    };
    lab.identify(
        ".",
        Some(&truth),
        &[],
        &Words::none().or_approximate(),
        "the lags with their dead time, or that the model is not good",
    )
}

/// A motor and a load with an encoder each, over four decades of frequency.
pub(super) fn two_encoder_stage_frf(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let period = 8000;
    let rate = draw.decades(100.0, 1e5);
    let h = 1.0 / rate;
    let mass = draw.decades(1e-2, 1e2);
    // Three masses in a row with friction to ground: rigid at low lines, two modes and more above.
    let masses = [1.0, draw.uniform(0.3, 1.5), draw.uniform(0.1, 0.5)].map(|m| m * mass);
    let stiff = |f: f64| mass * (TAU * f * rate).powi(2);
    let springs = [stiff(draw.uniform(0.008, 0.02)), stiff(draw.uniform(0.04, 0.08))];
    let mut k = DMatrix::zeros(3, 3);
    for (i, s) in springs.iter().enumerate() {
        for (a, b, v) in [
            (i, i, 1.0),
            (i + 1, i + 1, 1.0),
            (i, i + 1, -1.0),
            (i + 1, i, -1.0),
        ] {
            k[(a, b)] += s * v;
        }
    }
    let ground = mass * TAU * rate * 1e-4;
    let machine = Mechanics {
        m: DMatrix::from_diagonal(&dmatrix![masses[0]; masses[1]; masses[2]].column(0).into_owned()),
        d: &k * (0.05 / (TAU * rate)) + DMatrix::identity(3, 3) * ground,
        k,
        b: dmatrix![1.0; 0.0; 0.0],
        c: dmatrix![1.0, 0.0, 0.0; 0.0, 1.0, 0.0],
        measures_speed: false,
    };
    let machine = machine.linear().ok_or("a stage has masses")?.sampled(h);
    // Lines about even in the logarithm.
    let mut lines: Vec<usize> = (0..220)
        .map(|i| 1.09_f64.powf(f64::from(i) * 0.4).round() as usize)
        .collect();
    lines.dedup();
    lines.retain(|k| *k < period * 2 / 5);
    let force = draw.decades(1e-2, 1e2);
    let amplitude = force * (2.0 / lines.len() as f64).sqrt();
    let phases: Vec<f64> = lines.iter().map(|_| draw.uniform(0.0, TAU)).collect();
    let response: Vec<_> = lines
        .iter()
        .map(|k| machine.response(*k as f64 / period as f64))
        .collect();
    let mut signals = Signals {
        y: vec![Vec::new(); 2],
        u: vec![Vec::new()],
        r: Vec::new(),
    };
    // The steady response, each line with its own noise of one percent a period.
    for _ in 0..4 {
        let mut block = vec![vec![0.0; period]; 3];
        for ((line, phase), f) in lines.iter().zip(&phases).zip(&response) {
            let f = f.as_ref().ok_or("no line at a pole")?;
            let errors: Vec<f64> = (0..4).map(|_| 0.01 * draw.normal()).collect();
            for t in 0..period {
                let angle = TAU * ((line * t) % period) as f64 / period as f64 + phase;
                let (sin, cos) = angle.sin_cos();
                block[2][t] += amplitude * cos;
                for j in 0..2 {
                    let (re, im) = (f[(j, 0)].re, f[(j, 0)].im);
                    let (re, im) = (
                        re * (1.0 + errors[2 * j]) - im * errors[2 * j + 1],
                        im * (1.0 + errors[2 * j]) + re * errors[2 * j + 1],
                    );
                    block[j][t] += amplitude * (re * cos - im * sin);
                }
            }
        }
        for j in 0..2 {
            signals.y[j].extend(&block[j]);
        }
        signals.u[0].extend(&block[2]);
    }
    Table::default()
        .with("force", &signals.u[0])
        .with("y_motor", &signals.y[0])
        .with("y_load", &signals.y[1])
        .write(&lab.path("a.csv"))?;
    Description::new(rate, &["y_motor", "y_load"], &["force"])
        .periodic("a.csv", period, false)
        .write(&lab.folder)?;
    let weighted = lines
        .iter()
        .zip(&response)
        .filter_map(|(k, f)| {
            Some(Line {
                cycles: *k as f64 / period as f64,
                input: 1.0,
                noise: 0.01 * f.as_ref()?.norm(),
            })
        })
        .collect();
    let truth = Truth {
        places: vec![(0.0, machine)],
        h,
        lines: weighted,
        share: 20.0 / (16.0 * lines.len() as f64),
    };
    lab.identify(
        ".",
        Some(&truth),
        &[],
        &Words::none().or_approximate(),
        "both encoders right at every decade, or that the model is not good",
    )
}

/// Two records of one machine, of other lengths.
pub(super) fn lengths(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, 1);
    rig.noise = 0.0;
    let mut description = Description::single(rig.rate);
    let mut any = None;
    for file in ["a.csv", "b.csv"] {
        let samples = draw.integer(900, 2500);
        let input = rig.random(draw, samples);
        if rig.noise == 0.0 {
            let clean = rig.follow(draw, &input);
            rig.noise = rms(&clean.y[0]) * draw.decades(1e-3, 1e-2);
        }
        let signals = rig.follow(draw, &input);
        let mut table = Rig::table(&signals);
        table.0.retain(|(name, _)| name != "r");
        table.write(&lab.path(file))?;
        description = description.transient(file, false);
        any = Some(signals);
    }
    description.write(&lab.folder)?;
    let cycles: Vec<f64> = (1..200).map(|k| 0.45 * f64::from(k) / 200.0).collect();
    let truth = any.map(|s| rig.truth_on(&s, &cycles));
    lab.identify(
        ".",
        truth.as_ref(),
        &[],
        &Words::none(),
        "one model of both records",
    )
}
