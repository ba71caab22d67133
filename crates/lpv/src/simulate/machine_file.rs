//! The file that describes a machine and what is measured on it.

use crate::PipelineError;
use crate::settings_file::{place_of, read_settings};
use serde::{Deserialize, Serialize};
use std::path::Path;
use xytable_plant::{
    ControllerSettings, Lines, MachineParameters, MoveKind, MoveSettings, MultisineSettings, Noise,
    PlantError,
};

/// A machine and what is measured on it; every key has a default, listed by [`MachineFile::template`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MachineFile {
    /// Name of the bundle.
    pub name: String,
    /// Samples a unit of time.
    pub sample_rate: f64,
    /// Seed of every random choice and of the noise.
    pub seed: u64,
    /// Whether a second signal that moves by itself is measured beside the rest.
    pub second_signal: bool,
    /// Masses, springs, sizes.
    pub machine: MachineParameters,
    /// Rule of both controllers of y'.
    pub controller: ControllerSettings,
    /// The servo of x1.
    pub servo: ServoFile,
    /// Where the multisine experiments are made.
    pub positions: PositionsFile,
    /// The multisine experiments.
    pub multisine: MultisineFile,
    /// Noise of the sensors.
    pub noise: NoiseFile,
    /// How many moves of which kind.
    pub moves: MovesFile,
    /// What the moves do.
    pub setpoints: MoveSettings,
}

/// The servo of x1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ServoFile {
    /// Bandwidth, Hz.
    pub bandwidth_hz: f64,
}

/// Constant positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PositionsFile {
    /// Equidistant positions over the stroke.
    pub count: usize,
    /// These positions instead, m; empty for `count`.
    pub values: Vec<f64>,
}

/// The multisine experiments, two a position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MultisineFile {
    /// Samples a period.
    pub period: usize,
    /// Periods a record, from rest.
    pub periods: usize,
    /// Excited lines.
    pub lines: Lines,
    /// Peak of the references, m and rad.
    pub amplitude: f64,
    /// Most steps of crest reduction.
    pub crest_iterations: usize,
}

/// Standard deviations of the sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct NoiseFile {
    /// Of y'_1.
    pub y1_std_m: f64,
    /// Of y'_2.
    pub y2_std_rad: f64,
}

/// How many moves of which kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MovesFile {
    /// Moves to fit.
    pub estimation: usize,
    /// Moves held out.
    pub validation: usize,
    /// Kinds, in turn; each use starts with the first.
    pub kinds: Vec<MoveKind>,
}

impl Default for MachineFile {
    fn default() -> Self {
        Self {
            name: "simulated machine".to_owned(),
            sample_rate: 20.0,
            seed: 0,
            second_signal: false,
            machine: MachineParameters::default(),
            controller: ControllerSettings::default(),
            servo: ServoFile::default(),
            positions: PositionsFile::default(),
            multisine: MultisineFile::default(),
            noise: NoiseFile::default(),
            moves: MovesFile::default(),
            setpoints: MoveSettings::default(),
        }
    }
}

impl Default for ServoFile {
    fn default() -> Self {
        Self { bandwidth_hz: 0.5 }
    }
}

impl Default for PositionsFile {
    fn default() -> Self {
        Self {
            count: 9,
            values: Vec::new(),
        }
    }
}

impl Default for MultisineFile {
    fn default() -> Self {
        Self {
            period: 2048,
            periods: 6,
            lines: Lines::Band { first: 1, last: 614 },
            amplitude: 3.5e-3,
            crest_iterations: 50,
        }
    }
}

impl Default for NoiseFile {
    fn default() -> Self {
        Self {
            y1_std_m: 3.3e-8,
            y2_std_rad: 1.7e-6,
        }
    }
}

impl Default for MovesFile {
    fn default() -> Self {
        Self {
            estimation: 5,
            validation: 3,
            kinds: vec![MoveKind::Sweep, MoveKind::BackAndForth, MoveKind::Wander],
        }
    }
}

impl MultisineFile {
    pub(super) fn settings(&self, seed: u64) -> MultisineSettings {
        MultisineSettings {
            period: self.period,
            lines: self.lines.clone(),
            amplitude: self.amplitude,
            inputs: 2,
            crest_iterations: self.crest_iterations,
            seed: xytable_plant::split_seed(seed, "multisine"),
        }
    }
}

impl NoiseFile {
    pub(super) fn noise(&self) -> Noise {
        Noise::Normal {
            y1_std_m: self.y1_std_m,
            y2_std_rad: self.y2_std_rad,
        }
    }
}

const MOST_RECORDS: usize = 10_000;
/// Of a multisine record: two of them with 8 channels of 8 bytes are half a gibibyte.
const MOST_SAMPLES: usize = 1 << 22;
/// Of a move, whose integration keeps more beside the record.
const MOST_MOVED: usize = 1 << 21;

impl MachineFile {
    /// Reads a TOML file; keys that are left out have their defaults.
    ///
    /// # Errors
    /// [`PipelineError::Config`] with file, line and column, and for an unknown key the nearest known one.
    pub fn read(file: &Path) -> Result<Self, PipelineError> {
        read_settings(file)
    }

    /// An error of the simulation in the words of the file that this was read from: which key, and where it stands.
    pub fn explain(&self, file: &Path, error: PipelineError) -> PipelineError {
        let PipelineError::Plant(error) = error else {
            return error;
        };
        let PlantError::Setting {
            field,
            value,
            problem,
        } = error
        else {
            let message = match error {
                PlantError::Core(e) => format!(
                    "at sample-rate = {} the closed loop of this machine cannot be computed, because its numbers lie too far apart ({e}); \
                     bring sample-rate, [controller] bandwidth-hz and the resonances of [machine] nearer to each other",
                    self.sample_rate
                ),
                e => e.to_string(),
            };
            return PipelineError::Config {
                file: file.to_owned(),
                message,
            };
        };
        let keys = self.keys_of(field, value);
        let key = match keys.as_slice() {
            [] => field.to_owned(),
            [table, rest @ ..] if !rest.is_empty() => format!("[{table}] {}", rest.join(".")),
            plain => plain.join("."),
        };
        PipelineError::Value {
            place: place_of(file, &keys.iter().map(String::as_str).collect::<Vec<_>>()),
            key,
            value,
            problem: problem.to_owned(),
        }
    }

    /// The keys behind a field, outermost first: of those with its name the one that holds the value.
    fn keys_of(&self, field: &str, value: f64) -> Vec<String> {
        let wanted = match field {
            "fraction of the stroke" => "stroke-fraction".to_owned(),
            "moves" => "moves.estimation".to_owned(),
            field => field.replace('_', "-"),
        };
        let mut all = Vec::new();
        if let Ok(whole) = toml::Table::try_from(self) {
            leaves(&whole, &mut Vec::new(), &mut all);
        }
        let is_named = |keys: &[String]| {
            (0..keys.len()).any(|k| keys[k..].join(".") == wanted || keys[k..].join("-") == wanted)
        };
        all.retain(|(keys, _)| is_named(keys));
        let holds = |v: &toml::Value| match v {
            toml::Value::Array(items) => items.iter().any(|v| number(v) == Some(value)),
            v => number(v) == Some(value),
        };
        let found = all.iter().find(|(_, v)| holds(v)).or(all.first());
        found.map(|(keys, _)| keys.clone()).unwrap_or_default()
    }

    /// A file with every key, its default and what it means: the default machine.
    pub fn template() -> &'static str {
        TEMPLATE
    }

    /// What the plant cannot check, because it sees one experiment at a time.
    pub(super) fn check(&self) -> Result<(), PlantError> {
        let within = |field, value: usize, most: usize, problem| {
            if (1..=most).contains(&value) {
                return Ok(());
            }
            Err(PlantError::Setting {
                field,
                value: value as f64,
                problem,
            })
        };
        if !(self.sample_rate.is_finite() && self.sample_rate > 0.0) {
            return Err(PlantError::Setting {
                field: "sample-rate",
                value: self.sample_rate,
                problem: "give a finite number above zero",
            });
        }
        let positions = self.positions.count.max(self.positions.values.len());
        within(
            "positions.count",
            positions,
            MOST_RECORDS,
            "give 1 to 10,000 positions",
        )?;
        let moves = self.moves.estimation.saturating_add(self.moves.validation);
        within("moves", moves.max(1), MOST_RECORDS, "give at most 10,000 moves")?;
        let (kinds, samples) = (self.moves.kinds.len(), self.multisine.period);
        if moves > 0 {
            within("moves.kinds", kinds, MOST_RECORDS, "list at least one kind")?;
        }
        if self.multisine.periods < 2 {
            return Err(PlantError::Setting {
                field: "multisine.periods",
                value: self.multisine.periods as f64,
                problem: "give 2 or more periods",
            });
        }
        // The plant refuses a period of less than two samples.
        if samples.saturating_mul(self.multisine.periods) > MOST_SAMPLES {
            return Err(PlantError::Setting {
                field: "multisine.periods",
                value: self.multisine.periods as f64,
                problem: "with `period` these are more than 4,194,304 samples a record, which are half a gibibyte of memory a \
                          position; give fewer periods or shorter ones",
            });
        }
        let least = usize::from(moves > 0);
        within(
            "setpoints.samples",
            (self.setpoints.samples * least).max(1),
            MOST_MOVED,
            "give at most 2,097,152 samples a move, which is half a gibibyte of memory",
        )
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|i| i as f64))
}

/// Every value with its keys.
fn leaves(table: &toml::Table, above: &mut Vec<String>, found: &mut Vec<(Vec<String>, toml::Value)>) {
    for (key, value) in table {
        above.push(key.clone());
        match value {
            toml::Value::Table(inner) => leaves(inner, above, found),
            value => found.push((above.clone(), value.clone())),
        }
        above.pop();
    }
}

/// Kept by a test against the fields and the defaults.
const TEMPLATE: &str = include_str!("default_machine.toml");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_has_every_key_with_a_comment_and_its_default() {
        let read: MachineFile = toml::from_str(TEMPLATE).unwrap();
        assert_eq!(read, MachineFile::default());
        let printed = toml::to_string(&MachineFile::default()).unwrap();
        let keys = |text: &str| -> Vec<String> {
            let key = |l: &str| l.split_once(" = ").map(|(key, _)| key.to_owned());
            let mut keys: Vec<String> = text
                .lines()
                .filter(|l| !l.starts_with('#'))
                .filter_map(key)
                .collect();
            keys.sort();
            keys
        };
        let full: toml::Table = toml::from_str(TEMPLATE).unwrap();
        let default: toml::Table = toml::from_str(&printed).unwrap();
        assert_eq!(full, default, "a key is missing");
        assert!(keys(TEMPLATE).len() > 30);
        for (line, before) in TEMPLATE.lines().skip(1).zip(TEMPLATE.lines()) {
            assert!(
                !line.contains(" = ") || line.starts_with('#') || before.starts_with('#'),
                "{line} has no comment"
            );
        }
    }

    #[test]
    fn an_empty_file_is_the_default_machine() {
        assert_eq!(toml::from_str::<MachineFile>("").unwrap(), MachineFile::default());
    }
}
