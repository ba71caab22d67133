//! Units do not matter: the same machine in other units of its signals, of time and of the position gives the same model.

use crate::common::{Desk, Noise, csv, entry, multisine, response};
use lpv_core::nalgebra::dmatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, Discrete, Frf, Model, StateSpace};

const SAMPLE_TIME: f64 = 0.01;
const PERIOD: usize = 128;
const PLACES: [f64; 3] = [-1.0, 0.0, 1.0];

/// What a signal, a time or a position of the machine is called.
#[derive(Debug, Clone, Copy)]
struct Units {
    output: f64,
    input: f64,
    time: f64,
    /// The zero of p, in its ranges, and its unit.
    position: (f64, f64),
}

impl Units {
    const PLAIN: Self = Self {
        output: 1.0,
        input: 1.0,
        time: 1.0,
        position: (0.0, 1.0),
    };

    /// Over 24 decades each.
    fn random(noise: &mut Noise) -> Self {
        let mut any = || 10f64.powf((6.0 * noise.sample()).clamp(-12.0, 12.0));
        Self {
            output: any(),
            input: any(),
            time: any(),
            position: (0.0, any()),
        }
    }

    fn place(&self, p: f64) -> f64 {
        let (zero, unit) = self.position;
        unit * (zero + p)
    }
}

/// A mode that moves with p.
fn machine(p: f64) -> StateSpace<Discrete> {
    let w = std::f64::consts::TAU * (8.0 + 1.5 * p);
    let plant = StateSpace::new(
        dmatrix![0.0, 1.0; -w * w, -0.06 * w],
        dmatrix![0.0; 30.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        Continuous,
    );
    let clock = Discrete::new(SAMPLE_TIME).unwrap();
    plant.unwrap().zero_order_hold(clock).unwrap()
}

/// A bundle of periodic records at these places, or of one transient record at the first.
fn bundle(desk: &Desk, units: Units, places: &[f64], period: Option<usize>) {
    let mut toml = format!(
        "format = 1\nname = \"units\"\nsample_rate = {:e}\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\ncolumns = [\"u\"]\n",
        1.0 / (SAMPLE_TIME * units.time)
    );
    if places.len() > 1 {
        toml += "[channels.scheduling]\ncolumns = [\"p\"]\n";
    }
    for (i, p) in places.iter().enumerate() {
        let mut noise = Noise(i as u64);
        let u = match period {
            Some(period) => multisine(1..period / 2 - 4, period, 9 * period),
            None => noise.samples(400, 1.0),
        };
        let y = response(&machine(*p), &u);
        let size = y.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let y: Vec<f64> = y
            .iter()
            .map(|v| units.output * (v + 1e-3 * size * noise.sample()))
            .collect();
        let u: Vec<f64> = u.iter().map(|v| units.input * v).collect();
        // The transient at the beginning is over.
        let skip = period.unwrap_or(0);
        let at = vec![units.place(*p); u.len()];
        let file = format!("r{i}.csv");
        desk.write(
            &format!("bundle/{file}"),
            csv(&[("u", &u[skip..]), ("y", &y[skip..]), ("p", &at[skip..])]),
        );
        toml += &entry(&file, period, "estimation");
    }
    desk.write("bundle/experiment.toml", toml);
}

/// The frozen response of the model file in the units of the machine, at lines between 0 and the Nyquist frequency.
fn frozen(desk: &Desk, units: Units, p: f64) -> Vec<Complex<f64>> {
    let clock = Discrete::new(SAMPLE_TIME * units.time).unwrap();
    let lines: Vec<f64> = (1..40)
        .map(|k| f64::from(k) / 80.0 / (SAMPLE_TIME * units.time))
        .collect();
    let place = [units.place(p)];
    let found: Frf = match desk.model("model.json") {
        Model::ContinuousLfr(m) => m.frozen(&place).unwrap().zero_order_hold(clock).unwrap(),
        Model::DiscreteLfr(m) => m.frozen(&place).unwrap(),
        Model::DiscreteStateSpace(m) => m,
        Model::InnovationStateSpace(m) => m.model().clone(),
        other => panic!("{other:?}"),
    }
    .frequency_response(&lines)
    .unwrap();
    found
        .channel(0, 0)
        .map(|g| g * (units.input / units.output))
        .collect()
}

/// The first line of `identify` is the same, and so is the response within 1e-6 of its largest value.
fn compare(places: &[f64], period: Option<usize>, config: &str, tried: &[Units]) {
    let desk = Desk::new();
    desk.write("config.toml", config);
    let run = |units: Units| {
        bundle(&desk, units, places, period);
        let said = desk.done("identify bundle --config config.toml -o model.json");
        let response: Vec<_> = [-0.8, 0.1, 0.6]
            .iter()
            .flat_map(|p| frozen(&desk, units, *p))
            .collect();
        (said.lines().next().unwrap_or_default().to_owned(), response)
    };
    let (title, expected) = run(Units::PLAIN);
    let largest = expected.iter().fold(0.0, |m: f64, g| m.max(g.norm()));
    for units in tried {
        let (own, found) = run(*units);
        assert_eq!(own, title, "{units:?}");
        for (e, f) in expected.iter().zip(&found) {
            assert!((e - f).norm() < 1e-6 * largest, "{units:?}: {e} {f}");
        }
    }
}

fn some(seed: u64, count: usize) -> Vec<Units> {
    let mut noise = Noise(seed);
    (0..count).map(|_| Units::random(&mut noise)).collect()
}

#[test]
fn of_a_small_lfr() {
    let mut tried = some(1, 3);
    tried.push(Units {
        position: (1e6, 1.0),
        ..Units::PLAIN
    });
    tried.push(Units {
        time: 1e6,
        output: 1e9,
        position: (-6e4, 1e-3),
        ..Units::PLAIN
    });
    compare(&PLACES, Some(PERIOD), "", &tried);
}

#[test]
fn of_an_exact_lfr() {
    let mut tried = some(2, 3);
    tried.push(Units {
        output: 1e-12,
        position: (1e6, 1e3),
        ..Units::PLAIN
    });
    compare(&PLACES, Some(PERIOD), "lfr = \"exact\"\n", &tried);
}

#[test]
fn of_a_state_space() {
    compare(&[0.0], Some(PERIOD), "", &some(3, 3));
    compare(&[0.0], None, "order = 2\n", &some(4, 3));
}

/// Places that differ in two scheduling signals are never one.
#[test]
fn two_scheduling_signals_are_refused() {
    let desk = Desk::new();
    bundle(&desk, Units::PLAIN, &PLACES, Some(PERIOD));
    let toml = desk
        .text("bundle/experiment.toml")
        .replace("columns = [\"p\"]", "columns = [\"p\", \"q\"]");
    desk.write("bundle/experiment.toml", toml);
    for (i, q) in ["0.1", "0.2", "0.3"].iter().enumerate() {
        let file = format!("bundle/r{i}.csv");
        let two = |(k, line): (usize, &str)| {
            let signals = &line[..line.rfind(',').unwrap()];
            match k {
                0 => format!("{signals},p,q\n"),
                _ => format!("{signals},0.0,{q}\n"),
            }
        };
        let text: String = desk.text(&file).lines().enumerate().map(two).collect();
        desk.write(&file, text);
    }
    let message = desk.refused("identify bundle -o model.json");
    for part in [
        "records r0 and r1 rest at (0, 0.1) and (0, 0.2)",
        "p and q",
        "[channels.auxiliary]",
    ] {
        assert!(message.contains(part), "{message}");
    }
    // Each place has a response of its own.
    let json = desk.json("inspect bundle --json");
    let experiments = json["experiments"].as_array().unwrap();
    let places: Vec<_> = experiments
        .iter()
        .map(|e| (&e["position"], &e["records"]))
        .collect();
    let at = [0.1, 0.2, 0.3].map(|q| serde_json::json!([0.0, q]));
    let named = ["r0", "r1", "r2"].map(|r| serde_json::json!([r]));
    assert_eq!(places, at.iter().zip(&named).collect::<Vec<_>>());
}

/// One record whose p is in other units makes no place of two.
#[test]
fn a_record_in_another_unit_of_p_is_named() {
    let desk = Desk::new();
    bundle(&desk, Units::PLAIN, &[0.0, 0.15, 300.0], Some(PERIOD));
    let message = desk.refused("identify bundle -o model.json");
    assert!(
        message.contains("records r0 (p = 0) and r1 (p = 0.15)") && message.contains("record r2 (p = 300)"),
        "{message}"
    );
}
