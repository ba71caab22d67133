//! `lpv diagnose`.

use crate::common::{Desk, Noise, csv, entry, head, number, shared, stdout_of};
use lpv_core::{Model, RigidBody, RigidBodyAxis};
use std::f64::consts::TAU;
use std::ffi::OsStr;

fn diagnosis(name: &str) -> Option<serde_json::Value> {
    let folder = shared(name)?;
    let desk = Desk::new();
    let words: [&OsStr; 4] = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "found".as_ref(),
    ];
    stdout_of("diagnose", &desk.program(&words).output().unwrap());
    assert!(desk.path("found/diagnosis.html").is_file());
    let text = std::fs::read_to_string(desk.path("found/diagnosis.json")).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

/// The independent simulator's README tells what is in each machine.
#[test]
fn a_machine_without_an_effect_is_left_alone() {
    let Some(found) = diagnosis("machine-plain") else {
        return;
    };
    assert_eq!(found["verdict"], "nothing-missing");
    assert_eq!(found["effects"].as_array().unwrap().len(), 0);
    assert_eq!(found["format"], 1);
}

#[test]
fn friction_is_named_and_explains_the_moves() {
    let Some(found) = diagnosis("machine-friction") else {
        return;
    };
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"][0]["effect"], "coulomb-friction");
    assert_eq!(found["effects"].as_array().unwrap().len(), 1);
    // A friction that is larger near rest is no better, and the program says what would show it.
    let reasons = found["reasons"].to_string();
    assert!(
        reasons.contains("stribeck-friction refines coulomb-friction") && reasons.contains("slow moves"),
        "{reasons}"
    );
    let left = &found["left"];
    assert!(left["before"][0]["share"].as_f64().unwrap() > 0.99, "{left}");
    let surest = left["after"][0]["adjusted"].as_f64().unwrap();
    assert!(surest > 1e-3, "{left}");
    // One step ahead, what remains is the noise of the sensors (README of the data).
    for (output, noise) in [("y1", 3.3e-8), ("y2", 1.7e-6)] {
        let error = number(&found, &format!("/after/validation/{output}/rms_one_step"));
        assert!((0.9..1.5).contains(&(error / noise)), "{output} {error}");
    }
    assert!(number(&found, "/before/validation/y1/over_noise") > 1e3);
    assert!(number(&found, "/after/validation/y1/over_noise") < 1.1);
    assert!(number(&found, "/after/validation/y2/over_noise") < 1.1);
}

#[test]
fn an_extra_mode_is_named_with_its_frequency() {
    let Some(found) = diagnosis("machine-extra-mode") else {
        return;
    };
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"][0]["effect"], "extra-mode");
    let frequency = number(&found, "/effects/0/parameters/frequency/value");
    assert!((frequency / 4.40 - 1.0).abs() < 0.01, "{frequency}");
    let mass = number(&found, "/effects/0/parameters/mass/value");
    assert!((mass / 0.465 - 1.0).abs() < 0.01, "{mass}");
    for output in ["y1", "y2"] {
        assert!(number(&found, &format!("/after/validation/{output}/over_noise")) < 1.1);
    }
}

/// What such a sensor leaves is not white: it stays the same while the machine moves by less than a step.
#[test]
fn the_rounding_of_a_coarse_sensor_is_named() {
    let desk = Desk::new();
    desk.done("simulate --hide quantization=1.5e-4 -o coarse");
    desk.done("diagnose coarse -o found");
    let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    assert!(found["left"]["after"][0]["share"].as_f64().unwrap() > 0.05);
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"].as_array().unwrap().len(), 1);
    assert_eq!(found["effects"][0]["effect"], "quantization");
    let step = number(&found, "/effects/0/parameters/step/value");
    assert!((step / 1.5e-4 - 1.0).abs() < 1e-6, "{step}");
}

/// Janot, Gautier, Brunot (2019): 95.109 kg, 203.50 N s/m, 20.394 N, -3.165 N; in closed loop on the pulse record 0.00802, 0.4789 and
/// 8.941 %, with friction by direction 3.112 % of force on the other.
#[test]
fn the_friction_of_a_measured_axis() {
    let Some(d) = diagnosis("emps") else { return };
    assert_eq!(d["verdict"], "partly-explained");
    let names: Vec<_> = d["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| &e["effect"])
        .collect();
    assert_eq!(names, ["coulomb-friction", "direction-dependent-friction"]);
    let near = |value: &serde_json::Value, truth: f64, part: f64| {
        let value = value.as_f64().unwrap();
        assert!((value / truth - 1.0).abs() <= part, "{value} {truth}");
    };
    let first = &d["effects"][0];
    near(&first["base_parameters_then"]["mass"], 95.109, 0.005);
    near(&first["base_parameters_then"]["viscous friction"], 203.50, 0.03);
    near(&first["base_parameters_then"]["offset"], -3.165, 0.05);
    near(&first["parameters"]["level"]["value"], 20.394, 0.03);
    let at_most =
        |value: &serde_json::Value, bar: f64| assert!(value.as_f64().unwrap() <= bar, "{value} {bar}");
    let [fitted, pulses] = [0, 1].map(|i| &d["axis"][i]);
    // The published friction by direction is a mean with a part that differs, and an offset of (Fc+ - Fc-) / 2 the other way.
    near(&d["base_parameters"]["mass"]["value"], 95.154, 0.005);
    near(
        &d["effects"][1]["parameters"]["viscous_forward_more"]["value"],
        -36.855,
        0.03,
    );
    let offset = &d["base_parameters"]["offset"];
    let [value, std] = ["value", "std"].map(|k| offset[k].as_f64().unwrap());
    assert!((value + 0.242).abs() < 3.0 * std, "{offset}");
    at_most(&fitted["stages"][0]["errors"]["force_percent"], 4.13);
    at_most(&fitted["after"]["force_percent"], 3.2);
    let closed = &pulses["after"]["closed_loop"];
    at_most(&closed["position_percent"], 0.00802);
    at_most(&closed["velocity_percent"], 0.4789);
    at_most(&closed["force_percent"], 8.941);
    at_most(&pulses["stages"][0]["errors"]["open_loop_position_rms"], 8.3e-3);
}

/// README of the data: dry friction of 1.55 to 1.61 N m on axis 1, friction and gravity on axis 3, second encoders that are 3 ms late. Nothing but friction
/// is known of axes 2 and 4 to 6.
#[test]
fn the_friction_of_a_robot() {
    let Some(d) = diagnosis("robot-axis") else {
        return;
    };
    let effects = d["effects"].as_array().unwrap();
    let of = |channel: &str| {
        let of = effects.iter().filter(|e| e["channel"] == channel);
        of.map(|e| e["effect"].as_str().unwrap()).collect::<Vec<_>>()
    };
    for i in [1, 4, 5, 6] {
        assert_eq!(of(&format!("torque_{i}")), ["coulomb-friction"], "{i}");
        // An encoder that is late has no other scale.
        assert_eq!(
            of(&format!("pos_se_{i}")),
            if i == 1 { &["sensor-skew"][..] } else { &[] }
        );
    }
    // The arm hangs from its second axis.
    assert_eq!(of("torque_2"), ["coulomb-friction", "gravity"]);
    assert_eq!(of("torque_3"), ["coulomb-friction", "position-force"]);
    let parameter = |effect: &str, channel: &str, name: &str| {
        let mut of = effects
            .iter()
            .filter(|e| e["effect"] == effect && e["channel"] == channel);
        number(of.next().unwrap(), &format!("/parameters/{name}/value"))
    };
    let level = parameter("coulomb-friction", "torque_1", "level");
    assert!((1.5..1.7).contains(&level), "{level}");
    for i in 1..=3 {
        let time = parameter("sensor-skew", &format!("pos_se_{i}"), "time");
        assert!((time - 3e-3).abs() < 0.3e-3, "{i}: {time}");
    }
    let held_out = &d["records"][0];
    assert_eq!(held_out["record"], "C");
    for (axis, most) in [("torque_1", 16.0), ("torque_2", 19.0), ("torque_3", 11.6)] {
        let left = number(held_out, &format!("/force/{axis}/after_percent"));
        assert!(left <= most, "{axis}: {left}");
    }
}

#[test]
fn a_machine_of_several_axes_needs_its_controller() {
    let Some(folder) = shared("cd-player-arm") else {
        return;
    };
    let desk = Desk::new();
    let words: [&OsStr; 4] = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "found".as_ref(),
    ];
    let out = desk.program(&words).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("[controller]"));
    assert!(!desk.path("found").exists());
}

#[test]
fn a_motor_with_a_load_on_a_shaft() {
    let Some(found) = diagnosis("two-mass-bench") else {
        return;
    };
    let steps = found["responses"].as_array().unwrap();
    let error = |step: usize, output: &str| 100.0 * steps[step]["fitted"][output].as_f64().unwrap();
    for (step, bars) in [[57.1, 55.5], [12.2, 11.4], [9.97, 8.98]].iter().enumerate() {
        for (output, bar) in ["theta_mx", "theta_my"].iter().zip(bars) {
            assert!(
                error(step, output) <= *bar,
                "{step} {output}: {}",
                error(step, output)
            );
        }
    }
    let effects: Vec<&str> = found["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["effect"].as_str().unwrap())
        .collect();
    assert_eq!(effects, ["extra-mode", "delay"]);
    let delay = found["effects"][1]["parameters"]["time"]["value"]
        .as_f64()
        .unwrap();
    assert!((5e-5..3.5e-4).contains(&delay), "{delay}");
    let reasons = found["reasons"].to_string();
    assert!(
        reasons.contains("nonlinear distortion") && reasons.contains("not told apart"),
        "{reasons}"
    );
}

/// What was traced on responses is validated on them, with the error that the diagnosis states.
#[test]
fn a_model_with_effects_on_responses_is_validated() {
    let Some(folder) = shared("two-mass-bench") else {
        return;
    };
    let desk = Desk::new();
    let run = |words: &[&OsStr]| stdout_of("lpv", &desk.program(words).output().unwrap());
    let words = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "found".as_ref(),
    ];
    run(&words);
    let words = [
        "validate".as_ref(),
        "found/model.json".as_ref(),
        folder.as_ref(),
        "--json".as_ref(),
    ];
    let checked: serde_json::Value = serde_json::from_str(&run(&words)).unwrap();
    let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    let last = found["responses"].as_array().unwrap().last().unwrap();
    for (i, output) in ["theta_mx", "theta_my"].iter().enumerate() {
        let told = 100.0 * last["held_out"][output].as_f64().unwrap();
        let error = checked["frozen"]["relative_rms_percent"][i].as_f64().unwrap();
        assert!((error / told - 1.0).abs() < 1e-3, "{output}: {error} {told}");
    }
    assert!(checked["notes"].to_string().contains("with its effects"));
    // It is no base to start from.
    let words: [&OsStr; 6] = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "--model".as_ref(),
        "found/model.json".as_ref(),
        "-o".as_ref(),
        "other".as_ref(),
    ];
    let out = desk.program(&words).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("leave out --model"));
}

/// The model of a machine as it was, given to the diagnosis of the machine as it became: the effect is found without any
/// first principles, kept in the model file, and simulated and exported from there.
#[test]
fn a_model_of_a_file_is_the_base() {
    let desk = Desk::new();
    desk.done("simulate -o before");
    desk.done("simulate --hide abbe-offset -o after");
    desk.done("identify before -o machine.json");
    let said = desk.done("diagnose after --model machine.json -o found");
    assert!(said.contains("abbe-offset at y1"), "{said}");
    let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    assert!(
        found["base_model"]
            .as_str()
            .unwrap()
            .contains("LFR with 8 states")
    );
    let offset = number(&found, "/effects/0/parameters/offset/value");
    let std = number(&found, "/effects/0/parameters/offset/std");
    assert!((offset - 1e-3).abs() < 3.0 * std && std < 1e-5, "{offset} {std}");
    // Before: the sensor of y1 sees the rotation. The linear part alone is as bad as the model that was given.
    let errors = |line: &str| {
        let checked = desk.json(line);
        let record = &checked["records"][0]["outputs"][0];
        ["closed_loop", "one_step"].map(|kind| record[kind]["over_noise"].as_f64().unwrap())
    };
    let [given, given_one] = errors("validate machine.json after --json");
    let [explained, explained_one] = errors("validate found/model.json after --json");
    assert!(given > 20.0 && explained < 1.5, "{given} {explained}");
    assert!(
        explained_one < 1.5 && given_one > 1.5 * explained_one,
        "{given_one} {explained_one}"
    );
    desk.done("convert found/model.json --to python -o found/model.py");
    let python = desk.text("found/model.py");
    assert!(python.contains("effect1_abbe_offset_offset = np.array([[0.00"));
    assert!(python.contains("base_gain_of_the_first_input"));
    // A delay of a sensor, and a time below zero, which only a hand can write.
    let mut file: serde_json::Value = serde_json::from_str(&desk.text("found/model.json")).unwrap();
    let effect = &mut file["explanation"]["effects"][0];
    effect["effect"] = "delay".into();
    effect["parameters"] = serde_json::json!({"time": {"value": -0.01, "unit": "s"}});
    std::fs::write(desk.path("wrong.json"), file.to_string()).unwrap();
    let said = desk.refused("validate wrong.json after");
    assert!(said.contains("at a channel at which"), "{said}");
    file["explanation"]["effects"][0]["channel"] = "u1".into();
    std::fs::write(desk.path("wrong.json"), file.to_string()).unwrap();
    let said = desk.refused("validate wrong.json after");
    assert!(said.contains("out of its range"), "{said}");
    // A mass, which only the table has.
    let effect = &mut file["explanation"]["effects"][0];
    effect["effect"] = "payload".into();
    effect["parameters"] = serde_json::json!({"mass": {"value": 1.0, "unit": "kg"}, "inertia": {"value": 0.1, "unit": "kg m^2"}});
    std::fs::write(desk.path("wrong.json"), file.to_string()).unwrap();
    let said = desk.refused("validate wrong.json after");
    assert!(said.contains("its base does not have"), "{said}");
    // What is looked for anew is found again.
    let again = desk.done("diagnose after --model found/model.json -o again");
    assert!(
        again.contains("abbe-offset at y1") && again.contains("looked for anew"),
        "{again}"
    );
}

/// Masses, couplings and lever arm of the table, against those of the machine file.
#[test]
fn first_principles_from_responses() {
    let desk = Desk::new();
    desk.done("simulate -o bundle");
    desk.done("identify bundle --structure xy-table -o table.json");
    let file: serde_json::Value = serde_json::from_str(&desk.text("table.json")).unwrap();
    let parameters = &file["explanation"]["base_parameters"];
    for (name, truth) in [
        ("carriage mass", 12.0),
        ("beam mass", 20.0),
        ("inertia of carriage and beam", 1.45),
        ("inertia of the carriage over that of the beam", 0.25 / 1.2),
        ("stiffness, translation", 622.525),
        ("stiffness, rotation", 32.6718),
        ("damping, translation", 2.04989),
    ] {
        let value = parameters[name]["value"].as_f64().unwrap();
        let std = parameters[name]["std"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 1e-3, "{name} {value}");
        assert!(std > 0.0 && std < 1e-2 * truth, "{name} {std}");
    }
    let checked = desk.json("validate table.json bundle --json");
    for output in checked["records"][0]["outputs"].as_array().unwrap() {
        let over = output["closed_loop"]["over_noise"].as_f64().unwrap();
        assert!(over < 1.5, "{over}");
    }
    let said = desk.done("diagnose bundle --model table.json -o found");
    assert!(said.contains("nothing is missing"), "{said}");
}

#[test]
fn a_table_without_geometry_and_a_file_for_a_folder_are_refused() {
    let desk = Desk::new();
    desk.done("simulate -o bundle");
    let text = desk.text("bundle/experiment.toml");
    let (before, rest) = text.split_once("[geometry]").unwrap();
    let (_, after) = rest.split_once("\n[").unwrap();
    desk.write("bundle/experiment.toml", format!("{before}[{after}"));
    let out = desk.lpv("identify bundle --structure xy-table -o table.json");
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("[geometry]"));
    desk.write("taken", "a file");
    let out = desk.lpv("diagnose bundle -o taken");
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("folder"));
    assert_eq!(desk.text("taken"), "a file");
    let said = desk.refused("diagnose bundle -o taken/inside");
    assert!(said.contains("taken/inside"), "{said}");
    // A model of one axis, for a machine with two.
    let axis = RigidBodyAxis {
        inertia: 10.0,
        viscous: 1.0,
        offset: 0.0,
        inertia_deviation: 0.1,
        viscous_deviation: 0.1,
        offset_deviation: 0.1,
        output: lpv_core::AxisOutput::Position,
    };
    desk.write_model(
        "axis.json",
        &Model::RigidBody(RigidBody::new(vec![axis]).unwrap()),
    );
    let said = desk.refused("diagnose bundle --model axis.json -o other");
    assert!(said.contains("1 input and 1 output"), "{said}");
    assert!(!desk.path("other").exists());
    // Without a geometry the small LFR of the bundle is the base.
    let said = desk.done("diagnose bundle -o found");
    assert!(said.contains("nothing is missing"), "{said}");
    let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    assert!(found["base_model"].as_str().unwrap().contains("LFR"));
}

/// An axis whose friction is larger than its inertial force: without friction no inertia explains its records one by one.
#[test]
fn friction_above_the_inertial_force() {
    /// Ten kilograms and two newtons of friction under a controller with a difference, integrated in small steps.
    fn record(rate: f64, seed: u64) -> String {
        const T: f64 = 0.01;
        const STEPS: usize = 400;
        let mut noise = Noise(seed);
        let (mut x, mut v, mut before) = (0.0_f64, 0.0_f64, 0.0);
        let [mut r, mut u, mut y] = [(); 3].map(|()| Vec::new());
        for k in 0..1500 {
            let t = k as f64 * T;
            r.push(0.05 * (1.0 - (rate * t).cos()) * (1.0 + 0.3 * (0.37 * rate * t).sin()));
            y.push(x + 1e-5 * noise.sample());
            let error = r[k] - y[k];
            u.push(3000.0 * error - 2900.0 * before);
            before = error;
            for _ in 0..STEPS {
                v += T / STEPS as f64 * (u[k] - 2.0 * (v / 1e-3).tanh()) / 10.0;
                x += T / STEPS as f64 * v;
            }
        }
        csv(&[("r", &r), ("u", &u), ("y", &y)])
    }
    let desk = Desk::new();
    let mut toml = String::from(
        "format = 1\nname = \"axis\"\nsample_rate = 100.0\n\
         [controller]\nreference_numerator = [3000.0, -2900.0]\nfeedback_numerator = [3000.0, -2900.0]\ndenominator = [1.0]\n",
    );
    for (group, name, unit) in [("output", "y", "m"), ("input", "u", "N"), ("reference", "r", "m")] {
        toml += &format!("[channels.{group}]\ncolumns = [\"{name}\"]\nunits = [\"{unit}\"]\n");
    }
    for (file, rate, purpose) in [
        ("a", 0.7, "estimation"),
        ("b", 1.9, "estimation"),
        ("c", 1.3, "validation"),
    ] {
        desk.write(
            &format!("axis/{file}.csv"),
            record(rate, file.as_bytes()[0].into()),
        );
        toml += &entry(&format!("{file}.csv"), None, purpose);
    }
    desk.write("axis/experiment.toml", toml);
    let said = desk.done("diagnose axis -o found");
    assert!(said.contains("axis: explained: coulomb-friction at u"), "{said}");
    let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    let level = number(&found, "/effects/0/parameters/level/value");
    assert!((level - 2.0).abs() < 1e-2, "{level}");
    // Nothing to fit, a record too short to compare, and no model: each is said.
    let whole = desk.text("axis/experiment.toml");
    desk.write(
        "axis/experiment.toml",
        whole.replace("\"estimation\"", "\"validation\""),
    );
    let said = desk.refused("diagnose axis -o other");
    assert!(said.contains("at least one to fit"), "{said}");
    desk.write("axis/experiment.toml", &whole);
    let short: String = desk
        .text("axis/c.csv")
        .lines()
        .take(20)
        .map(|l| format!("{l}\n"))
        .collect();
    desk.write("axis/c.csv", short);
    let said = desk.refused("diagnose axis -o other");
    assert!(said.contains("record c: it has 19 samples"), "{said}");
    let said = desk.refused("diagnose axis --model none.json -o other");
    assert!(said.contains("none.json: cannot be read"), "{said}");
}

/// A mass on a guide with friction that holds it at rest, or on a spring, in small steps: readings and forces by sample.
struct Guide {
    mass: f64,
    viscous: f64,
    coulomb: f64,
    spring: [f64; 2],
    step: f64,
}

impl Guide {
    fn run(&self, samples: usize, noise: &[f64], mut force: impl FnMut(usize, f64) -> f64) -> String {
        const PARTS: usize = 20;
        let dt = self.step / PARTS as f64;
        let (mut q, mut v) = (0.0_f64, 0.0_f64);
        let (mut y, mut u) = (Vec::new(), Vec::new());
        for k in 0..samples {
            y.push(q + noise[k]);
            u.push(force(k, y[k]));
            for _ in 0..PARTS {
                let spring = q * (self.spring[0] + self.spring[1] * q * q);
                let next = v + dt * (u[k] - self.viscous * v - spring) / self.mass;
                let brake = dt * self.coulomb / self.mass;
                v = next - next.clamp(-brake, brake);
                q += dt * v;
            }
        }
        csv(&[("y", &y), ("u", &u)])
    }
}

/// Positions and forces alone, of two machines a thousand times apart: the controller moved them, and nobody wrote it down.
#[test]
fn friction_is_found_without_the_controller() {
    for (mass, step) in [(2e-2, 1e-3), (2e1, 1e-2)] {
        let desk = Desk::new();
        let reach = 0.2;
        let peak = mass * 5.8 * reach / (200.0_f64 * step).powi(2);
        let guide = Guide {
            mass,
            viscous: 0.02 * mass / step / 100.0,
            coulomb: 0.3 * peak,
            spring: [0.0; 2],
            step,
        };
        let mut description = head(1.0 / step);
        for (seed, (file, purpose)) in [("a.csv", "estimation"), ("b.csv", "validation")]
            .into_iter()
            .enumerate()
        {
            let turn = 1.0 - 2.0 * seed as f64;
            let path = |k: usize| {
                let [t, wave] = [k as f64 / 200.0, 0.5 + 0.1 * seed as f64];
                reach * turn * ((TAU * wave * t).sin() + 0.3 * (TAU * 0.31 * t).sin())
            };
            let w = 0.005 * TAU / step;
            let mut last = 0.0;
            let noise = Noise(seed as u64 + 1).samples(4000, 1e-5 * reach);
            let record = guide.run(4000, &noise, |k, y| {
                let e = path(k) - y;
                let rate = (e - last) / step;
                last = e;
                mass * (w * w * e + 1.4 * w * rate)
            });
            desk.write(file, record);
            description += &entry(file, None, purpose);
        }
        desk.write("experiment.toml", description);
        desk.done("diagnose . -o found");
        let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
        assert_eq!(found["error_of"], "observer");
        let effect = &found["effects"][0];
        assert_eq!(
            effect["effect"], "coulomb-friction",
            "{mass}: {}",
            found["verdict_in_words"]
        );
        let level = effect["parameters"]["level"]["value"].as_f64().unwrap();
        assert!(
            (level / guide.coulomb - 1.0).abs() < 0.1,
            "{mass}: {level} for {}",
            guide.coulomb
        );
        let fitted = found["base_parameters"]["mass"]["value"].as_f64().unwrap();
        assert!((fitted / mass - 1.0).abs() < 0.05, "{fitted} for {mass}");
        if mass < 1.0 {
            by_one_record(&desk, step, guide.coulomb);
            beside_its_speed(&desk, step, &found);
        }
    }
}

/// All that there is may be one record, of which nothing is held out.
fn by_one_record(desk: &Desk, step: f64, level: f64) {
    let whole = desk.text("experiment.toml");
    desk.write(
        "experiment.toml",
        head(1.0 / step) + &entry("a.csv", None, "estimation"),
    );
    let found = desk.json("diagnose . -o one --json");
    let first = &found["effects"][0];
    assert_eq!(
        first["effect"], "coulomb-friction",
        "{}",
        found["verdict_in_words"]
    );
    let value = first["parameters"]["level"]["value"].as_f64().unwrap();
    assert!((value / level - 1.0).abs() < 0.1, "{value} for {level}");
    let reasons = found["reasons"].to_string();
    assert!(reasons.contains("the last third of a judges"), "{reasons}");
    desk.write("experiment.toml", whole);
}

/// A drive logs the speed beside the position: the same is found, by the position.
fn beside_its_speed(desk: &Desk, step: f64, found: &serde_json::Value) {
    for file in ["a.csv", "b.csv"] {
        let (mut last, mut text) = (0.0, String::from("y,u,v\n"));
        for line in desk.text(file).lines().skip(1) {
            let y: f64 = line.split(',').next().unwrap().parse().unwrap();
            text += &format!("{line},{:e}\n", (y - last) / step);
            last = y;
        }
        desk.write(file, text);
    }
    let description = desk.text("experiment.toml").replace(
        "columns = [\"y\"]",
        "columns = [\"v\", \"y\"]\nunits = [\"m/s\", \"m\"]",
    );
    desk.write("experiment.toml", description);
    let again = desk.json("diagnose . -o again --json");
    assert_eq!(
        again["effects"][0]["parameters"]["level"]["value"],
        found["effects"][0]["parameters"]["level"]["value"]
    );
    let reasons = again["reasons"].to_string();
    assert!(reasons.contains("left aside: `v` (speed)"), "{reasons}");
}

/// A mass on a spring that hardens, shaken without a loop.
#[test]
fn a_spring_to_ground_is_the_base_and_its_hardening_an_effect() {
    for (mass, step, scale) in [(3e-4, 1e-4, 1e-5), (0.3, 1e-3, 5e-3), (3e2, 1e-2, 2.0)] {
        let desk = Desk::new();
        let stiffness = mass * (TAU * 0.06 / step).powi(2);
        let guide = Guide {
            mass,
            viscous: 0.1 * (mass * stiffness).sqrt(),
            coulomb: 0.0,
            spring: [stiffness, 0.3 * stiffness / (scale * scale)],
            step,
        };
        let mut description = head(1.0 / step);
        for (seed, (file, purpose)) in [("a.csv", "estimation"), ("b.csv", "validation")]
            .into_iter()
            .enumerate()
        {
            let mut random = Noise(seed as u64 + 7);
            let mut force = 0.0;
            let noise = random.samples(1500, 1e-4 * scale);
            let record = guide.run(1500, &noise, |_, _| {
                force = 0.7 * force + random.sample();
                0.35 * stiffness * scale * force
            });
            desk.write(file, record);
            description += &entry(file, None, purpose);
        }
        desk.write("experiment.toml", description);
        desk.done("diagnose . -o found");
        let found: serde_json::Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
        assert_eq!(found["base_model"], "axis on a spring to ground");
        assert_eq!(
            found["effects"][0]["effect"], "cubic-stiffness",
            "{}",
            found["verdict_in_words"]
        );
        let cube = found["effects"][0]["parameters"]["cube"]["value"]
            .as_f64()
            .unwrap();
        assert!(
            (cube / guide.spring[1] - 1.0).abs() < 0.1,
            "{cube} for {}",
            guide.spring[1]
        );
        // The page shows the force that was missing, then the run without an observer.
        let page = desk.text("found/diagnosis.html");
        let [force, run] = ["The force that would explain the error", "Let run free"].map(|h| page.find(h));
        assert!(force.is_some() && force < run);
        // Its model is a base too.
        let again = desk.json("diagnose . --model found/model.json -o again --json");
        assert_eq!(again["base_model"], found["base_model"]);
        assert_eq!(again["effects"][0]["effect"], "cubic-stiffness");
        // What held it at its records is no part of the file.
        let said = desk.done("validate found/model.json .");
        assert!(
            said.starts_with("not judged: the bundle has no [controller]"),
            "{said}"
        );
    }
}
