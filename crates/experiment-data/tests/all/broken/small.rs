//! A small correct bundle of two CSV records, and ways to break it.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use std::path::Path;

pub const PERIOD: usize = 40;
pub const ROWS: usize = 3 * PERIOD;

/// The description of the correct bundle: one periodic and one transient record, CSV.
pub const TOML: &str = r#"format = 1
name = "small"
sample_rate = 20.0

[channels.output]
columns = ["y1", "y2"]
units = ["m", "rad"]
scale = [2.0, 1.0]

[channels.input]
columns = ["u1", "u2"]

[channels.reference]
columns = ["r1", "r2"]

[channels.scheduling]
columns = ["p"]

[controller]
reference_numerator = [1.0, -0.5]
feedback_numerator = [[1.0, -0.5], [2.0, 0.0]]
denominator = [1.0, -0.9]
limit = 100.0

[geometry]
force_from_input = [[[1.0, 0.0], [1.0, 2.0]], [[0.5, 0.0], [0.0, 0.0]]]
motor_from_output = [[1.0, -0.5], [1.0, 0.5]]

[[records]]
file = "records/grid.csv"
kind = "periodic"
period = 40
use = "estimation"

[[records]]
file = "records/move.csv"
kind = "transient"
use = "validation"
injection = { columns = ["pulse"], scale = [3.0] }
"#;

/// Columns of the correct bundle: u1, u2, y1, y2, r1, r2, p, pulse.
pub fn value(column: &str, k: usize) -> f64 {
    let t = std::f64::consts::TAU * k as f64 / PERIOD as f64;
    let s = |line: f64, phase: f64| (line * t + phase).sin();
    match column {
        "u1" => s(3.0, 0.1) + s(7.0, 1.0),
        "u2" => s(3.0, 2.1) - s(7.0, 0.4),
        "y1" => 0.3 * s(3.0, 0.7) + 0.1 * s(7.0, 0.2),
        "y2" => 0.2 * s(3.0, 2.7) + 0.2 * s(7.0, 1.2),
        "p" => 0.25,
        "pulse" => f64::from(u8::from(k == 7)),
        _ => 0.0,
    }
}

pub const COLUMNS: [&str; 8] = ["u1", "u2", "y1", "y2", "r1", "r2", "p", "pulse"];

pub fn csv_with(change: impl Fn(&str, usize, f64) -> String) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for k in 0..ROWS {
        let row: Vec<String> = COLUMNS.iter().map(|c| change(c, k, value(c, k))).collect();
        text += &(row.join(",") + "\n");
    }
    text
}

pub fn csv() -> String {
    csv_with(|_, _, v| v.to_string())
}

/// Writes the correct bundle into a folder.
pub fn write(dir: &Path) {
    std::fs::create_dir_all(dir.join("records")).unwrap();
    put(dir, "experiment.toml", TOML);
    put(dir, "records/grid.csv", csv());
    put(dir, "records/move.csv", csv());
}

pub fn put(dir: &Path, file: &str, content: impl AsRef<[u8]>) {
    std::fs::write(dir.join(file), content).unwrap();
}

/// The correct bundle, its description with one text replaced, which must be there.
pub fn edit(dir: &Path, from: &str, to: &str) {
    assert!(TOML.contains(from), "{from}");
    write(dir);
    put(dir, "experiment.toml", TOML.replacen(from, to, 1));
}

/// The correct bundle with another first record.
pub fn grid(dir: &Path, content: impl AsRef<[u8]>) {
    write(dir);
    put(dir, "records/grid.csv", content);
}

/// The correct bundle with one column of the first record changed.
pub fn grid_column(dir: &Path, column: &str, change: impl Fn(usize, f64) -> f64) {
    let one = |c: &str, k, v| if c == column { change(k, v) } else { v };
    grid(dir, csv_with(|c, k, v| one(c, k, v).to_string()));
}

/// The correct bundle with one cell of the first record (row from 0) in other words.
pub fn grid_cell(dir: &Path, column: &str, row: usize, text: &str) {
    let cell = |c: &str, k, v: f64| {
        if (c, k) == (column, row) {
            text.to_owned()
        } else {
            v.to_string()
        }
    };
    grid(dir, csv_with(cell));
}
