//! The closed loop while the carriage moves: p = x1(t), continuous in time.

mod record;

use crate::error::{finite, positive};
use crate::filter::Filter;
use crate::noise::NoiseStream;
use crate::plant::{Plant, Rounding};
use crate::{
    ControllerSettings, DigitalController, Discretisation, HiddenEffect, Machine, Noise, PlantError,
    Setpoint, VerifiedController, discretise,
};
use lpv_core::{Purpose, Record};
use record::record;
use serde::{Deserialize, Serialize};

/// Settings of an experiment with moving p, unchecked; [`MovingExperiment::new`] checks them.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `noise` | the paper's | noise of the sensors of y' | standard deviations >= 0 |
/// | `seed` | 0 | seed of the noise | |
/// | `servo_bandwidth_hz` | 0.5 | bandwidth of the servo of x1 | > 0, well below Nyquist |
/// | `tolerance` | 1e-9 | with effects, largest difference of y' (m, rad) between two runs, the second with twice the sub-steps | > 0 |
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MovingSettings {
    /// Noise of the sensors.
    pub noise: Noise,
    /// Seed of the noise. Records with equal seeds and equal starts share their noise, so give each its own.
    pub seed: u64,
    /// Bandwidth of the servo of x1.
    pub servo_bandwidth_hz: f64,
    /// Accuracy of the integration with effects; without them it is that of rounding.
    pub tolerance: f64,
}

impl Default for MovingSettings {
    fn default() -> Self {
        Self {
            noise: Noise::default(),
            seed: 0,
            servo_bandwidth_hz: 0.5,
            tolerance: 1e-9,
        }
    }
}

/// Setpoints of the three loops, of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Setpoints {
    /// Of y'_1, m.
    pub y1: Setpoint,
    /// Of y'_2, rad.
    pub y2: Setpoint,
    /// Of x1, m; within the stroke.
    pub x1: Setpoint,
    /// Known signals added to the controller's outputs, m/s² and rad/s²; `None` adds nothing.
    pub injection: Option<[Vec<f64>; 2]>,
}

/// All signals of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovingSample {
    /// Measured outputs, with noise.
    pub outputs: [f64; 2],
    /// Plant inputs, injection included, held until the next sample.
    pub inputs: [f64; 2],
    /// Setpoints of y'.
    pub references: [f64; 2],
    /// The carriage's position.
    pub position: f64,
}

/// How the accuracy was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegrationAccount {
    /// Steps a sample of the run that was kept, or most of them.
    pub substeps: usize,
    /// Estimated error of an output: with effects (Runge-Kutta, order 4) the largest difference to the run with half as many
    /// steps over 15; no smaller than the rounding of the outputs, which is all that the series of the machine as it is leave.
    pub estimated_error: f64,
    /// Runs made.
    pub runs: usize,
}

/// A record with the account of its integration.
#[derive(Debug, Clone, PartialEq)]
pub struct MovingRun {
    /// Outputs, inputs, references, scheduling p and injection; kind transient.
    pub record: Record,
    /// Sub-steps and error.
    pub account: IntegrationAccount,
}

/// A closed loop along setpoints of y'_1, y'_2 and x1, ready to run.
///
/// All controllers are digital with inputs held between samples; T_u(p) and T_y(p) follow p between samples. x1 has its
/// own servo: the default rule times the mass, and the acceleration of the setpoint fed forward. The run starts at rest
/// on the first setpoints.
#[derive(Debug, Clone)]
pub struct MovingExperiment<'a> {
    machine: &'a Machine,
    controller: &'a VerifiedController,
    servo: DigitalController,
    setpoints: Setpoints,
    settings: MovingSettings,
    effects: Vec<HiddenEffect>,
    noise_stream: u64,
    /// `[y'_1, y'_2]` before the first sample.
    start: [f64; 2],
}

const MOST_SUBSTEPS: usize = 1024;

impl<'a> MovingExperiment<'a> {
    /// Checks that everything fits.
    ///
    /// # Errors
    /// [`PlantError::Length`] for setpoints of different lengths or without samples, [`PlantError::NotFinite`],
    /// [`PlantError::Position`] if a setpoint of x1 is outside the stroke, [`PlantError::Setting`].
    pub fn new(
        machine: &'a Machine,
        controller: &'a VerifiedController,
        setpoints: Setpoints,
        settings: MovingSettings,
    ) -> Result<Self, PlantError> {
        settings.noise.check()?;
        positive("tolerance", settings.tolerance)?;
        positive("servo_bandwidth_hz", settings.servo_bandwidth_hz)?;
        let samples = setpoints.x1.len();
        if samples == 0 {
            return Err(PlantError::Length {
                what: "setpoint of x1",
                expected: 1,
                found: 0,
            });
        }
        let injected = setpoints
            .injection
            .iter()
            .flatten()
            .map(|c| ("injection", c.as_slice()));
        let signals = [
            ("setpoint of y'_1", setpoints.y1.position()),
            ("setpoint of y'_2", setpoints.y2.position()),
            ("setpoint of x1", setpoints.x1.position()),
            ("velocity of the setpoint of x1", setpoints.x1.velocity()),
        ];
        for (what, signal) in signals.into_iter().chain(injected) {
            finite(what, signal)?;
            if signal.len() != samples {
                return Err(PlantError::Length {
                    what,
                    expected: samples,
                    found: signal.len(),
                });
            }
        }
        for &position in setpoints.x1.position() {
            machine.check_position(position)?;
        }
        let rule = ControllerSettings {
            bandwidth_hz: settings.servo_bandwidth_hz,
            ..ControllerSettings::default()
        };
        let sampled = discretise(&rule.design()?, controller.clock(), Discretisation::ZeroOrderHold)?;
        let servo = DigitalController::from_state_space(&sampled)?;
        let start = [setpoints.y1.position()[0], setpoints.y2.position()[0]];
        Ok(Self {
            machine,
            controller,
            servo,
            start,
            setpoints,
            settings,
            effects: Vec::new(),
            noise_stream: NoiseStream::MOVING,
        })
    }

    /// The same experiment on a machine with these effects. Controllers, decoupling and feed-forward stay the nominal ones.
    ///
    /// # Errors
    /// [`PlantError::EffectTwice`].
    pub fn with_effects(mut self, effects: &[HiddenEffect]) -> Result<Self, PlantError> {
        self.effects = HiddenEffect::in_order(effects)?;
        Ok(self)
    }

    /// As an experiment at constant position starts: at rest at zero, with the noise of that experiment.
    pub(crate) fn starting_at_zero(mut self, experiment: u64) -> Self {
        self.noise_stream = experiment;
        self.start = [0.0; 2];
        self
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.setpoints.x1.len()
    }
    /// Never: there is at least one sample.
    pub fn is_empty(&self) -> bool {
        self.setpoints.x1.is_empty()
    }
    /// The settings.
    pub fn settings(&self) -> &MovingSettings {
        &self.settings
    }

    /// Simulates the machine as it is by Taylor series up to rounding, in one run; with effects, with 1, 2, 4, ... sub-steps a
    /// sample until two successive runs agree within the tolerance.
    ///
    /// Sensors that round make no finer step agree better, so the sub-steps are chosen without their rounding.
    ///
    /// # Errors
    /// [`PlantError::Integration`] if 1024 sub-steps are not enough; [`PlantError::LeftStroke`],
    /// [`PlantError::Diverged`].
    pub fn run(&self, name: &str, purpose: Purpose) -> Result<MovingRun, PlantError> {
        let (samples, account) = self.integrate()?;
        Ok(MovingRun {
            record: record(name, purpose, &samples, self.setpoints.injection.as_ref()),
            account,
        })
    }

    /// The samples of [`MovingExperiment::run`].
    pub(crate) fn integrate(&self) -> Result<(Vec<MovingSample>, IntegrationAccount), PlantError> {
        let mut substeps = 1;
        let mut coarse = self.collect(substeps, Rounding::Off);
        let plant = self.plant();
        if plant.is_plain() {
            let (samples, substeps) = coarse?;
            let account = IntegrationAccount {
                substeps,
                estimated_error: rounding(&samples),
                runs: 1,
            };
            return Ok((samples, account));
        }
        let mut runs = 1;
        loop {
            substeps *= 2;
            runs += 1;
            let fine = self.collect(substeps, Rounding::Off);
            // A step too coarse for the resonances may diverge or leave the stroke; only the finer run's word counts.
            let difference = match (&coarse, &fine) {
                (Ok((a, _)), Ok((b, _))) => difference(a, b),
                (Err(_), Err(error)) if runs > 9 => return Err(error.clone()),
                _ => f64::INFINITY,
            };
            if difference <= self.settings.tolerance {
                let (mut samples, _) = fine?;
                let mut account = IntegrationAccount {
                    substeps,
                    estimated_error: (difference / 15.0).max(rounding(&samples)),
                    runs,
                };
                if plant.rounds() {
                    account.runs += 1;
                    (samples, _) = self.collect(substeps, Rounding::Sensor)?;
                }
                return Ok((samples, account));
            }
            if substeps >= MOST_SUBSTEPS {
                fine?;
                return Err(PlantError::Integration {
                    difference,
                    substeps,
                    tolerance: self.settings.tolerance,
                });
            }
            coarse = fine;
        }
    }

    fn plant(&self) -> Plant {
        let start = [self.setpoints.x1.position()[0], self.start[0], self.start[1]];
        Plant::new(
            self.machine,
            &self.effects,
            self.controller.clock().sample_time(),
            start,
        )
    }

    /// Simulates with a given number of sub-steps a sample, or more for the series of the machine as it is, and hands over sample
    /// by sample; no error control with effects.
    ///
    /// # Errors
    /// What `sink` returns; [`PlantError::Setting`] for 0 or more than 1024 sub-steps, [`PlantError::LeftStroke`],
    /// [`PlantError::Diverged`], [`PlantError::Stiff`].
    pub fn stream<E: From<PlantError>>(
        &self,
        substeps: usize,
        sink: &mut dyn FnMut(MovingSample) -> Result<(), E>,
    ) -> Result<(), E> {
        self.simulate(substeps, Rounding::Sensor, sink).map(|_| ())
    }

    /// Most sub-steps that a sample took.
    fn simulate<E: From<PlantError>>(
        &self,
        substeps: usize,
        rounding: Rounding,
        sink: &mut dyn FnMut(MovingSample) -> Result<(), E>,
    ) -> Result<usize, E> {
        if !(1..=MOST_SUBSTEPS).contains(&substeps) {
            let problem = "give 1 to 1024 sub-steps a sample";
            return Err(PlantError::Setting {
                field: "substeps",
                value: substeps as f64,
                problem,
            }
            .into());
        }
        let Setpoints {
            y1,
            y2,
            x1,
            injection,
        } = &self.setpoints;
        let t = self.controller.clock().sample_time();
        let half_stroke_m = self.machine.parameters().half_stroke_m;
        let mass = self.machine.parameters().servo_mass_kg;
        let mut noise = NoiseStream::new(
            self.settings.noise,
            self.settings.seed,
            x1.position()[0],
            self.noise_stream,
        );
        let [mut k1, mut k2] = [0, 1].map(|i: usize| Filter::new(&self.controller.digital()[i]));
        let mut servo = Filter::new(&self.servo);
        let (mut plant, mut most) = (self.plant(), substeps);
        for k in 0..self.len() {
            let p = plant.position();
            if !plant.is_finite() {
                return Err(PlantError::Diverged { sample: k }.into());
            }
            if p.abs() > half_stroke_m * (1.0 + 1e-9) {
                return Err(PlantError::LeftStroke {
                    sample: k,
                    position: p,
                    half_stroke_m,
                }
                .into());
            }
            let outputs = plant.measure(noise.pair(), rounding);
            let references = [y1.position()[k], y2.position()[k]];
            let mut inputs = [
                k1.next(references[0] - outputs[0]),
                k2.next(references[1] - outputs[1]),
            ];
            if let Some(injected) = injection {
                inputs = [inputs[0] + injected[0][k], inputs[1] + injected[1][k]];
            }
            // The mean acceleration until the next sample, so that the velocity meets the setpoint's there.
            let next = (k + 1).min(self.len() - 1);
            let forward = (x1.velocity()[next] - x1.velocity()[k]) / t;
            let f_x = mass * (forward + servo.next(x1.position()[k] - p));
            sink(MovingSample {
                outputs,
                inputs,
                references,
                position: p,
            })?;
            let steps = plant.advance(f_x, inputs, substeps);
            most = most.max(steps.ok_or(PlantError::Stiff { sample: k })?);
        }
        Ok(most)
    }

    /// The samples, and most sub-steps that one took.
    fn collect(&self, substeps: usize, rounding: Rounding) -> Result<(Vec<MovingSample>, usize), PlantError> {
        let mut samples = Vec::with_capacity(self.len());
        let most = self.simulate(substeps, rounding, &mut |sample| -> Result<(), PlantError> {
            samples.push(sample);
            Ok(())
        })?;
        Ok((samples, most))
    }
}

/// What rounding takes from the largest output.
fn rounding(samples: &[MovingSample]) -> f64 {
    let outputs = samples.iter().flat_map(|s| s.outputs);
    f64::EPSILON * outputs.fold(0.0_f64, |m, y| m.max(y.abs()))
}

/// Largest difference of a measured output; the noise is the same in both runs and cancels.
fn difference(a: &[MovingSample], b: &[MovingSample]) -> f64 {
    a.iter()
        .zip(b)
        .flat_map(|(a, b)| [0, 1].map(|i: usize| (a.outputs[i] - b.outputs[i]).abs()))
        .fold(0.0, f64::max)
}
