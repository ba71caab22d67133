//! `lpv validate`: a true model leaves white residuals of the size of the noise, a wrong one does not.

use crate::common::{Desk, Noise, csv, entry, head, machine_bundle, multisine, number};
use lpv_core::nalgebra::{DVector, dmatrix};
use lpv_core::{Continuous, Discrete, Model, StateSpace};

const PERIOD: usize = 256;
const NOISE: f64 = 0.05;

/// A resonance at 0.5 Hz with gain 1 at rest.
fn continuous(resonance_hz: f64) -> StateSpace<Continuous> {
    let w = std::f64::consts::TAU * resonance_hz;
    let a = dmatrix![0.0, 1.0; -w * w, -0.2 * w];
    StateSpace::new(
        a,
        dmatrix![0.0; w * w],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        Continuous,
    )
    .unwrap()
}

fn sampled(resonance_hz: f64, rate: f64) -> StateSpace<Discrete> {
    let clock = Discrete::from_rate(rate).unwrap();
    continuous(resonance_hz).zero_order_hold(clock).unwrap()
}

/// The reference and what the loop does with it: the controller sees the noise of the sensor.
fn closed_loop(r: Vec<f64>, noise: &mut Noise) -> [Vec<f64>; 3] {
    let system = sampled(0.5, 10.0);
    let mut x = DVector::zeros(2);
    let (mut before, mut u, mut y) = (0.0, Vec::new(), Vec::new());
    for &r in &r {
        let measured = x[0] + NOISE * noise.sample();
        // u(k) = u(k-1) + 0.05 (r(k) - y(k)).
        let now = before + 0.05 * (r - measured);
        x = system.a() * &x + system.b().column(0) * now;
        before = now;
        u.push(now);
        y.push(measured);
    }
    [r, u, y]
}

/// One periodic record for the level of the noise, one move to judge.
fn bundle(desk: &Desk) {
    let mut noise = Noise(17);
    let periodic: Vec<f64> = multisine(1..60, PERIOD, 9 * PERIOD);
    let mut level = 0.0;
    let mut steps = Noise(2);
    let moves: Vec<f64> = (0..3000)
        .map(|n| {
            if n % 40 == 0 {
                level = 5.0 * steps.sample();
            }
            level
        })
        .collect();
    for (name, r) in [("grid", periodic), ("move", moves)] {
        let [r, u, y] = closed_loop(r, &mut noise);
        desk.write(
            &format!("bundle/{name}.csv"),
            csv(&[("r", &r), ("u", &u), ("y", &y)]),
        );
    }
    let toml = head(10.0)
        + "[channels.reference]\ncolumns = [\"r\"]\n\
           [controller]\nreference_numerator = [0.05]\nfeedback_numerator = [0.05]\ndenominator = [1.0, -1.0]\n"
        + &entry("grid.csv", Some(PERIOD), "estimation")
        + &entry("move.csv", None, "validation");
    desk.write("bundle/experiment.toml", toml);
}

fn judge(desk: &Desk, model: Model) -> serde_json::Value {
    desk.write_model("model.json", &model);
    serde_json::from_str(&desk.judged("validate model.json bundle --json")).unwrap()
}

#[test]
fn the_true_model_leaves_the_noise() {
    let desk = Desk::new();
    bundle(&desk);
    let found = judge(&desk, Model::DiscreteStateSpace(sampled(0.5, 10.0)));
    let level = number(&found, "/noise/0");
    // What the loop makes of the noise also counts as noise of a sample: a few percent.
    assert!((level / NOISE - 1.0).abs() < 0.1, "{level}");
    assert!(
        (number(&found, "/frozen/error_over_noise") - 0.8).abs() < 0.3,
        "{:#}",
        found["frozen"]
    );
    assert_eq!(found["records"].as_array().unwrap().len(), 1);
    let record = &found["records"][0];
    assert_eq!(record["purpose"], "validation");
    for kind in ["one_step", "open_loop", "closed_loop"] {
        let over = number(record, &format!("/outputs/0/{kind}/over_noise"));
        assert!((over - 1.0).abs() < 0.15, "{kind}: {over}");
    }
    let white = &record["whiteness"][0];
    assert!(
        number(white, "/p_value") > 0.01 && number(white, "/outside") < 0.1,
        "{white:#}"
    );
    let cross = &record["cross_correlation"][0];
    assert!(number(cross, "/outside") < 0.1, "{cross:#}");
    let text = desk.done("validate model.json bundle");
    assert!(
        text.contains("white (its past") && !text.contains("not white"),
        "{text}"
    );
    // With the records for estimation as well, still the same verdict about the other.
    let all = desk.json("validate model.json bundle --all --json");
    assert_eq!(
        all["records"].as_array().unwrap().last().unwrap()["name"],
        record["name"]
    );
}

#[test]
fn a_wrong_model_is_seen() {
    let desk = Desk::new();
    bundle(&desk);
    let found = judge(&desk, Model::DiscreteStateSpace(sampled(0.6, 10.0)));
    assert!(
        number(&found, "/frozen/error_over_noise") > 3.0,
        "{:#}",
        found["frozen"]
    );
    let record = &found["records"][0];
    assert!(
        number(record, "/outputs/0/closed_loop/over_noise") > 2.0,
        "{record:#}"
    );
    assert!(number(record, "/whiteness/0/p_value") < 1e-3);
    let text = desk.judged("validate model.json bundle");
    assert!(text.contains("not white (its past"), "{text}");
}

#[test]
fn a_continuous_model_is_sampled_and_another_sample_time_refused() {
    let desk = Desk::new();
    bundle(&desk);
    let discrete = judge(&desk, Model::DiscreteStateSpace(sampled(0.5, 10.0)));
    let mut continuous = judge(&desk, Model::ContinuousStateSpace(continuous(0.5)));
    assert_ne!(discrete["model"], continuous["model"]);
    continuous["model"] = discrete["model"].clone();
    assert_eq!(discrete, continuous);
    desk.write_model("fast.json", &Model::DiscreteStateSpace(sampled(0.5, 20.0)));
    let message = desk.refused("validate fast.json bundle");
    assert!(
        ["sample time", "0.05", "0.1"].iter().all(|p| message.contains(p)),
        "{message}"
    );
    // Two outputs for one.
    let both = sampled(0.5, 10.0).beside(&sampled(0.5, 10.0)).unwrap();
    desk.write_model("both.json", &Model::DiscreteStateSpace(both));
    let message = desk.refused("validate both.json bundle");
    assert!(
        message.contains("output") || message.contains("input"),
        "{message}"
    );
}

#[test]
fn an_identified_model_is_judged_by_what_was_held_out() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.done("identify bundle -o result/model.json");
    let found = desk.json("validate result/model.json bundle --json");
    assert!(
        number(&found, "/frozen/error_over_noise") < 1.3,
        "{:#}",
        found["frozen"]
    );
    assert_eq!(found["records"].as_array().unwrap().len(), 1);
    for k in 0..2 {
        assert!(
            number(
                &found["records"][0],
                &format!("/outputs/{k}/closed_loop/fit_percent")
            ) > 85.0,
            "{found:#}"
        );
    }
    let all = desk.json("validate result/model.json bundle --all --json");
    assert_eq!(all["records"].as_array().unwrap().len(), 2);
}
