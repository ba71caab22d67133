//! What the tests of the program share: a folder of their own, the program in it, signals, and bundles.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "a test that cannot be set up must fail, and no test needs all of this"
)]

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, Model, StateSpace};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
#[cfg(unix)]
use std::process::Child;
use std::process::{Command, Output};

/// A temporary folder in which the program runs, so that relative paths mean files of the test.
pub struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file; folders on the way are made.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub fn model(&self, name: &str) -> Model {
        Model::from_json(&self.text(name)).unwrap()
    }

    pub fn write_model(&self, name: &str, model: &Model) {
        self.write(name, model.to_json().unwrap());
    }

    /// Every file below the folder with its bytes.
    pub fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        files(self.folder.path())
    }

    /// The program in this folder, ready to run.
    pub fn program<S: AsRef<OsStr>>(&self, words: &[S]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lpv"));
        command.args(words).current_dir(self.folder.path());
        command
    }

    /// Runs `lpv` with the words of a line.
    pub fn lpv(&self, line: &str) -> Output {
        let words: Vec<&str> = line.split_whitespace().collect();
        self.program(&words).output().unwrap()
    }

    /// What a run that succeeds prints; it says nothing on standard error, where no terminal is.
    pub fn done(&self, line: &str) -> String {
        stdout_of(line, &self.lpv(line))
    }

    /// The same, parsed.
    pub fn json(&self, line: &str) -> serde_json::Value {
        serde_json::from_str(&self.done(line)).unwrap()
    }

    /// The output of a run whose result may be found wanting: exit code 0 or 3.
    pub fn judged(&self, line: &str) -> String {
        let out = self.lpv(line);
        let message = String::from_utf8_lossy(&out.stderr);
        assert!(matches!(out.status.code(), Some(0 | 3)), "lpv {line}: {message}");
        assert_eq!(message, "", "lpv {line}");
        String::from_utf8(out.stdout).unwrap()
    }

    /// The one message of a run that is refused: exit code 2, and nothing on standard output.
    pub fn refused(&self, line: &str) -> String {
        message_of(line, &self.lpv(line))
    }
}

pub fn stdout_of(line: &str, out: &Output) -> String {
    let message = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(0), "lpv {line}: {message}");
    assert_eq!(message, "", "lpv {line}");
    String::from_utf8(out.stdout.clone()).unwrap()
}

pub fn message_of(line: &str, out: &Output) -> String {
    let message = String::from_utf8(out.stderr.clone()).unwrap();
    assert_eq!(out.status.code(), Some(2), "lpv {line}: {message}");
    assert!(out.stdout.is_empty(), "lpv {line}");
    let errors = message.lines().filter(|l| l.starts_with("error:")).count();
    assert!(
        message.starts_with("error: ") && errors == 1,
        "lpv {line}: {message}"
    );
    assert!(!message.contains("panicked"), "lpv {line}: {message}");
    message
}

/// Every file below a folder with its bytes, by its path within.
pub fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(part) = open.pop() {
        for entry in std::fs::read_dir(part).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if entry.file_type().unwrap().is_dir() {
                open.push(path);
            } else {
                // What cannot be read, such as a link to nowhere, is still there.
                let bytes = if path.is_file() {
                    std::fs::read(&path).unwrap_or_default()
                } else {
                    Vec::new()
                };
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), bytes);
            }
        }
    }
    found
}

/// The number at a JSON pointer.
#[track_caller]
pub fn number(value: &serde_json::Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(serde_json::Value::as_f64);
    assert!(found.is_some(), "{pointer} is no number in {value:#}");
    found.unwrap()
}

/// Bundles of others: measured, and from an independent simulator.
pub fn shared(name: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if folder.exists() {
        return folder.canonicalize().ok();
    }
    eprintln!("skipped: {} is missing", folder.display());
    None
}

/// Normal numbers of deviation 1 from a seed: SplitMix64, and the transform of Box and Muller.
pub struct Noise(pub u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn sample(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }

    pub fn samples(&mut self, count: usize, deviation: f64) -> Vec<f64> {
        (0..count).map(|_| deviation * self.sample()).collect()
    }
}

/// Cosines of amplitude 1 at these lines (cycles a period), with phases that spread their power.
pub fn multisine(lines: impl Iterator<Item = usize> + Clone, period: usize, samples: usize) -> Vec<f64> {
    let one: Vec<f64> = (0..period)
        .map(|n| {
            let angle = |k: usize| std::f64::consts::TAU * ((k * n) % period) as f64 / period as f64;
            lines
                .clone()
                .map(|k| (angle(k) + 2.0 * (k * k) as f64).cos())
                .sum()
        })
        .collect();
    one.into_iter().cycle().take(samples).collect()
}

/// A CSV file of columns.
pub fn csv(columns: &[(&str, &[f64])]) -> String {
    let names: Vec<&str> = columns.iter().map(|c| c.0).collect();
    let mut text = names.join(",") + "\n";
    for n in 0..columns[0].1.len() {
        let row: Vec<String> = columns.iter().map(|c| c.1[n].to_string()).collect();
        text += &(row.join(",") + "\n");
    }
    text
}

/// The head of a description with one input and one output, `u` and `y`.
pub fn head(sample_rate: f64) -> String {
    format!(
        "format = 1\nname = \"test\"\nsample_rate = {sample_rate:?}\n[channels.output]\ncolumns = [\"y\"]\n\
         [channels.input]\ncolumns = [\"u\"]\n"
    )
}

/// The entry of a record; `period` only for a periodic one.
pub fn entry(file: &str, period: Option<usize>, purpose: &str) -> String {
    let kind = match period {
        Some(period) => format!("kind = \"periodic\"\nperiod = {period}\n"),
        None => "kind = \"transient\"\n".to_owned(),
    };
    format!("[[records]]\nfile = \"{file}\"\n{kind}use = \"{purpose}\"\n")
}

/// A mode with the poles 0.9 +- 0.3 i, at 10 samples a unit of time.
pub fn mode() -> StateSpace<Discrete> {
    let clock = Discrete::from_rate(10.0).unwrap();
    let (a, b, c) = (
        dmatrix![0.9, -0.3; 0.3, 0.9],
        dmatrix![1.0; 0.0],
        dmatrix![0.0, 1.0],
    );
    StateSpace::new(a, b, c, dmatrix![0.0], clock).unwrap()
}

/// Output of a system of one input and one output from rest.
pub fn response(system: &StateSpace<Discrete>, u: &[f64]) -> Vec<f64> {
    let rest = DVector::zeros(system.states());
    let u = DMatrix::from_row_slice(1, u.len(), u);
    system
        .simulate(&rest, &u)
        .unwrap()
        .outputs
        .iter()
        .copied()
        .collect()
}

/// Samples a period of [`mode_record`].
pub const PERIOD: usize = 256;

/// Input and output of the mode: five periods of a multisine, a little noise on the output.
pub fn mode_record() -> (Vec<f64>, Vec<f64>) {
    let u = multisine(1..100, PERIOD, 5 * PERIOD);
    let mut noise = Noise(1);
    let y = response(&mode(), &u)
        .into_iter()
        .map(|y| y + 1e-6 * noise.sample())
        .collect();
    (u, y)
}

/// A bundle with the mode's record as CSV.
pub fn mode_bundle(desk: &Desk, folder: &str) {
    let (u, y) = mode_record();
    desk.write(&format!("{folder}/run.csv"), csv(&[("u", &u), ("y", &y)]));
    let toml = head(10.0) + &entry("run.csv", Some(PERIOD), "estimation");
    desk.write(&format!("{folder}/experiment.toml"), toml);
}

/// A machine file of five positions, near enough to each other for few functions of the position, and two moves between
/// them; it takes a tenth of a second to simulate.
pub const MACHINE: &str = r#"
seed = 11
positions = { values = [-0.06, -0.03, 0.0, 0.03, 0.06] }
multisine = { period = 512, periods = 8, amplitude = 1e-3, lines = { band = { first = 1, last = 120 } } }
moves = { estimation = 1, validation = 1, kinds = ["back-and-forth"] }
setpoints = { samples = 800, stroke-fraction = 0.19 }
"#;

/// Writes the bundle of [`MACHINE`] into the folder `bundle`.
pub fn machine_bundle(desk: &Desk) {
    desk.write("machine.toml", MACHINE);
    desk.done("simulate --machine machine.toml -o bundle");
}

/// Sends a signal, such as `-INT`.
#[cfg(unix)]
pub fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([name, &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success(), "{name}");
}

/// Identifies a bundle of responses, and asks for modes of these frequencies, within a part in a thousand.
pub fn has_modes(desk: &Desk, bundle: &str, wanted_hz: impl IntoIterator<Item = f64>) {
    let text = desk.done(&format!("identify {bundle} -o model.json --force"));
    let told = text.lines().filter_map(|l| l.trim().split_once(" Hz, damping"));
    let hz: Vec<f64> = told.filter_map(|(hz, _)| hz.parse().ok()).collect();
    for wanted in wanted_hz {
        assert!(
            hz.iter().any(|f| (f / wanted - 1.0).abs() < 1e-3),
            "{wanted} Hz in {text}"
        );
    }
}
