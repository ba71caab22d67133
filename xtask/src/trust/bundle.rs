//! Bundles of a case, written as an engineer would: tables of text and a description.

use super::TaskError;
use super::loops::{Controller, Signals};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Columns with names, all of one length.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table(pub(crate) Vec<(String, Vec<f64>)>);

impl Table {
    /// One more column.
    pub(crate) fn with(mut self, name: &str, values: &[f64]) -> Self {
        self.0.push((name.to_owned(), values.to_vec()));
        self
    }
    /// `y1, y2 ...`, `u1 ...`, `r1 ...` of what was simulated; without numbers where there is one of a kind.
    pub(crate) fn of(signals: &Signals) -> Self {
        let mut table = Self::default();
        for (letter, group) in [("y", &signals.y), ("u", &signals.u), ("r", &signals.r)] {
            for (i, values) in group.iter().enumerate() {
                let name = match group.len() {
                    1 => letter.to_owned(),
                    _ => format!("{letter}{}", i + 1),
                };
                table.0.push((name, values.clone()));
            }
        }
        table
    }
    /// The column of a name, to be changed.
    pub(crate) fn column(&mut self, name: &str) -> Result<&mut Vec<f64>, TaskError> {
        let found = self.0.iter_mut().find(|(n, _)| n == name);
        Ok(&mut found.ok_or_else(|| format!("no column {name}"))?.1)
    }
    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.0.iter().map(|(_, v)| v.len()).min().unwrap_or(0)
    }
    /// A header and a row a sample, between `separator`, numbers with `decimal`.
    pub(crate) fn text(&self, separator: char, decimal: char) -> String {
        let names: Vec<&str> = self.0.iter().map(|(n, _)| n.as_str()).collect();
        format!(
            "{}\n{}",
            names.join(&separator.to_string()),
            self.body(separator, decimal)
        )
    }
    /// The rows alone.
    pub(crate) fn body(&self, separator: char, decimal: char) -> String {
        let mut out = String::new();
        for row in 0..self.rows() {
            for (i, (_, values)) in self.0.iter().enumerate() {
                if i > 0 {
                    out.push(separator);
                }
                let number = number(values[row]);
                match decimal {
                    '.' => out.push_str(&number),
                    other => out.push_str(&number.replace('.', &other.to_string())),
                }
            }
            out.push('\n');
        }
        out
    }
    /// Writes a CSV file with commas.
    pub(crate) fn write(&self, file: &Path) -> Result<(), TaskError> {
        Ok(std::fs::write(file, self.text(',', '.'))?)
    }
}

/// The shortest decimal of a number; of many digits in exponent form.
pub(crate) fn number(value: f64) -> String {
    let plain = format!("{value}");
    let short = format!("{value:e}");
    if plain.len() <= short.len() { plain } else { short }
}

/// What a description says.
#[derive(Debug, Clone, Default)]
pub(crate) struct Description {
    pub(crate) rate: f64,
    pub(crate) outputs: Vec<String>,
    pub(crate) inputs: Vec<String>,
    pub(crate) references: Vec<String>,
    pub(crate) scheduling: Vec<String>,
    pub(crate) controller: Option<Controller>,
    records: Vec<String>,
}

impl Description {
    /// One input and one output, `u` and `y`.
    pub(crate) fn single(rate: f64) -> Self {
        Self::new(rate, &["y"], &["u"])
    }
    /// Outputs and inputs by name.
    pub(crate) fn new(rate: f64, outputs: &[&str], inputs: &[&str]) -> Self {
        let owned = |names: &[&str]| names.iter().map(ToString::to_string).collect();
        Self {
            rate,
            outputs: owned(outputs),
            inputs: owned(inputs),
            ..Self::default()
        }
    }
    /// With a reference `r` (or `r1, r2 ...`).
    pub(crate) fn referred(mut self, names: &[&str]) -> Self {
        self.references = names.iter().map(ToString::to_string).collect();
        self
    }
    /// With a column of positions.
    pub(crate) fn scheduled(mut self, name: &str) -> Self {
        self.scheduling = vec![name.to_owned()];
        self
    }
    /// With the controller of the loop.
    pub(crate) fn controlled(mut self, controller: &Controller) -> Self {
        self.controller = Some(controller.clone());
        self
    }
    /// A periodic record.
    pub(crate) fn periodic(mut self, file: &str, period: usize, is_held_out: bool) -> Self {
        self.records.push(format!(
            "[[records]]\nfile = \"{file}\"\nkind = \"periodic\"\nperiod = {period}\nuse = \"{}\"\n",
            purpose(is_held_out)
        ));
        self
    }
    /// A record without periods.
    pub(crate) fn transient(mut self, file: &str, is_held_out: bool) -> Self {
        self.records.push(format!(
            "[[records]]\nfile = \"{file}\"\nkind = \"transient\"\nuse = \"{}\"\n",
            purpose(is_held_out)
        ));
        self
    }
    /// The text of `experiment.toml`.
    pub(crate) fn text(&self) -> String {
        let mut out = format!("format = 1\nname = \"case\"\nsample_rate = {:?}\n\n", self.rate);
        let groups = [
            ("output", &self.outputs),
            ("input", &self.inputs),
            ("reference", &self.references),
            ("scheduling", &self.scheduling),
        ];
        for (name, columns) in groups.iter().filter(|(_, c)| !c.is_empty()) {
            // Writing to a string does not fail.
            let _ = writeln!(out, "[channels.{name}]\ncolumns = {columns:?}\n");
        }
        out.push_str(&self.controller.as_ref().map_or(String::new(), Controller::table));
        self.records.iter().for_each(|r| {
            out.push('\n');
            out.push_str(r);
        });
        out
    }
    /// Writes it into a folder.
    pub(crate) fn write(&self, folder: &Path) -> Result<PathBuf, TaskError> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("experiment.toml"), self.text())?;
        Ok(folder.to_owned())
    }
}

fn purpose(is_held_out: bool) -> &'static str {
    if is_held_out { "validation" } else { "estimation" }
}
