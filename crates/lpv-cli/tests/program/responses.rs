//! Measured frequency responses as records: machines are drawn, their responses written by their formula, and identified.

use crate::common::{Desk, Noise, number};
use lpv_core::num_complex::Complex;
use lpv_core::{Frf, Model};
use std::f64::consts::TAU;
use std::fmt::Write as _;

type C64 = Complex<f64>;

/// A flexible mode: what it adds to `1 / s^2`, Hz, damping.
#[derive(Debug, Clone, Copy)]
struct Mode {
    part: f64,
    hz: f64,
    damping: f64,
}

/// A free mass with modes, force to displacement.
#[derive(Debug, Clone)]
struct Machine {
    mass: f64,
    modes: Vec<Mode>,
}

impl Machine {
    fn draw(random: &mut Noise, modes: usize) -> Self {
        let mut uniform = |low: f64, high: f64| {
            // Of normal numbers, one between 0 and 1.
            let x = random.sample().abs().fract();
            low + (high - low) * x
        };
        let first = uniform(10.0, 20.0);
        Self {
            mass: 10f64.powf(uniform(-2.0, 2.0)),
            modes: (0..modes)
                .map(|k| Mode {
                    part: uniform(0.3, 1.0) * if k % 2 == 0 { 1.0 } else { -0.5 },
                    hz: first * 2.3f64.powi(k as i32),
                    damping: uniform(0.005, 0.03),
                })
                .collect(),
        }
    }

    fn displacement(&self, f: f64) -> C64 {
        let s = C64::new(0.0, TAU * f);
        let modes = self.modes.iter().map(|m| {
            let w = TAU * m.hz;
            m.part / (s * s + s * (2.0 * m.damping * w) + w * w)
        });
        (1.0 / (s * s) + modes.sum::<C64>()) / self.mass
    }

    /// The exact response of its samples under a force that is held: of each mode, by its own formula.
    fn sampled(&self, f: f64, rate: f64) -> C64 {
        let t = 1.0 / rate;
        let z = C64::from_polar(1.0, TAU * f * t);
        let rigid = t * t / 2.0 * (z + 1.0) / ((z - 1.0) * (z - 1.0));
        let modes = self.modes.iter().map(|m| {
            let w = TAU * m.hz;
            // part / (w^2 + ..) = residue / (s - pole) and its conjugate.
            let pole = C64::new(-m.damping * w, w * (1.0 - m.damping * m.damping).sqrt());
            let residue = m.part / C64::new(0.0, 2.0 * pole.im);
            let one = |p: C64, r: C64| r / p * ((p * t).exp() - 1.0) / (z - (p * t).exp());
            one(pole, residue) + one(pole.conj(), residue.conj())
        });
        (rigid + modes.sum::<C64>()) / self.mass
    }
}

fn lines(highest: f64) -> Vec<f64> {
    (0..240)
        .map(|k| highest * 10f64.powf(-2.3 * (1.0 - f64::from(k) / 239.0)))
        .collect()
}

/// A table of a response: noise of this relative deviation, and its variance if it is stated.
fn table(lines: &[f64], value: impl Fn(f64) -> C64, noise: f64, stated: bool, random: &mut Noise) -> String {
    let mut text = "frequency,y/u re,y/u im".to_owned() + if stated { ",y/u variance\n" } else { "\n" };
    for f in lines {
        let own = value(*f);
        let error = C64::new(random.sample(), random.sample()) * (noise / 2f64.sqrt());
        let v = own * (1.0 + error);
        let _ = write!(text, "{f:e},{:e},{:e}", v.re, v.im);
        if stated {
            let _ = write!(text, ",{:e}", (noise * own.norm()).powi(2));
        }
        text += "\n";
    }
    text
}

fn head(rate: f64, output: &str) -> String {
    format!(
        "format = 2\nname = \"analyser\"\nsample_rate = {rate:?}\n[channels.output]\ncolumns = [\"y\"]\n{output}\n\
         [channels.input]\ncolumns = [\"u\"]\nunits = [\"N\"]\n"
    )
}

fn entry(file: &str, more: &str) -> String {
    format!("[[records]]\nfile = \"{file}\"\nkind = \"response\"\nuse = \"estimation\"\n{more}\n")
}

fn discrete(model: &Model, lines: &[f64]) -> Frf {
    let Model::DiscreteStateSpace(model) = model else {
        panic!("one position gives a state space");
    };
    model.frequency_response(lines).unwrap()
}

/// Whatever derivative of the displacement was measured, and whether its error is stated or not: the modes of the machine, and the
/// response of its samples.
#[test]
fn a_drawn_machine_is_found_from_its_accelerance_mobility_or_receptance() {
    let mut random = Noise(3);
    let highest = 200.0;
    let rate = 20.0 * highest;
    let lines = lines(highest);
    for case in 0..12 {
        let machine = Machine::draw(&mut random, 1 + case % 3);
        let (power, quantity) = [
            (0, "displacement/force"),
            (1, "mobility"),
            (2, "acceleration/force"),
        ][case / 3 % 3];
        let noise = [1e-3, 1e-2][case % 2];
        let stated = case % 4 < 2;
        let desk = Desk::new();
        let value = |f: f64| machine.displacement(f) * C64::new(0.0, TAU * f).powi(power);
        desk.write("b/a.csv", table(&lines, value, noise, stated, &mut random));
        let toml = head(rate, "units = [\"m\"]") + &entry("a.csv", &format!("quantity = \"{quantity}\""));
        desk.write("b/experiment.toml", toml);
        let summary = desk.json("identify b -o m.json --json");
        let what = format!("{case}: {machine:?}, {quantity}, {noise}, {stated}: {summary:#}");
        for mode in &machine.modes {
            let found = summary["modes"].as_array().unwrap().iter();
            let near = found
                .map(|m| (m[0].as_f64().unwrap(), m[1].as_f64().unwrap()))
                .min_by(|a, b| (a.0 - mode.hz).abs().total_cmp(&(b.0 - mode.hz).abs()))
                .unwrap();
            let slack = mode.damping.max(noise);
            assert!((near.0 / mode.hz - 1.0).abs() < slack, "{mode:?} {near:?} {what}");
            assert!(
                (near.1 / mode.damping - 1.0).abs() < 0.2,
                "{mode:?} {near:?} {what}"
            );
        }
        let found = discrete(&desk.model("m.json"), &lines);
        let mut off: Vec<f64> = lines
            .iter()
            .enumerate()
            .map(|(k, f)| (found.line(k)[(0, 0)] / machine.sampled(*f, rate) - 1.0).norm())
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(
            off[lines.len() / 2] < noise.max(1e-3),
            "{} {what}",
            off[lines.len() / 2]
        );
        let sentence = summary["verdict"]["sentence"].as_str().unwrap();
        assert_eq!(sentence.contains("times its noise"), stated, "{sentence}");
        assert!(sentence.starts_with("good"), "{what}");
        assert_eq!(summary["error_over_noise"].is_null(), !stated);
        let reasons = summary["reasons"].to_string();
        assert_eq!(reasons.contains("states no variance"), !stated, "{reasons}");
        assert!(!reasons.contains("times the noise") || stated, "{reasons}");
    }
}

/// Samples of an input that is held need no hold: the response of a sampled machine up to near its Nyquist frequency.
#[test]
fn the_response_between_samples_is_taken_as_it_is() {
    let mut random = Noise(8);
    for case in 0..4 {
        let machine = Machine::draw(&mut random, 1 + case % 2);
        let rate = 1000.0;
        let lines: Vec<f64> = (1..240).map(|k| 2.0 * f64::from(k)).collect();
        let desk = Desk::new();
        let value = |f: f64| machine.sampled(f, rate);
        desk.write("b/a.csv", table(&lines, value, 1e-3, true, &mut random));
        let more = ["", "quantity = \"displacement/input\""][case / 2];
        desk.write("b/experiment.toml", head(rate, "") + &entry("a.csv", more));
        desk.done("identify b -o m.json");
        let found = discrete(&desk.model("m.json"), &lines);
        for (k, f) in lines.iter().enumerate() {
            let off = (found.line(k)[(0, 0)] / value(*f) - 1.0).norm();
            assert!(off < 5e-3, "{case}: {f} Hz, {off}");
        }
        // As one over a force, it would be taken for continuous.
        let more = "quantity = \"displacement/force\"";
        desk.write("b/experiment.toml", head(rate, "") + &entry("a.csv", more));
        let refused = desk.refused("identify b -o n.json");
        assert!(refused.contains("asks for sample_rate = 9560 Hz"), "{refused}");
    }
}

/// The error of the model and the measured points stand on a page without positions too.
#[test]
fn the_page_of_one_position_shows_the_measurement() {
    let mut random = Noise(9);
    let machine = Machine::draw(&mut random, 1);
    let lines: Vec<f64> = (1..240).map(|k| 2.0 * f64::from(k)).collect();
    let desk = Desk::new();
    let value = |f: f64| machine.sampled(f, 1000.0);
    desk.write("b/a.csv", table(&lines, value, 1e-3, true, &mut random));
    desk.write("b/experiment.toml", head(1000.0, "") + &entry("a.csv", ""));
    desk.done("identify b -o r/model.json");
    desk.done("report r");
    let page = desk.text("r/report.html");
    assert!(page.contains(">residual<"));
    // Noise and error of the first figure, magnitude, phase; each also for a narrow screen.
    assert_eq!(page.matches("data-t=\"dots\"").count(), 8);
}

/// A mode that moves with p, from five positions: the low-order LFR has its frequency in between.
#[test]
fn responses_of_several_positions_give_an_lfr() {
    let mut random = Noise(5);
    let highest = 100.0;
    let rate = 2000.0;
    let lines = lines(highest);
    let at = |p: f64| Machine {
        mass: 2.0,
        modes: vec![Mode {
            part: 0.6 + 0.2 * p,
            hz: 20.0 * (1.0 + 0.3 * p).sqrt(),
            damping: 0.01,
        }],
    };
    for quantity in ["displacement/force", "acceleration/force"] {
        let desk = Desk::new();
        let mut toml = head(rate, "units = [\"m\"]");
        for (k, p) in [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().enumerate() {
            let machine = at(p);
            let power = if quantity.starts_with('a') { 2 } else { 0 };
            let value = |f: f64| machine.displacement(f) * C64::new(0.0, TAU * f).powi(power);
            let file = format!("{k}.csv");
            desk.write(
                &format!("b/{file}"),
                table(&lines, value, 1e-3, true, &mut random),
            );
            toml += &entry(&file, &format!("position = {p:?}\nquantity = \"{quantity}\""));
        }
        desk.write("b/experiment.toml", &toml);
        let summary = desk.json("identify b -o m.json --json");
        assert_eq!(number(&summary, "/positions"), 5.0, "{summary:#}");
        let sentence = summary["verdict"]["sentence"].as_str().unwrap();
        assert!(sentence.starts_with("good"), "{sentence}");
        let model = desk.model("m.json");
        assert!(matches!(model, Model::ContinuousLfr(_)), "{}", model.describe());
        for p in [-0.75, 0.1, 0.8] {
            let frozen = model.in_states().unwrap().frozen(&[p]).unwrap();
            let poles = frozen.continuous().unwrap().poles().unwrap();
            let wanted = at(p).modes[0].hz;
            let near = poles
                .iter()
                .map(|s| (s.norm() / TAU / wanted - 1.0).abs())
                .fold(1.0, f64::min);
            assert!(near < 5e-3, "{p}: {near} {poles:?}");
        }
        let told = desk.done("inspect b");
        assert!(
            told.contains("5 records at 2000 Hz") && told.contains(quantity),
            "{told}"
        );
        let validated = desk.done("validate m.json b");
        assert!(validated.starts_with("good"), "{validated}");
        // Its speed is a model of one position alone.
        desk.write(
            "b/experiment.toml",
            toml.replace("units = [\"m\"]", "units = [\"m/s\"]"),
        );
        let refused = desk.refused("identify b -o n.json");
        assert!(
            refused.contains("output `y` is a speed, and its response falls as that of a free mass"),
            "{refused}"
        );
        // Two of one place are one too many.
        desk.write(
            "b/experiment.toml",
            toml.replace("position = 0.5\n", "position = 0.0\n"),
        );
        let refused = desk.refused("identify b -o n.json");
        assert!(
            refused.contains("are frequency responses of one place (p = 0)"),
            "{refused}"
        );
    }
}

#[test]
fn what_cannot_be_done_with_responses_is_refused_by_name() {
    let lines = lines(100.0);
    let machine = Machine::draw(&mut Noise(1), 1);
    let desk = Desk::new();
    desk.write(
        "b/a.csv",
        table(&lines, |f| machine.displacement(f), 1e-3, true, &mut Noise(2)),
    );
    let bundle = |rate: f64, output: &str, more: &str| {
        desk.write("b/experiment.toml", head(rate, output) + &entry("a.csv", more));
    };
    let of_force = "quantity = \"displacement/force\"";
    for (rate, output, more, message) in [
        (150.0, "", "", "is not below half of sample_rate = 150 Hz"),
        (
            2000.0,
            "",
            "rows = [1, 9]",
            "it has 9 lines, and a fit needs 10 or more",
        ),
        (1999.0, "", of_force, "which asks for sample_rate = 2000 Hz"),
        (2000.0, "units = [\"N\"]", of_force, "output `y` is a force"),
        (
            2000.0,
            "quantity = [\"other\"]",
            of_force,
            "output `y` is something other",
        ),
        (
            2000.0,
            "units = [\"m/s^2\"]",
            of_force,
            "which follows a held force without delay",
        ),
    ] {
        bundle(rate, output, more);
        for command in ["identify b -o m.json", "inspect b"] {
            let refused = desk.refused(command);
            assert!(refused.contains(message), "{command}: {refused}");
        }
    }
    bundle(2000.0, "", of_force);
    desk.done("identify b -o m.json");
    let refused = desk.refused("diagnose b -o d");
    assert!(
        refused.contains("effects are traced along records of samples"),
        "{refused}"
    );
    let refused = desk.refused("identify b -o n.json --structure rigid-body");
    assert!(refused.contains("is fitted to records of samples"), "{refused}");
}

/// A response of the speed, or one that becomes it, is that of an output in m/s.
#[test]
fn a_speed_keeps_its_word() {
    let mut random = Noise(4);
    let lines = lines(100.0);
    for (power, quantity) in [(1, "mobility"), (2, "accelerance"), (0, "receptance")] {
        let machine = Machine::draw(&mut random, 2);
        let desk = Desk::new();
        let value = |f: f64| machine.displacement(f) * C64::new(0.0, TAU * f).powi(power);
        desk.write("b/a.csv", table(&lines, value, 2e-3, true, &mut random));
        let entry = entry("a.csv", &format!("quantity = \"{quantity}\""));
        desk.write("b/experiment.toml", head(2000.0, "units = [\"m/s\"]") + &entry);
        let told = desk.done("inspect b");
        assert!(told.contains("output: y [m/s], speed"), "{told}");
        desk.done("identify b -o m.json");
        let found = discrete(&desk.model("m.json"), &lines);
        let hold = |f: f64| {
            let s = C64::new(0.0, TAU * f / 2000.0);
            (1.0 - (-s).exp()) / s
        };
        let mut off: Vec<f64> = lines
            .iter()
            .enumerate()
            .map(|(k, f)| {
                let speed = machine.displacement(*f) * C64::new(0.0, TAU * f) * hold(*f);
                (found.line(k)[(0, 0)] / speed - 1.0).norm()
            })
            .collect();
        off.sort_by(f64::total_cmp);
        assert!(
            off[lines.len() / 2] < 2e-3,
            "{quantity}: {}",
            off[lines.len() / 2]
        );
    }
}

/// A measured stage with two encoders: its published model has modes at 30.5, 89.1 and 297 Hz, and misses the response by 14 and 13 %.
#[test]
fn a_measured_stage_of_two_encoders() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/cases/two-encoder-stage-frf/frf.csv"
    );
    let Ok(table) = std::fs::read(file) else {
        eprintln!("skipped: {file} is missing");
        return;
    };
    let desk = Desk::new();
    desk.write("b/frf.csv", table);
    let columns =
        ["motor", "load"].map(|y| format!("\"{y}/force re\" = \"{y}_re\", \"{y}/force im\" = \"{y}_im\""));
    desk.write(
        "b/experiment.toml",
        format!(
            "format = 2\nname = \"stage\"\nsample_rate = 4000.0\n[channels.output]\ncolumns = [\"motor\", \"load\"]\n\
             [channels.input]\ncolumns = [\"force\"]\n[[records]]\nfile = \"frf.csv\"\nkind = \"response\"\nuse = \"estimation\"\n\
             columns = {{ frequency = \"f_hz\", {} }}\n",
            columns.join(", ")
        ),
    );
    let summary = desk.json("identify b -o m.json --json");
    for (wanted, slack) in [(30.5, 0.02), (89.1, 0.02), (297.0, 0.06)] {
        let modes = summary["modes"].as_array().unwrap().iter();
        let near = modes
            .map(|m| (m[0].as_f64().unwrap() / wanted - 1.0).abs())
            .fold(1.0, f64::min);
        assert!(near < slack, "{wanted}: {summary:#}");
    }
    assert!(number(&summary, "/frozen/median_db") < -17.5, "{summary:#}");
    let sentence = summary["verdict"]["sentence"].as_str().unwrap();
    assert!(
        sentence.starts_with("approximate") && sentence.contains("state no noise"),
        "{sentence}"
    );
}
