//! Servo axes, and what is missing in them.

use super::{Draw, Judged, Lab, TaskError, Words};
use crate::trust::bundle::{Description, Table};
use crate::trust::loops::{Controller, Signals, moves, rms};
use crate::trust::machine::Axis;
use crate::trust::program::find;
use crate::trust::rig::Rig;
use lpv_core::Model;
use serde_json::Value;
use std::f64::consts::TAU;

/// A mass with viscous friction, no mode, in any units.
pub(crate) fn servo(draw: &mut Draw) -> Rig {
    let rate = draw.decades(50.0, 1e4);
    let mass = draw.decades(1e-4, 1e2);
    let axis = Axis {
        mass,
        // Comes to rest within some hundred samples.
        viscous: mass * rate * draw.decades(1e-3, 1e-2),
        stiffness: 0.0,
        modes: Vec::new(),
        measures_speed: false,
    };
    Rig {
        machine: axis.linear().sampled(1.0 / rate),
        rate,
        axis,
        controller: None,
        period: 1000,
        lines: (1..100).collect(),
        force: draw.decades(1e-2, 1e2),
        noise: 0.0,
    }
}

/// Forces that move the axis to and fro: a sum of slow sines.
pub(crate) fn swings(draw: &mut Draw, rig: &Rig, samples: usize) -> Vec<f64> {
    let tones: Vec<[f64; 2]> = (0..8)
        .map(|_| [draw.decades(0.002, 0.03), draw.uniform(0.0, TAU)])
        .collect();
    (0..samples)
        .map(|k| {
            let sum: f64 = tones
                .iter()
                .map(|[f, phase]| (TAU * f * k as f64 + phase).sin())
                .sum();
            rig.force * sum / 2.0
        })
        .collect()
}

/// `lpv identify . --structure rigid-body`: mass within a tenth, or within three stated deviations where those are below a third.
pub(crate) fn rigid_body(lab: &Lab, axis: &Axis, words: &Words) -> Result<Judged, TaskError> {
    let arguments = ["identify", ".", "-o", "m.json", "--structure", "rigid-body"];
    let said = lab.run(&arguments)?;
    let model = lpv::ModelFile::read(&lab.path("m.json")).ok();
    let found = model.and_then(|f| match f.model {
        Model::RigidBody(body) => body.axes().first().copied(),
        _ => None,
    });
    let wrong = found.map(|a| (a.inertia / axis.mass - 1.0).abs());
    let honest = found.is_some_and(|a| {
        let deviation = a.inertia_deviation / axis.mass;
        wrong.is_some_and(|w| w < 0.1 || (deviation < 0.33 && w < 3.0 * deviation))
    });
    let told = words.told(&said.first());
    let worth = crate::trust::program::worth(&lab.json("m.json"));
    let refused = said.code == Some(3) || worth == "not-a-model";
    let wanted = format!(
        "mass {:.4e}, found {:.4e}",
        axis.mass,
        found.map_or(f64::NAN, |a| a.inertia)
    );
    let mut judged = Judged::new(
        said.is_orderly() && ((honest && !refused) || told || (refused && found.is_some() && !honest)),
        &said,
        &format!("lpv {}", arguments.join(" ")),
        &wanted,
    );
    judged.is_silent =
        said.code == Some(0) && found.is_some() && !honest && !told && ["", "good"].contains(&worth.as_str());
    judged.error = wrong.map(|w| w / 0.02);
    Ok(judged)
}

/// One slow sine and a sensor whose second difference is noise.
pub(super) fn inertia_three_times_too_small(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = servo(draw);
    rig.axis.viscous *= 0.3;
    rig.machine = rig.axis.linear().sampled(1.0 / rig.rate);
    let tone = draw.uniform(0.002, 0.005);
    let input: Vec<f64> = (0..6000)
        .map(|k| rig.force * (TAU * tone * f64::from(k)).sin())
        .collect();
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * draw.decades(2e-4, 3e-3);
    let signals = rig.follow(draw, &input);
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    Description::single(rig.rate)
        .transient("a.csv", false)
        .write(&lab.folder)?;
    rigid_body(
        lab,
        &rig.axis,
        &Words::cause(&[&["inertia", "mass"], &["not", "uncertain", "cannot"]]),
    )
}

/// One motor, two encoders, and a structure that wants one of each.
pub(super) fn segment_message(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = servo(draw);
    let input = swings(draw, &rig, 800);
    let signals = rig.follow(draw, &input);
    let outputs = draw.integer(2, 3);
    let mut table = Table::default().with("u", &signals.u[0]);
    let names: Vec<String> = (1..=outputs).map(|i| format!("enc{i}")).collect();
    for name in &names {
        table = table.with(name, &signals.y[0]);
    }
    table.write(&lab.path("a.csv"))?;
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    Description::new(rig.rate, &names, &["u"])
        .transient("a.csv", false)
        .write(&lab.folder)?;
    let said = lab.run(&["identify", ".", "-o", "m.json", "--structure", "rigid-body"])?;
    let line = said.first();
    let counted = line.contains("1 input") && line.contains(&format!("{outputs} outputs"));
    let right = said.code == Some(2) && counted && !line.contains("segment");
    Ok(Judged::new(
        right,
        &said,
        "lpv identify . -o m.json --structure rigid-body",
        &format!("a rigid-body axis needs one output an input; here are 1 input and {outputs} outputs"),
    ))
}

/// A servo whose output is a speed, with friction and a mode.
pub(crate) fn servo_speed_output(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rate = draw.decades(200.0, 1e4);
    let mut axis = Axis::free(draw, rate);
    axis.measures_speed = true;
    axis.viscous = axis.mass * rate * draw.decades(1e-4, 1e-3);
    let mut rig = Rig::excited(draw, rate, axis, None);
    let input = swings(draw, &rig, 6000);
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * 1e-3;
    let signals = rig.follow(draw, &input);
    Table::default()
        .with("omega", &signals.y[0])
        .with("torque", &signals.u[0])
        .write(&lab.path("a.csv"))?;
    Description::new(rate, &["omega"], &["torque"])
        .transient("a.csv", false)
        .write(&lab.folder)?;
    rigid_body(lab, &rig.axis, &Words::cause(&[&["speed", "velocity"]]))
}

/// A mass with dry friction in a loop (or without one), stepped finely.
struct Rubbing {
    mass: f64,
    viscous: f64,
    coulomb: f64,
    /// Relative change of the friction over the record.
    fade: f64,
    spring: [f64; 2],
    h: f64,
}

impl Rubbing {
    /// Position samples under `force(k, measured)`, held between samples.
    fn run(
        &self,
        samples: usize,
        noise: f64,
        draw: &mut Draw,
        mut force: impl FnMut(usize, f64) -> f64,
    ) -> (Vec<f64>, Vec<f64>) {
        const SUB: usize = 20;
        let dt = self.h / SUB as f64;
        let (mut q, mut v) = (0.0_f64, 0.0_f64);
        let (mut y, mut u) = (Vec::new(), Vec::new());
        for k in 0..samples {
            let measured = q + noise * draw.normal();
            let f = force(k, measured);
            y.push(measured);
            u.push(f);
            let level = self.coulomb * (1.0 - self.fade * k as f64 / samples as f64);
            for _ in 0..SUB {
                let free = f - self.viscous * v - self.spring[0] * q - self.spring[1] * q.powi(3);
                let next = v + dt * free / self.mass;
                let brake = dt * level / self.mass;
                // Friction takes speed away and never turns it round.
                v = next - next.clamp(-brake, brake);
                q += dt * v;
            }
        }
        (y, u)
    }
}

/// The effects that a diagnosis added.
fn effects(lab: &Lab) -> Vec<String> {
    let found = lab.json("d/diagnosis.json");
    let all = find(&found, "effects")
        .and_then(Value::as_array)
        .cloned()
        .unwrap_or_default();
    all.iter()
        .filter_map(|e| Some(e.get("effect")?.as_str()?.to_owned()))
        .collect()
}

const FRICTIONS: [&str; 3] = [
    "coulomb-friction",
    "stribeck-friction",
    "direction-dependent-friction",
];

/// A shaft that turns freely, its friction falling while it turns.
pub(super) fn free_shaft_cable(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let h = 1.0 / draw.decades(20.0, 200.0);
    let inertia = draw.decades(1e-4, 1e-1);
    // Reaches some hundred turns within the record.
    let samples = 700;
    let speed = draw.uniform(1000.0, 4000.0) / (samples as f64 * h);
    let shaft = Rubbing {
        mass: inertia,
        viscous: inertia / h * draw.decades(5e-3, 3e-2),
        coulomb: 0.0,
        fade: draw.uniform(0.1, 0.3),
        spring: [0.0; 2],
        h,
    };
    let shaft = Rubbing {
        coulomb: shaft.viscous * speed * draw.uniform(0.5, 1.5),
        ..shaft
    };
    let torque = shaft.viscous * speed + shaft.coulomb;
    let controller = Controller::lead(inertia, 0.002 / h, h);
    let mut description = Description::single(1.0 / h)
        .referred(&["r"])
        .controlled(&controller);
    for i in 0..6 {
        let level = torque * [1.0, 0.9, 1.15][i % 3] * if i < 3 { 1.0 } else { -1.0 };
        let (y, u) = shaft.run(samples, 1e-3, draw, |k, _| if k < 20 { 0.0 } else { level });
        let file = format!("t{i}.csv");
        // The reference is what was measured: a stand-in that tracks.
        Table::default()
            .with("y", &y)
            .with("u", &u)
            .with("r", &y)
            .with("inj", &u)
            .write(&lab.path(&file))?;
        description = description.transient(&file, i % 3 == 2);
    }
    let text = description.text().replace(
        "kind = \"transient\"",
        "kind = \"transient\"\ninjection = { columns = [\"inj\"] }",
    );
    std::fs::write(lab.path("experiment.toml"), text)?;
    let said = lab.run(&["diagnose", ".", "-o", "d"])?;
    let found = effects(lab);
    // The friction of this shaft falls: by its whole name, or as dry friction with what is left.
    let right = said.code == Some(0)
        && found
            .iter()
            .any(|e| e == "friction-drift" || FRICTIONS.contains(&e.as_str()))
        && !found
            .iter()
            .any(|e| e == "cable-stiffness" || e == "periodic-disturbance");
    let named = Words::cause(&[&["in time", "trend", "unexplained", "turns"]]).told(&said.first());
    Ok(Judged::new(
        right || (named && !found.iter().any(|e| e == "cable-stiffness")),
        &said,
        "lpv diagnose . -o d",
        &format!(
            "dry friction, no cable on a shaft of {:.0} turns, no period of one record; found {found:?}",
            speed * samples as f64 * h / TAU
        ),
    ))
}

/// Torques and angles of an axis whose controller nobody knows.
pub(super) fn no_controller(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let h = 1.0 / draw.decades(50.0, 1000.0);
    let mass = draw.decades(1e-3, 1e2);
    let reach = draw.decades(1e-2, 1e2);
    let (steps, rest) = (250, 50);
    let peak = 5.8 * reach / (steps as f64 * h).powi(2);
    let axis = Rubbing {
        mass,
        viscous: 0.05 * mass * peak / (1.9 * reach / (steps as f64 * h)),
        coulomb: mass * peak * draw.uniform(0.2, 0.5),
        fade: 0.0,
        spring: [0.0; 2],
        h,
    };
    let hidden = Controller::lead(mass, 0.03 / h, h);
    let mut description = Description::single(1.0 / h);
    for (i, file) in ["a.csv", "b.csv", "c.csv"].into_iter().enumerate() {
        let targets = [
            [1.0, -0.5, 0.7, 0.0],
            [0.6, 1.0, -0.8, 0.0],
            [-1.0, 0.4, -0.3, 0.0],
        ][i]
            .map(|t| t * reach);
        let path = moves(&targets, steps, rest);
        let (mut before, mut last) = (0.0, 0.0);
        let (y, u) = axis.run(path.len(), reach * 1e-5, draw, |k, y| {
            let error = path[k] - y;
            last = hidden.feedback[0] * error + hidden.feedback[1] * before - hidden.denominator[1] * last;
            before = error;
            last
        });
        Table::default()
            .with("y", &y)
            .with("u", &u)
            .write(&lab.path(file))?;
        description = description.transient(file, i == 2);
    }
    description.write(&lab.folder)?;
    let said = lab.run(&["diagnose", ".", "-o", "d"])?;
    let found = effects(lab);
    let right = said.code == Some(0) && found.iter().any(|e| FRICTIONS.contains(&e.as_str()));
    Ok(Judged::new(
        right,
        &said,
        "lpv diagnose . -o d",
        &format!("dry friction; found {found:?}"),
    ))
}

/// A mass on a hardening spring, measured without a loop.
pub(super) fn open_loop_machine_cannot_be_diagnosed(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rate = draw.decades(100.0, 1e4);
    let mass = draw.decades(1e-2, 1e2);
    let w = TAU * rate * draw.uniform(0.05, 0.1);
    let stiffness = mass * w * w;
    let scale = draw.decades(1e-3, 1e1);
    let machine = Rubbing {
        mass,
        viscous: 2.0 * 0.05 * mass * w,
        coulomb: 0.0,
        fade: 0.0,
        // At the deflection `scale` the spring is stiffer by this part.
        spring: [stiffness, stiffness * draw.uniform(0.1, 0.4) / (scale * scale)],
        h: 1.0 / rate,
    };
    let mut description = Description::single(rate);
    for (file, is_held_out) in [("a.csv", false), ("b.csv", true)] {
        let mut force = 0.0;
        let drive: Vec<f64> = (0..1500)
            .map(|_| {
                force = 0.7 * force + draw.normal();
                force * stiffness * scale * 0.35
            })
            .collect();
        let (y, u) = machine.run(drive.len(), scale * 1e-4, draw, |k, _| drive[k]);
        Table::default()
            .with("y", &y)
            .with("u", &u)
            .write(&lab.path(file))?;
        description = description.transient(file, is_held_out);
    }
    description.write(&lab.folder)?;
    let said = lab.run(&["diagnose", ".", "-o", "d"])?;
    let found = effects(lab);
    let right = said.code == Some(0)
        && found
            .iter()
            .any(|e| e.contains("stiffness") || e.contains("spring"));
    Ok(Judged::new(
        right,
        &said,
        "lpv diagnose . -o d",
        &format!("a spring that hardens; found {found:?}"),
    ))
}

/// The rig with dry friction, in its loop along a path.
pub(crate) fn rubbed(rig: &Rig, coulomb: f64, path: &[f64], draw: &mut Draw) -> Signals {
    let axis = Rubbing {
        mass: rig.axis.mass,
        viscous: rig.axis.viscous,
        coulomb,
        fade: 0.0,
        spring: [0.0; 2],
        h: 1.0 / rig.rate,
    };
    let mut last = [0.0; 2];
    let (y, u) = axis.run(path.len(), rig.noise, draw, |k, y| match &rig.controller {
        Some(c) => {
            let error = path[k] - y;
            let command = c.feedback[0] * error + c.feedback[1] * last[0] - c.denominator[1] * last[1];
            last = [error, command];
            command
        }
        None => path[k],
    });
    Signals {
        y: vec![y],
        u: vec![u],
        r: vec![path.to_vec()],
    }
}
