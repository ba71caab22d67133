//! `lpv identify` from records without periods: prediction error, and servo axes.

use crate::common::{Desk, Noise, csv, entry, head, mode, number, response, stdout_of};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Model, RigidBody, RigidBodyAxis, StateSpace};

/// A transient record of the mode that white noise drives, with noise of this deviation on its output.
fn bundle(desk: &Desk, noise: f64) {
    let mut random = Noise(21);
    let u = random.samples(1500, 1.0);
    let y: Vec<f64> = response(&mode(), &u)
        .into_iter()
        .map(|y| y + noise * random.sample())
        .collect();
    desk.write("bundle/run.csv", csv(&[("u", &u), ("y", &y)]));
    desk.write(
        "bundle/experiment.toml",
        head(10.0) + &entry("run.csv", None, "estimation"),
    );
}

#[test]
fn a_transient_record_gives_the_poles_of_its_system() {
    let desk = Desk::new();
    bundle(&desk, 0.02);
    let summary = desk.json("identify bundle -o model.json --hold-out 0.3 --json");
    let Model::InnovationStateSpace(found) = desk.model("model.json") else {
        panic!("a transient record is fitted by its prediction error");
    };
    let poles = found.model().poles().unwrap();
    for truth in [Complex::new(0.9, 0.3), Complex::new(0.9, -0.3)] {
        let nearest = poles
            .iter()
            .map(|z| (z - truth).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-3, "{poles:?}");
    }
    assert_eq!(number(&summary, "/time/held_out/samples"), 450.0);
    assert!(
        number(&summary, "/time/held_out/simulated_fit_percent/0") > 99.0,
        "{summary:#}"
    );
    // Damping and frequency of the poles, in words of the field.
    desk.write("order.toml", "order = 2\n");
    let summary = desk.json("identify bundle -o model.json --config order.toml --json");
    assert_eq!(summary["time"]["modes"].as_array().unwrap().len(), 1);
    let s = Complex::new(0.9, 0.3).ln() * 10.0;
    assert!((number(&summary, "/time/modes/0/0") - s.norm() / std::f64::consts::TAU).abs() < 1e-3);
    assert!((number(&summary, "/time/modes/0/1") + s.re / s.norm()).abs() < 5e-3);
}

#[test]
fn the_threads_change_no_bit_of_a_fit_in_time() {
    let desk = Desk::new();
    bundle(&desk, 0.02);
    for threads in ["1", "2"] {
        let output = format!("{threads}.json");
        let out = desk
            .program(&["identify", "bundle", "-o", &output])
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        stdout_of("identify", &out);
    }
    assert!(desk.bytes("1.json") == desk.bytes("2.json"));
}

const AXIS: RigidBodyAxis = RigidBodyAxis {
    inertia: 3.0,
    viscous: 8.0,
    offset: -1.5,
    inertia_deviation: 0.0,
    viscous_deviation: 0.0,
    offset_deviation: 0.0,
    output: lpv_core::AxisOutput::Position,
};

/// A mass that a servo moves back and forth, at 1000 samples a unit of time.
fn servo(desk: &Desk) {
    let clock = Discrete::from_rate(1000.0).unwrap();
    let continuous = RigidBody::new(vec![AXIS]).unwrap().to_state_space().unwrap();
    let mass: StateSpace<Discrete> = continuous.zero_order_hold(clock).unwrap();
    let (a, b) = (mass.a(), mass.b());
    let mut random = Noise(4);
    let (mut q, mut v, mut force) = (0.0, 0.0, 0.0);
    let (mut forces, mut positions, mut references) = (Vec::new(), Vec::new(), Vec::new());
    for n in 0..8000 {
        let t = f64::from(n) * clock.sample_time();
        let target = 0.1 * (4.0 * t).sin() + 0.05 * (13.0 * t).sin();
        let measured = q + 1e-6 * random.sample();
        positions.push(measured);
        references.push(target);
        forces.push(force);
        let u: f64 = force - AXIS.offset;
        (q, v) = (
            a[(0, 0)] * q + a[(0, 1)] * v + b[(0, 0)] * u,
            a[(1, 0)] * q + a[(1, 1)] * v + b[(1, 0)] * u,
        );
        force = 2000.0 * (target - measured) - 60.0 * v + 0.05 * random.sample();
    }
    desk.write(
        "bundle/run.csv",
        csv(&[("u", &forces), ("y", &positions), ("r", &references)]),
    );
    let toml = head(1000.0).replace("[\"y\"]", "[\"y\"]\nunits = [\"m\"]")
        + "[channels.reference]\ncolumns = [\"r\"]\n"
        + &entry("run.csv", None, "estimation");
    desk.write("bundle/experiment.toml", toml);
}

#[test]
fn a_servo_axis_gives_its_mass_friction_and_offset() {
    let desk = Desk::new();
    servo(&desk);
    let summary = desk.json("identify bundle --structure rigid-body -o model.json --json");
    let axis = &summary["axes"][0];
    assert_eq!(axis["kind"], "mass");
    for (name, truth) in [
        ("inertia", AXIS.inertia),
        ("viscous", AXIS.viscous),
        ("offset", AXIS.offset),
    ] {
        let (value, deviation) = (
            number(axis, &format!("/{name}/0")),
            number(axis, &format!("/{name}/1")),
        );
        assert!(
            (value - truth).abs() < 3.0 * deviation,
            "{name}: {value} +- {deviation}"
        );
        assert!(deviation < 0.02 * truth.abs(), "{name}: {deviation}");
    }
    let Model::RigidBody(body) = desk.model("model.json") else {
        panic!("servo axes are a rigid body");
    };
    assert_eq!(body.axes()[0].inertia, number(axis, "/inertia/0"));
    let text = desk.done("identify bundle --structure rigid-body -o model.json");
    assert!(
        text.contains("mass 3.00000 u s^2/m (") && text.contains("viscous friction 8.00000 u s/m ("),
        "{text}"
    );
    let check = desk.json("validate model.json bundle --json");
    assert!(
        number(&check, "/records/0/axes/0/force_percent") < 5.0,
        "{:#}",
        check["records"][0]["axes"]
    );
}

/// Axes whose output is a speed, of any inertia and friction: the mass under held forces has a formula, and the model is that of the
/// speed.
#[test]
fn an_axis_whose_output_is_a_speed_is_taken_as_one() {
    let mut random = Noise(31);
    for case in 0..8 {
        let decade = f64::from(case) - 4.0;
        let truth = RigidBodyAxis {
            inertia: 2.0 * 10f64.powf(decade),
            viscous: 5.0 * 10f64.powf(decade),
            offset: -0.3,
            ..AXIS
        };
        let rate = [200.0, 1000.0][case as usize % 2];
        // A force of low frequencies, about the offset.
        let mut low = 0.0;
        let u: Vec<f64> = (0..6000)
            .map(|_| {
                low += 0.1 * (random.sample() - low);
                truth.offset + 10.0 * low
            })
            .collect();
        let decay = (-truth.viscous / truth.inertia / rate).exp();
        let mut v = 0.0;
        let mut y: Vec<f64> = u
            .iter()
            .map(|u| {
                let before = v;
                v = decay * v + (1.0 - decay) * (u - truth.offset) / truth.viscous;
                before
            })
            .collect();
        let size = (y.iter().map(|v| v * v).sum::<f64>() / y.len() as f64).sqrt();
        y.iter_mut().for_each(|y| *y += 1e-3 * size * random.sample());
        let desk = Desk::new();
        desk.write("b/run.csv", csv(&[("u", &u), ("y", &y)]));
        let said = [("1", "units = [\"rad/s\"]"), ("2", "quantity = [\"speed\"]")][case as usize / 2 % 2];
        let toml = head(rate)
            .replace("format = 1", &format!("format = {}", said.0))
            .replace("[channels.input]", &format!("{}\n[channels.input]", said.1));
        desk.write("b/experiment.toml", toml + &entry("run.csv", None, "estimation"));
        let summary = desk.json("identify b --structure rigid-body -o model.json --json");
        let Model::RigidBody(body) = desk.model("model.json") else {
            panic!("a rigid body was asked for");
        };
        let found = body.axes()[0];
        assert_eq!(found.output, lpv_core::AxisOutput::Speed);
        assert_eq!(summary["axes"][0]["output_is"], "speed");
        for (value, deviation, truth, slack) in [
            (found.inertia, found.inertia_deviation, truth.inertia, 0.02),
            (found.viscous, found.viscous_deviation, truth.viscous, 0.05),
            (found.offset, found.offset_deviation, truth.offset, 0.2),
        ] {
            let off = (value - truth).abs();
            assert!(off < slack * truth.abs(), "{case}: {value} {truth} {summary:#}");
            assert!(
                off < 6.0 * deviation.max(1e-3 * truth.abs()),
                "{case}: {value} +- {deviation}, {truth}"
            );
        }
        assert_eq!(body.to_state_space().unwrap().states(), 1);
        let checks = desk.json("validate model.json b --json");
        assert!(
            number(&checks, "/records/0/outputs/0/open_loop/fit_percent") > 95.0,
            "{checks:#}"
        );
        assert!(
            number(&checks, "/records/0/axes/0/force_percent") < 15.0,
            "{checks:#}"
        );
        let refused = desk.refused("diagnose b -o d");
        assert!(
            refused.contains("output `y` is a speed by its `quantity` or unit"),
            "{refused}"
        );
    }
}
