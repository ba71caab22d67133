//! Bundles from the simulated machine: what an engineer would have measured on it, written as measured bundles are.
//!
//! The identification never sees this module's machine: the two meet in files only. A bundle says nothing about hidden
//! effects.

mod batch;
mod machine_file;

pub use machine_file::{MachineFile, MovesFile, MultisineFile, NoiseFile, PositionsFile, ServoFile};

use crate::PipelineError;
use crate::output::{Unfinished, place_all};
use experiment_data::{BundleWriter, ChannelGroup, Description, RecordFormat};
use lpv_core::{Controller, Discrete, Geometry, Purpose, Record, RecordKind, Signals};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xytable_plant::{
    Experiment, ExperimentSettings, HiddenEffect, Machine, MoveKind, MovingExperiment, MovingSettings,
    Multisine, PlantError, VerifiedController, second_signal, split_seed,
};

/// What was simulated.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SimulateAccount {
    /// The bundle's folder.
    #[serde(serialize_with = "crate::account::path")]
    pub bundle: PathBuf,
    /// Records written.
    pub records: usize,
    /// Samples over all records.
    pub samples: usize,
    /// Periods until the transient of the start is below a tenth of the noise; 0 without periodic records.
    pub transient_periods: usize,
    /// Spectral radius of the closed loop over the stroke: transients fade by this factor a sample.
    pub spectral_radius: f64,
    /// Most steps of the integration a sample over the moves.
    pub substeps: usize,
    /// Largest estimated error of the integration over the moves, m or rad.
    pub integration_error: f64,
}

/// What several threads share while they simulate.
struct Setup<'a> {
    file: &'a MachineFile,
    hidden: &'a [HiddenEffect],
    machine: Machine,
    controller: VerifiedController,
    clock: Discrete,
    multisine: Multisine,
}

/// A piece of work that makes one or two records.
enum Job {
    Grid {
        index: usize,
        position: f64,
    },
    Move {
        index: usize,
        kind: MoveKind,
        purpose: Purpose,
    },
}

/// Records of one job, with the sub-steps and the error of their integration.
struct Simulated {
    records: Vec<Record>,
    substeps: usize,
    error: f64,
}

/// Simulates the machine of `file` with the `hidden` effects and writes the bundle `out`.
///
/// Two multisine experiments at each position, from rest, then moves. Positions and moves are simulated in parallel and
/// written in order: the same file gives the same bytes for any number of threads. `progress` hears the number of
/// records written and of all.
///
/// # Errors
/// [`PipelineError::Plant`] for settings out of range, [`PipelineError::Data`] if the folder has a bundle already or
/// cannot be written.
pub fn simulate(
    file: &MachineFile,
    hidden: &[HiddenEffect],
    out: &Path,
    format: RecordFormat,
    progress: &dyn Fn(usize, usize),
) -> Result<SimulateAccount, PipelineError> {
    let setup = Setup::new(file, hidden)?;
    let jobs = setup.jobs()?;
    let records: usize = jobs.iter().map(Job::records).sum();
    let mut account = SimulateAccount {
        bundle: out.to_owned(),
        records: 0,
        samples: 0,
        transient_periods: setup.transient_periods(),
        spectral_radius: setup.controller.robustness().spectral_radius(),
        substeps: 0,
        integration_error: 0.0,
    };
    // Whatever the plant refuses, it refuses before there is a folder.
    jobs.iter().try_for_each(|job| setup.check(job))?;
    let (mut writer, unfinished) = Unfinished::begin(
        || BundleWriter::create(out, setup.description(), format),
        |writer| {
            let (stage, made) = writer.unfinished();
            [stage]
                .into_iter()
                .chain(made.iter().rev().map(PathBuf::as_path))
                .map(Path::to_owned)
                .collect()
        },
    )?;
    let mut left = jobs.as_slice();
    while !left.is_empty() {
        let (batch, rest) = left.split_at(batch::size(left, file));
        left = rest;
        let results: Vec<Result<Simulated, PlantError>> =
            batch.par_iter().map(|job| setup.run(job)).collect();
        for result in results {
            let simulated = result?;
            account.substeps = account.substeps.max(simulated.substeps);
            account.integration_error = account.integration_error.max(simulated.error);
            for mut record in simulated.records {
                setup.add_second_signal(&mut record);
                unfinished.add(|| writer.write(&record))?;
                account.records += 1;
                account.samples += record.len();
                progress(account.records, records);
            }
        }
    }
    place_all(|| writer.finish())?;
    drop(unfinished);
    Ok(account)
}

/// The moves for estimation of a machine with nothing hidden in it.
#[derive(Debug)]
pub struct CleanMoves<'a> {
    file: &'a MachineFile,
    records: Vec<Record>,
}

impl<'a> CleanMoves<'a> {
    /// # Errors
    /// [`PipelineError::Plant`] for settings out of range.
    pub fn new(file: &'a MachineFile) -> Result<Self, PipelineError> {
        let records = first_moves(file, &[])?;
        Ok(Self { file, records })
    }

    /// Largest root mean square over the moves by which effects change an output, in units of its sensor's noise.
    ///
    /// # Errors
    /// [`PipelineError::Plant`] for effects out of range.
    pub fn deviation(&self, hidden: &[HiddenEffect]) -> Result<f64, PipelineError> {
        let changed = first_moves(self.file, hidden)?;
        let mut sums = [(0.0, 0_usize); 2];
        for (a, b) in changed.iter().zip(&self.records) {
            for ((a, b), (sum, count)) in a.outputs.columns.iter().zip(&b.outputs.columns).zip(&mut sums) {
                *sum += a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
                *count += a.len();
            }
        }
        let noise = self.file.noise.noise().deviations();
        let root = |((sum, count), noise): ((f64, usize), f64)| (sum / count.max(1) as f64).sqrt() / noise;
        Ok(sums.into_iter().zip(noise).map(root).fold(0.0, f64::max))
    }
}

/// The moves for estimation, the first of each kind.
fn first_moves(file: &MachineFile, hidden: &[HiddenEffect]) -> Result<Vec<Record>, PipelineError> {
    let setup = Setup::new(file, hidden)?;
    let kinds = &file.moves.kinds[..file.moves.estimation.min(file.moves.kinds.len())];
    let moved: Result<Vec<Simulated>, PlantError> = kinds
        .par_iter()
        .enumerate()
        .map(|(index, &kind)| setup.moving(&move_name(index), kind, Purpose::Estimation))
        .collect();
    Ok(moved?.into_iter().flat_map(|m| m.records).collect())
}

impl Job {
    fn records(&self) -> usize {
        match self {
            Self::Grid { .. } => 2,
            Self::Move { .. } => 1,
        }
    }
}

impl<'a> Setup<'a> {
    fn new(file: &'a MachineFile, hidden: &'a [HiddenEffect]) -> Result<Self, PipelineError> {
        file.check()?;
        let machine = file.machine.check()?;
        let clock = Discrete::from_rate(file.sample_rate)?;
        Ok(Self {
            file,
            hidden,
            machine,
            controller: VerifiedController::by_rule(&machine, &file.controller, clock)?,
            clock,
            multisine: file.multisine.settings(file.seed).check()?,
        })
    }

    fn jobs(&self) -> Result<Vec<Job>, PlantError> {
        let PositionsFile { count, values } = &self.file.positions;
        let positions = match values.as_slice() {
            [] => self.machine.positions(*count),
            given => given.to_vec(),
        };
        let mut jobs = Vec::new();
        for (index, position) in positions.into_iter().enumerate() {
            let position = self.machine.check_position(position)?;
            jobs.push(Job::Grid { index, position });
        }
        let moves = &self.file.moves;
        let uses = [
            (moves.estimation, Purpose::Estimation),
            (moves.validation, Purpose::Validation),
        ];
        let mut index = 0;
        for (count, purpose) in uses {
            for &kind in moves.kinds.iter().cycle().take(count) {
                jobs.push(Job::Move { index, kind, purpose });
                index += 1;
            }
        }
        Ok(jobs)
    }

    fn run(&self, job: &Job) -> Result<Simulated, PlantError> {
        match *job {
            Job::Grid { index, position } => self.grid(index, position),
            Job::Move { index, kind, purpose } => self.moving(&move_name(index), kind, purpose),
        }
    }

    fn check(&self, job: &Job) -> Result<(), PlantError> {
        match *job {
            Job::Grid { position, .. } => self.experiment(position).map(drop),
            Job::Move { index, kind, .. } => self.moving_experiment(&move_name(index), kind).map(drop),
        }
    }

    fn experiment(&self, position: f64) -> Result<Experiment<'_>, PlantError> {
        let settings = ExperimentSettings {
            periods: self.file.multisine.periods,
            noise: self.file.noise.noise(),
            seed: split_seed(self.file.seed, "grid"),
            ..ExperimentSettings::default()
        };
        Experiment::new(
            &self.machine,
            &self.controller,
            &self.multisine,
            position,
            settings,
        )?
        .with_effects(self.hidden)
    }

    fn moving_experiment(&self, name: &str, kind: MoveKind) -> Result<MovingExperiment<'_>, PlantError> {
        let seed = split_seed(self.file.seed, name);
        let settings = MovingSettings {
            noise: self.file.noise.noise(),
            seed,
            servo_bandwidth_hz: self.file.servo.bandwidth_hz,
            ..MovingSettings::default()
        };
        let setpoints = &self.file.setpoints;
        let setpoints = setpoints.setpoints(kind, &self.machine, self.clock, seed)?;
        MovingExperiment::new(&self.machine, &self.controller, setpoints, settings)?.with_effects(self.hidden)
    }

    fn grid(&self, index: usize, position: f64) -> Result<Simulated, PlantError> {
        let mut records =
            ["a", "b"].map(|letter| self.empty_record(&format!("grid{index:02}{letter}"), position));
        self.experiment(position)?
            .run(&mut |block| -> Result<(), PlantError> {
                let record = &mut records[block.experiment];
                for (signals, columns) in [
                    (&mut record.outputs, block.outputs),
                    (&mut record.inputs, block.inputs),
                    (&mut record.references, block.references),
                ] {
                    for (to, from) in signals.columns.iter_mut().zip(columns) {
                        to.extend_from_slice(from);
                    }
                }
                record.scheduling.columns[0].resize(record.outputs.len(), position);
                Ok(())
            })?;
        Ok(Simulated {
            records: records.into(),
            substeps: 0,
            error: 0.0,
        })
    }

    fn empty_record(&self, name: &str, position: f64) -> Record {
        let samples = self.multisine.period() * self.file.multisine.periods;
        let column = || Vec::with_capacity(samples);
        let signals = |group: &[&str]| Signals::new(group, group.iter().map(|_| column()).collect());
        Record {
            name: name.to_owned(),
            kind: RecordKind::Periodic {
                period: self.multisine.period(),
            },
            purpose: Purpose::Estimation,
            position: Some(position.into()),
            outputs: signals(&OUTPUTS),
            inputs: signals(&INPUTS),
            references: signals(&REFERENCES),
            scheduling: signals(&SCHEDULING),
            auxiliary: Signals::default(),
            injection: Signals::default(),
        }
    }

    fn moving(&self, name: &str, kind: MoveKind, purpose: Purpose) -> Result<Simulated, PlantError> {
        let run = self.moving_experiment(name, kind)?.run(name, purpose)?;
        Ok(Simulated {
            substeps: run.account.substeps,
            error: run.account.estimated_error,
            records: vec![run.record],
        })
    }

    fn add_second_signal(&self, record: &mut Record) {
        if self.file.second_signal {
            let t = self.clock.sample_time();
            let values = (0..record.len()).map(|k| second_signal(k as f64 * t)).collect();
            record.auxiliary = Signals::new(&AUXILIARY, vec![values]);
        }
    }

    fn transient_periods(&self) -> usize {
        let amplitude = self.file.multisine.amplitude;
        let [y1, y2] = self.file.noise.noise().deviations();
        // Without noise, down to the last digits of the signals.
        let target = (0.1 * y1.min(y2)).max(1e-14 * amplitude);
        let samples = (target / amplitude).ln() / self.controller.robustness().spectral_radius().ln();
        (samples / self.multisine.period() as f64).ceil().max(0.0) as usize
    }

    /// What an engineer would write next to these records.
    fn description(&self) -> Description {
        let group = |columns: &[&str], units: [&str; 2]| ChannelGroup {
            units: units
                .iter()
                .take(columns.len())
                .map(ToString::to_string)
                .collect(),
            ..ChannelGroup::new(columns)
        };
        let mut description = Description::new(&self.file.name, self.file.sample_rate, &OUTPUTS, &INPUTS);
        let channels = &mut description.channels;
        channels.output = group(&OUTPUTS, ["m", "rad"]);
        channels.input = group(&INPUTS, ["m/s^2", "rad/s^2"]);
        channels.reference = group(&REFERENCES, ["m", "rad"]);
        channels.scheduling = group(&SCHEDULING, ["m", ""]);
        if self.file.second_signal {
            channels.auxiliary = ChannelGroup::new(&AUXILIARY);
        }
        let digital = self.controller.digital();
        let numerator: Vec<Vec<f64>> = digital.iter().map(|k| k.numerator().to_vec()).collect();
        description.controller = Some(Controller {
            reference_numerator: numerator.clone(),
            feedback_numerator: numerator,
            denominator: digital.iter().map(|k| k.denominator().to_vec()).collect(),
            limit: None,
        });
        let half_beam = self.machine.parameters().half_beam_m;
        let terms = self.machine.input_decoupling();
        description.geometry = Some(Geometry {
            force_from_input: terms
                .iter()
                .map(|t| (0..2).map(|i| (0..2).map(|j| t[(i, j)]).collect()).collect())
                .collect(),
            motor_from_output: vec![vec![1.0, -half_beam], vec![1.0, half_beam]],
        });
        description
    }
}

fn move_name(index: usize) -> String {
    format!("move{index}")
}

const OUTPUTS: [&str; 2] = ["y1", "y2"];
const INPUTS: [&str; 2] = ["u1", "u2"];
const REFERENCES: [&str; 2] = ["r1", "r2"];
const SCHEDULING: [&str; 1] = ["p"];
const AUXILIARY: [&str; 1] = ["height"];
