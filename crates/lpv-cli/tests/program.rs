//! The program as a user meets it: files in, model out, exit codes, messages.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, Discrete, Lfr, Model, StateSpace};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PERIOD: usize = 256;

fn lpv(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lpv"))
        .args(arguments)
        .output()
        .unwrap()
}

fn machine() -> StateSpace<Discrete> {
    let clock = Discrete::from_rate(10.0).unwrap();
    StateSpace::new(
        dmatrix![0.9, -0.3; 0.3, 0.9],
        dmatrix![1.0; 0.0],
        dmatrix![0.0, 1.0],
        dmatrix![0.0],
        clock,
    )
    .unwrap()
}

/// A bundle with one CSV record of a mode, five periods of a multisine.
fn bundle(folder: &Path) {
    let samples = 5 * PERIOD;
    let phase = |k: usize| 2.0 * (k * k) as f64;
    let u = DMatrix::from_fn(1, samples, |_, n| {
        (1..100)
            .map(|k| (std::f64::consts::TAU * (k * (n % PERIOD)) as f64 / PERIOD as f64 + phase(k)).cos())
            .sum()
    });
    let y = machine().simulate(&DVector::zeros(2), &u).unwrap().outputs;
    let mut csv = String::from("u,y\n");
    for n in 0..samples {
        // A repeatable disturbance of the size of a sensor's last digits.
        let noise = 1e-6 * ((n * 7919 % 1009) as f64 / 1009.0 - 0.5);
        writeln!(csv, "{},{}", u[(0, n)], y[(0, n)] + noise).unwrap();
    }
    std::fs::write(folder.join("run.csv"), csv).unwrap();
    let toml = format!(
        "format = 1\nname = \"mode\"\nsample_rate = 10.0\n[channels.output]\ncolumns = [\"y\"]\n[channels.input]\ncolumns = [\"u\"]\n\
         [[records]]\nfile = \"run.csv\"\nkind = \"periodic\"\nperiod = {PERIOD}\nuse = \"estimation\"\n"
    );
    std::fs::write(folder.join("experiment.toml"), toml).unwrap();
}

fn path(p: &Path) -> &str {
    p.to_str().unwrap()
}

#[test]
fn a_bundle_becomes_a_model() {
    let folder = tempfile::tempdir().unwrap();
    bundle(folder.path());
    let model = folder.path().join("model.json");
    let out = lpv(&["identify", path(folder.path()), "-o", path(&model), "--json"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(summary["positions"], 1);
    let Model::DiscreteStateSpace(found) =
        Model::from_json(&std::fs::read_to_string(&model).unwrap()).unwrap()
    else {
        panic!("one position is a time-invariant model");
    };
    let truth = Complex::new(0.9, 0.3);
    let nearest = found
        .poles()
        .unwrap()
        .into_iter()
        .map(|z| (z - truth).norm())
        .fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-4, "{nearest}");
    let (g, f) = (
        found.frequency_response(&[0.5, 1.0]).unwrap(),
        machine().frequency_response(&[0.5, 1.0]).unwrap(),
    );
    assert!(g.relative_error(&f).unwrap().iter().all(|&e| e < 1e-4));
}

#[test]
fn bad_input_ends_with_two_and_one_message_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    bundle(folder.path());
    let model = folder.path().join("model.json");
    let config = folder.path().join("settings.toml");
    std::fs::write(&config, "functons = 8\n").unwrap();
    let cut = std::fs::read_to_string(folder.path().join("run.csv"))
        .unwrap()
        .replacen("\n0", "\nnan", 1);
    let broken = folder.path().join("broken");
    std::fs::create_dir(&broken).unwrap();
    std::fs::copy(
        folder.path().join("experiment.toml"),
        broken.join("experiment.toml"),
    )
    .unwrap();
    std::fs::write(
        broken.join("run.csv"),
        cut.lines().take(700).collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    for (arguments, word) in [
        (
            vec!["identify", "/no/such/bundle", "-o", path(&model)],
            "/no/such/bundle",
        ),
        (vec!["identify", path(&broken), "-o", path(&model)], "run.csv"),
        (
            vec![
                "identify",
                path(folder.path()),
                "-o",
                path(&model),
                "-c",
                path(&config),
            ],
            "functons",
        ),
        (vec!["identify", path(folder.path())], "--output"),
        (vec!["identfy"], "identify"),
    ] {
        let out = lpv(&arguments);
        let message = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(word), "{arguments:?}: {message}");
        assert!(out.stdout.is_empty() && !model.exists());
    }
}

/// Bundles of others: measured, and from an independent simulator.
fn shared(name: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if folder.exists() {
        return Some(folder);
    }
    eprintln!("skipped: {} is missing", folder.display());
    None
}

#[test]
fn machine_plain_reaches_the_noise_of_its_responses() {
    let Some(folder) = shared("machine-plain") else {
        return;
    };
    let scratch = tempfile::tempdir().unwrap();
    let model = scratch.path().join("model.json");
    let out = lpv(&["identify", path(&folder), "-o", path(&model), "--json"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let number = |pointer: &str| summary.pointer(pointer).unwrap().as_f64().unwrap();
    assert_eq!(summary["positions"], 9);
    // The median error against the responses is their own noise, with little of the model's on top.
    assert!(number("/frozen/median_db") < number("/frf_noise_db") + 2.0);
    let Model::DiscreteLfr(lfr) = Model::from_json(&std::fs::read_to_string(&model).unwrap()).unwrap() else {
        panic!("several positions give an LFR by default");
    };
    let check: &Lfr<Discrete> = &lfr;
    assert_eq!((check.states(), check.inputs(), check.outputs()), (36, 2, 2));
    assert!(check.clock().nyquist_hz() == 10.0);
}

#[test]
fn two_mass_bench_shows_its_resonance() {
    let Some(folder) = shared("two-mass-bench") else {
        return;
    };
    let scratch = tempfile::tempdir().unwrap();
    let out = lpv(&[
        "identify",
        path(&folder),
        "-o",
        path(&scratch.path().join("model.json")),
        "--json",
    ]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let resonance = summary["resonance_hz"].as_f64().unwrap();
    // The phase of the record itself passes -90 degrees between its lines at 76 and 77 Hz.
    assert!((76.0..77.0).contains(&resonance), "{resonance}");
    assert!(summary["frf_noise_percent"].as_f64().unwrap() < 1.0);
    let rms = &summary["relative_rms_percent"];
    assert!(
        rms[0].as_f64().unwrap() < 9.97 && rms[1].as_f64().unwrap() < 8.98,
        "{rms}"
    );
}
