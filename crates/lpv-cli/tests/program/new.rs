//! `lpv new`: from record files to a bundle.

use crate::common::{Desk, PERIOD, csv, entry, head, mode_record, number};
use experiment_data::{Bundle, BundleWriter, RecordFormat};
use lpv_core::RecordKind;

/// The mode's record with the time of each sample.
fn timed(desk: &Desk, name: &str) {
    let (u, y) = mode_record();
    let t: Vec<f64> = (0..u.len()).map(|n| n as f64 / 10.0).collect();
    desk.write(name, csv(&[("t", &t), ("u", &u), ("y", &y)]));
}

#[test]
fn a_csv_file_alone_becomes_a_bundle_and_a_model() {
    let desk = Desk::new();
    timed(&desk, "data/run.csv");
    let said = desk.done("new data/run.csv");
    for part in [
        "sample_rate = 10",
        "`t`",
        "256",
        "input: u",
        "output: y",
        "lpv inspect",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let bundle = Bundle::open(&desk.path("data")).unwrap();
    let d = bundle.description();
    assert_eq!((d.sample_rate_hz, d.name.as_str()), (10.0, "data"));
    assert_eq!(
        (
            d.channels.input.columns.as_slice(),
            d.channels.output.columns.as_slice()
        ),
        (&["u".to_owned()][..], &["y".to_owned()][..])
    );
    assert_eq!(
        bundle.load(0).unwrap().kind,
        RecordKind::Periodic { period: PERIOD }
    );
    let summary = desk.json("identify data -o model.json --json");
    assert_eq!(
        (summary["positions"].as_u64(), summary["order"].as_u64()),
        (Some(1), Some(2))
    );
}

#[test]
fn every_kind_of_file_below_records() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    desk.write("source/run.csv", csv(&[("u", &u), ("y", &y)]));
    let toml = head(10.0) + &entry("run.csv", Some(PERIOD), "estimation");
    desk.write("source/experiment.toml", toml);
    let source = Bundle::open(&desk.path("source")).unwrap();
    for (ending, format) in [
        ("npz", RecordFormat::Npz),
        ("parquet", RecordFormat::Parquet),
        ("mat", RecordFormat::Mat),
        ("csv", RecordFormat::Csv),
    ] {
        let mut writer =
            BundleWriter::create(&desk.path(ending), source.description().clone(), format).unwrap();
        writer.write(&source.load(0).unwrap()).unwrap();
        writer.finish().unwrap();
        let description = desk.path(&format!("{ending}/experiment.toml"));
        std::fs::remove_file(&description).unwrap();
        desk.done(&format!(
            "new {ending}/records/run.{ending} --sample-rate 10 --name axis"
        ));
        // The bundle is the folder above `records`.
        let bundle = Bundle::open(&desk.path(ending)).unwrap();
        assert_eq!(bundle.description().name, "axis");
        assert_eq!(
            bundle.load(0).unwrap().outputs,
            source.load(0).unwrap().outputs,
            "{ending}"
        );
        desk.done(&format!("identify {ending} -o {ending}.json"));
    }
}

#[test]
fn positions_validation_and_dead_columns_are_seen() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let rest = vec![0.5; u.len()];
    for (name, at) in [("a", -0.1), ("b", 0.2)] {
        let p = vec![at; u.len()];
        let columns: [(&str, &[f64]); 4] = [("u", &u), ("y", &y), ("slide", &p), ("x", &rest)];
        desk.write(&format!("data/{name}.csv"), csv(&columns));
    }
    desk.write(
        "data/move.csv",
        csv(&[
            ("u", &u[..300]),
            ("y", &y[..300]),
            ("slide", &u[..300]),
            ("x", &rest[..300]),
        ]),
    );
    let said = desk
        .json("new data/a.csv data/b.csv data/move.csv --sample-rate 10 --validation data/move.csv --json");
    assert_eq!(said["questions"], serde_json::json!([]), "{said:#}");
    let guesses = said["guesses"].to_string();
    assert!(
        guesses.contains("`slide` is the scheduling signal") && guesses.contains("`x` is constant"),
        "{guesses}"
    );
    let summary = desk.json("inspect data --json");
    assert_eq!(summary["coverage"]["positions"], serde_json::json!([-0.1, 0.2]));
    assert_eq!(summary["records"][2]["purpose"], "validation");
    assert_eq!(summary["records"][2]["kind"], "transient");
}

#[test]
fn what_nobody_can_guess_is_marked() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    desk.write("data/run.csv", csv(&[("alpha", &u), ("beta", &y)]));
    let said = desk.done("new data/run.csv");
    for part in [
        "fill in: sample_rate",
        "--sample-rate",
        "fill in: channels.output",
        "fill in: channels.input",
        "`alpha`",
        "FILL IN",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let text = desk.text("data/experiment.toml");
    assert_eq!(
        text.lines().filter(|l| l.contains("# FILL IN")).count(),
        3,
        "{text}"
    );
    // As it is, no command takes it for data.
    assert!(desk.refused("inspect data").contains("experiment.toml"));
    // What the user adds answers the questions.
    let said = desk.done("new data/run.csv --force --sample-rate 10 --input alpha --output beta");
    assert!(!said.contains("fill in"), "{said}");
    let lines = desk.json("inspect data --json");
    assert!(number(&lines, "/experiments/0/band_hz/1") > 3.8);
}

#[test]
fn a_time_column_that_is_uneven_is_no_clock() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let mut t: Vec<f64> = (0..u.len()).map(|n| n as f64 / 10.0).collect();
    t[100] += 0.05;
    desk.write("run.csv", csv(&[("time", &t), ("u", &u), ("y", &y)]));
    let said = desk.done("new run.csv");
    assert!(said.contains("`time` does not advance evenly"), "{said}");
}

#[test]
fn a_description_that_exists_stays() {
    let desk = Desk::new();
    timed(&desk, "run.csv");
    desk.write("experiment.toml", "mine");
    let message = desk.refused("new run.csv");
    assert!(
        message.contains("experiment.toml") && message.contains("--force"),
        "{message}"
    );
    assert_eq!(desk.text("experiment.toml"), "mine");
    desk.done("new run.csv --force");
    Bundle::open(&desk.path(".")).unwrap();
}

#[test]
fn wrong_files_and_columns_are_named() {
    let desk = Desk::new();
    timed(&desk, "run.csv");
    desk.write("empty.csv", "");
    desk.write("notes.txt", "not data");
    desk.write("words.csv", "a,b\nx,y\n");
    desk.write("other.csv", "force,pos\n1,2\n3,4\n");
    for (line, parts) in [
        ("new run.csv --input uu", ["`uu`", "nearest: `u`"]),
        ("new other.csv --input forse", ["`forse`", "nearest: `force`"]),
        ("new nothing.csv", ["nothing.csv", ""]),
        ("new empty.csv", ["empty.csv", ""]),
        ("new notes.txt", ["notes.txt", ""]),
        ("new words.csv", ["words.csv", ""]),
        ("new run.csv run.csv", ["run.csv", "twice"]),
        ("new run.csv other.csv", ["no column in common", ""]),
    ] {
        let message = desk.refused(line);
        assert!(parts.iter().all(|p| message.contains(p)), "{line}: {message}");
    }
    assert!(!desk.path("experiment.toml").exists());
}
