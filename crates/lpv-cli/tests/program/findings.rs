//! Data that contradict themselves: `lpv inspect` names the record, the column and what to do, first.

use crate::common::{Desk, Noise, csv, entry, head, mode, multisine, response};

const PERIOD: usize = 256;

/// The first line of the text, and the row of this kind among the findings.
#[track_caller]
fn first(desk: &Desk, kind: &str) -> (String, serde_json::Value) {
    let text = desk.done("inspect bundle");
    let found = desk.json("inspect bundle --json");
    let rows = found["findings"].as_array().unwrap();
    let row = rows.iter().find(|r| r["kind"] == kind);
    assert!(row.is_some(), "{kind} in {rows:#?}");
    let line = text.lines().next().unwrap_or_default().to_owned();
    (line, row.unwrap().clone())
}

fn columns(noise: f64) -> [Vec<f64>; 2] {
    let u = multisine(1..100, PERIOD, 8 * PERIOD);
    let mut e = Noise(3);
    let y = response(&mode(), &u)
        .into_iter()
        .map(|y| y + noise * e.sample())
        .collect();
    [u, y]
}

fn one(desk: &Desk, u: &[f64], y: &[f64]) {
    desk.write("bundle/run.csv", csv(&[("u", u), ("y", y)]));
    desk.write(
        "bundle/experiment.toml",
        head(10.0) + &entry("run.csv", Some(PERIOD), "estimation"),
    );
}

#[test]
fn an_output_that_is_held_and_a_counter_that_runs_over_are_named_first() {
    let desk = Desk::new();
    let [u, y] = columns(1e-3);
    let held: Vec<f64> = (0..y.len()).map(|k| y[k / 4 * 4]).collect();
    one(&desk, &u, &held);
    let (line, row) = first(&desk, "held-samples");
    assert!(
        line.starts_with("contradiction: run, column `y`: each value is held for 4 samples"),
        "{line}"
    );
    assert_eq!(
        (row["record"].as_str(), row["severity"].as_str()),
        (Some("run"), Some("contradiction"))
    );
    // A slow motion in counts, beyond the range of 12 bits.
    let counts: Vec<f64> = y
        .iter()
        .enumerate()
        .map(|(k, y)| (3.0 * y + 5.0 * k as f64).round().rem_euclid(4096.0))
        .collect();
    desk.write("bundle/run.csv", csv(&[("u", &u), ("y", &counts)]));
    desk.write(
        "bundle/experiment.toml",
        head(10.0) + &entry("run.csv", None, "estimation"),
    );
    let (line, row) = first(&desk, "counter-wraps");
    assert!(
        line.contains("column `y`") && line.contains("jumps by 4096"),
        "{line}"
    );
    assert_eq!(row["modulus"], 4096.0);
}

#[test]
fn records_of_one_place_that_disagree_and_one_with_another_sign_are_named_first() {
    let desk = Desk::new();
    let [u, y] = columns(1e-3);
    let mut e = Noise(5);
    let twice = response(&mode(), &response(&mode(), &u));
    let slower: Vec<f64> = twice.iter().map(|y| y + 1e-3 * e.sample()).collect();
    desk.write("bundle/a.csv", csv(&[("u", &u), ("y", &y)]));
    desk.write("bundle/b.csv", csv(&[("u", &u), ("y", &slower)]));
    let both = |names: &[&str]| {
        let entries: String = names
            .iter()
            .map(|n| entry(&format!("{n}.csv"), Some(PERIOD), "estimation"))
            .collect();
        head(10.0) + &entries
    };
    desk.write("bundle/experiment.toml", both(&["a", "b"]));
    let (line, _) = first(&desk, "records-disagree");
    assert!(
        line.starts_with("contradiction: ") && line.contains("[channels.scheduling]"),
        "{line}"
    );
    let turned: Vec<f64> = u.iter().map(|u| -u).collect();
    desk.write("bundle/b.csv", csv(&[("u", &u), ("y", &y)]));
    desk.write("bundle/c.csv", csv(&[("u", &turned), ("y", &y)]));
    desk.write("bundle/experiment.toml", both(&["a", "b", "c"]));
    let (line, row) = first(&desk, "record-stands-apart");
    assert!(
        line.starts_with("contradiction: c, ") && line.contains("opposite sign"),
        "{line}"
    );
    assert_eq!(row["factor"], -1.0);
}

#[test]
fn lost_samples_are_counted_in_a_column_of_times() {
    let desk = Desk::new();
    let [u, y] = columns(1e-3);
    let t: Vec<f64> = (0..u.len())
        .map(|k| 0.1 * (k + if k > 700 { 2 } else { 0 }) as f64)
        .collect();
    desk.write("bundle/run.csv", csv(&[("time", &t), ("u", &u), ("y", &y)]));
    let auxiliary = "[channels.auxiliary]\ncolumns = [\"time\"]\n";
    desk.write(
        "bundle/experiment.toml",
        head(10.0) + auxiliary + &entry("run.csv", None, "estimation"),
    );
    let (line, row) = first(&desk, "lost-samples");
    assert!(
        line.contains("2 samples missing, the first behind row 701"),
        "{line}"
    );
    assert_eq!(row["samples"], 2);
}

/// A drift of the sensor is named and does not bend the response.
#[test]
fn a_drift_is_taken_out() {
    let desk = Desk::new();
    let [u, y] = columns(1e-4);
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64).sqrt();
    one(&desk, &u, &y);
    let noise = |desk: &Desk| {
        desk.json("inspect bundle --json")["experiments"][0]["frf_deviation"]["median"]
            .as_f64()
            .unwrap()
    };
    let clean = noise(&desk);
    let drifting: Vec<f64> = y
        .iter()
        .enumerate()
        .map(|(k, y)| y + 0.5 * rms * k as f64 / PERIOD as f64)
        .collect();
    one(&desk, &u, &drifting);
    let (_, row) = first(&desk, "level-drifts");
    let rise = row["rise"].as_f64().unwrap();
    assert!((rise / (0.5 * rms) - 1.0).abs() < 1e-3, "{rise}");
    assert!(noise(&desk) < 1.5 * clean, "{} {clean}", noise(&desk));
    let text = desk.done("inspect bundle");
    assert!(!text.contains("still show the transient"), "{text}");
}

#[test]
fn a_held_out_record_with_another_zero_and_one_that_is_a_copy_are_named_first() {
    let desk = Desk::new();
    let mut e = Noise(11);
    let mut run = |zero: f64, size: f64| {
        let u = e.samples(3000, 1.0);
        let motion = response(&mode(), &u);
        let y: Vec<f64> = motion
            .iter()
            .map(|y| size * (y + 1e-3 * e.sample()) + zero)
            .collect();
        csv(&[("u", &u), ("y", &y)])
    };
    for (size, zero) in [(1.0, 0.0), (1.0, 0.5), (1e-9, -3e-9), (1e6, 4e7)] {
        desk.write("bundle/a.csv", run(0.0, size));
        desk.write("bundle/b.csv", run(zero, size));
        let entries = entry("a.csv", None, "estimation") + &entry("b.csv", None, "validation");
        desk.write("bundle/experiment.toml", head(10.0) + &entries);
        let out = desk.lpv("identify bundle -o model.json --force");
        let said = String::from_utf8(out.stdout).unwrap();
        let first = said.lines().next().unwrap_or_default();
        let named =
            first.contains("b, column `y`: lies") && first.contains("without this constant the error is 0.");
        assert_eq!(named, zero != 0.0, "zero {zero:e} of {size:e}: {first}");
    }
    let a = desk.bytes("bundle/a.csv");
    desk.write("bundle/b.csv", a);
    let said = String::from_utf8(desk.lpv("identify bundle -o model.json --force").stdout).unwrap();
    assert!(
        said.starts_with("do not use") && said.contains("the same samples stand in a"),
        "{said}"
    );
}
