//! `lpv identify` from frequency responses.

use crate::common::{
    Desk, Noise, PERIOD, csv, entry, files, head, machine_bundle, mode, mode_bundle, mode_record, multisine,
    number, response, shared, stdout_of,
};
use lpv_core::nalgebra::dmatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Model, StateSpace};
use std::ffi::OsStr;
use std::path::Path;

/// The model at a constant position, as a sampled record sees it; number of states and deltas.
fn frozen(desk: &Desk, name: &str, p: f64, rate: f64) -> (StateSpace<Discrete>, [usize; 2]) {
    let clock = Discrete::from_rate(rate).unwrap();
    match desk.model(name) {
        Model::DiscreteLfr(lfr) => (lfr.frozen(&[p]).unwrap(), [lfr.states(), lfr.delta_count()]),
        Model::ContinuousLfr(lfr) => (
            lfr.frozen(&[p]).unwrap().zero_order_hold(clock).unwrap(),
            [lfr.states(), lfr.delta_count()],
        ),
        _ => panic!("several positions give an LFR by default"),
    }
}

#[test]
fn a_periodic_record_becomes_a_time_invariant_model() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    let before = files(&desk.path("bundle"));
    let summary = desk.json("identify bundle -o result/model.json --json");
    assert_eq!(summary["positions"], 1);
    let Model::DiscreteStateSpace(found) = desk.model("result/model.json") else {
        panic!("one position is a time-invariant model");
    };
    let truth = Complex::new(0.9, 0.3);
    let distance = |z: Complex<f64>| (z - truth).norm();
    let nearest = found
        .poles()
        .unwrap()
        .into_iter()
        .map(distance)
        .fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-4, "{nearest}");
    let lines = [0.5, 1.0];
    let (g, f) = (
        found.frequency_response(&lines).unwrap(),
        mode().frequency_response(&lines).unwrap(),
    );
    assert!(g.relative_error(&f).unwrap().iter().all(|&e| e < 1e-4));
    // Nothing but the model is written, and nothing in the bundle.
    assert_eq!(files(&desk.path("bundle")), before);
    assert_eq!(files(&desk.path("result")).len(), 1);
    let text = desk.done("identify bundle -o again.json");
    for part in [
        "discrete state space",
        "- order",
        "integrator",
        "FRF noise",
        "model written to again.json",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

#[test]
fn positions_become_an_lfr_that_knows_the_modes_in_between() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let summary = desk.json("identify bundle -o model.json --json");
    assert_eq!(summary["positions"], 5);
    assert!(
        number(&summary, "/frozen/median_db") < number(&summary, "/frf_noise_db") + 2.0,
        "{summary:#}"
    );
    assert!(summary["reasons"].as_array().unwrap().len() >= 5);
    let (frozen, [states, deltas]) = frozen(&desk, "model.json", 0.01, 20.0);
    assert_eq!((frozen.inputs(), frozen.outputs()), (2, 2));
    assert!(states == 8 && deltas <= 5, "{states} states, {deltas} deltas");
    // Modes of the default machine as its file states them, next to p = 0 where they change little.
    let lines: Vec<f64> = (100..240).map(|k| f64::from(k) / 100.0).collect();
    let response = frozen.frequency_response(&lines).unwrap();
    for (output, input, mode) in [(0, 0, 1.45), (1, 1, 2.0)] {
        let size: Vec<f64> = response.channel(output, input).map(|g| g.norm()).collect();
        let near: Vec<usize> = (0..lines.len())
            .filter(|&k| (lines[k] / mode - 1.0).abs() < 0.1)
            .collect();
        let peak = near
            .into_iter()
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap();
        assert!((lines[peak] - mode).abs() < 0.015, "{} for {mode}", lines[peak]);
    }
    // And at every position that was.
    for k in 0..5 {
        let modes = summary["lpv"]["modes"][k].as_array().unwrap();
        assert!(
            modes.iter().any(|m| (number(m, "/0") - 2.0).abs() < 0.05),
            "{modes:?}"
        );
    }
}

/// The mode with poles that depend on the position, by 3 % of their angle at p = 1.
fn mode_at(p: f64) -> StateSpace<Discrete> {
    let w = 0.3 + 0.01 * p;
    let m = mode();
    StateSpace::new(
        dmatrix![0.9, -w; w, 0.9],
        m.b().clone(),
        m.c().clone(),
        m.d().clone(),
        m.clock(),
    )
    .unwrap()
}

#[test]
fn records_without_periods_at_rest_become_an_lpv_model_too() {
    let desk = Desk::new();
    let mut random = Noise(8);
    let mut toml = head(10.0) + "[channels.scheduling]\ncolumns = [\"p\"]\n";
    for (k, at) in [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().enumerate() {
        let u = random.samples(4096, 1.0);
        let y: Vec<f64> = response(&mode_at(at), &u)
            .into_iter()
            .map(|y| y + 0.01 * random.sample())
            .collect();
        let p = vec![at; u.len()];
        desk.write(
            &format!("bundle/{k}.csv"),
            csv(&[("u", &u), ("y", &y), ("p", &p)]),
        );
        toml += &entry(&format!("{k}.csv"), None, "estimation");
    }
    desk.write("bundle/experiment.toml", toml);
    desk.write("order.toml", "order = 2\n");
    let summary = desk.json("identify bundle -o model.json --config order.toml --json");
    assert_eq!(summary["positions"], 5);
    assert!(
        summary["reasons"].to_string().contains("local rational"),
        "{summary:#}"
    );
    // At a position between those that were measured.
    let lines: Vec<f64> = (1..45).map(|k| f64::from(k) / 10.0).collect();
    let (found, _) = frozen(&desk, "model.json", 0.25, 10.0);
    let found = found.frequency_response(&lines).unwrap();
    let errors = found
        .relative_error(&mode_at(0.25).frequency_response(&lines).unwrap())
        .unwrap();
    assert!(errors.iter().all(|e| *e < 0.02), "{errors:?}");
}

#[test]
fn the_bytes_of_a_model_depend_on_the_seed_and_not_on_the_threads() {
    let desk = Desk::new();
    machine_bundle(&desk);
    mode_bundle(&desk, "mode");
    for bundle in ["bundle", "mode"] {
        for threads in ["1", "2"] {
            let output = format!("{threads}.json");
            let words = ["identify", bundle, "-o", &output];
            let out = desk
                .program(&words)
                .env("RAYON_NUM_THREADS", threads)
                .output()
                .unwrap();
            stdout_of(bundle, &out);
        }
        assert!(desk.bytes("1.json") == desk.bytes("2.json"), "{bundle}");
    }
}

#[test]
fn structures_that_do_not_fit_the_data_are_refused_with_advice() {
    let desk = Desk::new();
    mode_bundle(&desk, "mode");
    machine_bundle(&desk);
    // One input that moves two outputs.
    let (u, y) = mode_record();
    desk.write("two/run.csv", csv(&[("u", &u), ("y", &y), ("z", &u)]));
    let toml = head(10.0).replace("[\"y\"]", "[\"y\", \"z\"]") + &entry("run.csv", None, "estimation");
    desk.write("two/experiment.toml", toml);
    // Nothing to fit.
    desk.write("held/run.csv", csv(&[("u", &u), ("y", &y)]));
    desk.write(
        "held/experiment.toml",
        head(10.0) + &entry("run.csv", Some(PERIOD), "validation"),
    );
    // Positions are known, but the records move.
    let p = multisine(1..3, PERIOD, u.len());
    desk.write("moves/run.csv", csv(&[("u", &u), ("y", &y), ("p", &p)]));
    let toml =
        head(10.0) + "[channels.scheduling]\ncolumns = [\"p\"]\n" + &entry("run.csv", None, "estimation");
    desk.write("moves/experiment.toml", toml);
    for (line, part) in [
        ("mode --structure lpv", "[channels.scheduling]"),
        ("bundle --structure lti", "one position"),
        ("two --structure rigid-body", "input"),
        ("held", "use = \"estimation\""),
        ("held --structure rigid-body", "use = \"estimation\""),
        ("moves", "position"),
        ("bundle --functions 0", "functions"),
        ("mode --hold-out 1.5", "hold-out"),
    ] {
        let message = desk.refused(&format!("identify {line} -o model.json"));
        assert!(message.contains(part), "{line}: {message}");
        assert!(!desk.path("model.json").exists(), "{line}");
    }
}

/// What `lpv identify` tells of the model that it writes to `model.json`.
fn identified(desk: &Desk, folder: &Path) -> serde_json::Value {
    let words: [&OsStr; 5] = [
        "identify".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "model.json".as_ref(),
        "--json".as_ref(),
    ];
    let out = desk.program(&words).output().unwrap();
    serde_json::from_str(&stdout_of("identify", &out)).unwrap()
}

#[test]
fn machine_plain_reaches_the_noise_of_its_responses() {
    let Some(folder) = shared("machine-plain") else {
        return;
    };
    let desk = Desk::new();
    let summary = identified(&desk, &folder);
    assert_eq!(summary["positions"], 9);
    assert!(number(&summary, "/frozen/median_db") < number(&summary, "/frf_noise_db") + 2.0);
    let (middle, [states, deltas]) = frozen(&desk, "model.json", 0.0, 20.0);
    assert_eq!((middle.inputs(), middle.outputs()), (2, 2));
    assert!(states == 8 && deltas <= 5, "{states} states, {deltas} deltas");
    let words: [&OsStr; 4] = [
        "validate".as_ref(),
        "model.json".as_ref(),
        folder.as_ref(),
        "--json".as_ref(),
    ];
    let check: serde_json::Value =
        serde_json::from_str(&stdout_of("validate", &desk.program(&words).output().unwrap())).unwrap();
    assert!(
        number(&check, "/frozen/error_over_noise") < 1.2,
        "{:#}",
        check["frozen"]
    );
    // Along moves that were not fitted, in the loop that made them.
    let moves: Vec<&serde_json::Value> = check["records"].as_array().unwrap().iter().collect();
    assert!(moves.len() >= 3, "{check:#}");
    for record in moves {
        for output in record["outputs"].as_array().unwrap() {
            assert!(number(output, "/closed_loop/over_noise") < 1.3, "{record:#}");
        }
    }
}

#[test]
fn two_mass_bench_shows_its_resonance() {
    let Some(folder) = shared("two-mass-bench") else {
        return;
    };
    let desk = Desk::new();
    let summary = identified(&desk, &folder);
    // The phase of the record itself passes -90 degrees between its lines at 76 and 77 Hz.
    let resonance = number(&summary, "/resonance_hz");
    assert!((76.0..77.0).contains(&resonance), "{resonance}");
    assert!(number(&summary, "/frf_noise_percent") < 1.0);
    let rms = &summary["relative_rms_percent"];
    assert!(number(rms, "/0") < 9.97 && number(rms, "/1") < 8.98, "{rms}");
}

#[test]
fn friction_in_the_grid_is_told_and_not_fatal() {
    let Some(folder) = shared("machine-friction") else {
        return;
    };
    let desk = Desk::new();
    let line = format!("identify {} -o model.json --json", folder.display());
    let summary: serde_json::Value = serde_json::from_str(&desk.judged(&line)).unwrap();
    // Friction bends the responses from which the model is made: the first line says so.
    assert_ne!(summary["verdict"]["worth"], "good", "{}", summary["verdict"]);
    let reasons = summary["reasons"].to_string();
    assert!(reasons.contains("outside the unit circle"), "{reasons}");
    assert!(reasons.contains("relative error"), "{reasons}");
    assert!(
        reasons.contains("median error against the measured responses"),
        "{reasons}"
    );
}

/// Resonances that move by several times their width from one position to the next, as measured in closed loop: where the frozen models
/// lose them they begin anew with the poles that were found there, and the small LFR explains the moves too.
#[test]
fn resonances_move_by_more_than_their_width() {
    let desk = Desk::new();
    desk.write(
        "machine.toml",
        "positions = { count = 11 }\nmoves = { estimation = 3, validation = 2 }\n[machine]\n\
         carriage-mass-kg = 9.89\nbeam-mass-kg = 25.0\ncarriage-inertia-kg-m2 = 0.212\nbeam-inertia-kg-m2 = 1.0\nhalf-beam-m = 0.51\n\
         stiffness-y-n-per-m = 483.5\nstiffness-r-n-m-per-rad = 27.28\n\
         damping-y-n-s-per-m = 0.81\ndamping-r-n-m-s-per-rad = 0.032\n",
    );
    desk.done("simulate --machine machine.toml -o bundle");
    let summary = desk.json("identify bundle -o model.json --json");
    let (_, [states, deltas]) = frozen(&desk, "model.json", 0.0, 20.0);
    assert_eq!((states, deltas), (8, 4), "{}", summary["reasons"]);
    let checks = desk.json("validate model.json bundle --json");
    // A slow move and a fast one, along which gains of constant positions lose the machine.
    for place in ["0/outputs/0", "0/outputs/1", "1/outputs/0", "1/outputs/1"] {
        for (kind, most) in [("one_step", 1.1), ("closed_loop", 1.2)] {
            let over = number(&checks, &format!("/records/{place}/{kind}/over_noise"));
            assert!((0.5..most).contains(&over), "{place}, {kind}: {over}");
        }
    }
}
