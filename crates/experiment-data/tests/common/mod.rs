//! A small correct bundle that tests damage.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use experiment_data::{Bundle, DataError};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

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

pub struct Small {
    pub dir: TempDir,
}

impl Small {
    pub fn new() -> Self {
        let small = Self {
            dir: tempfile::tempdir().unwrap(),
        };
        std::fs::create_dir(small.path().join("records")).unwrap();
        small.put("experiment.toml", TOML);
        small.put("records/grid.csv", csv());
        small.put("records/move.csv", csv());
        small
    }
    pub fn path(&self) -> &Path {
        self.dir.path()
    }
    pub fn put(&self, file: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(file);
        std::fs::write(&path, content).unwrap();
        path
    }
    /// The description with one text replaced, which must be there.
    pub fn edit(&self, from: &str, to: &str) {
        assert!(TOML.contains(from), "{from}");
        self.put("experiment.toml", TOML.replacen(from, to, 1));
    }
    pub fn open(&self) -> Result<Bundle, DataError> {
        Bundle::open(self.path())
    }
    /// The text of the error of opening.
    pub fn open_error(&self) -> String {
        self.open().map(|_| ()).unwrap_err().to_string()
    }
    /// The text of the error of loading record 0.
    pub fn load_error(&self) -> String {
        self.open().unwrap().load(0).map(|_| ()).unwrap_err().to_string()
    }
}
