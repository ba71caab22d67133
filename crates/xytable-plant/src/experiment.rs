//! Multisine experiments at constant p, streamed period by period.

use crate::continuous_loop::ContinuousLoop;
use crate::digital_loop::{DigitalLoop, ExperimentSignals, LoopState};
use crate::noise::NoiseStream;
use crate::separation::Separation;
use crate::{
    HiddenEffect, Machine, MovingExperiment, MovingSample, MovingSettings, Multisine, Noise, PlantError,
    Setpoint, Setpoints, Since, VerifiedController,
};
use lpv_core::PeriodBlock;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Where the controller runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoopKind {
    /// Digital controller, plant input held between samples: the sampled plant is exact.
    #[default]
    Digital,
    /// Continuous controller; only r and v are held. The input moves between the samples that record it, so an FRF from
    /// these records has an inter-sample error.
    Continuous,
}

/// Settings of an experiment, unchecked; [`Experiment::new`] checks them.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `periods` | 25 | periods of the multisine, from rest | 1 or more |
/// | `noise` | the paper's | noise of the sensors | standard deviations >= 0 |
/// | `loop_kind` | digital | where the controller runs | |
/// | `seed` | 0 | seed of the noise | |
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExperimentSettings {
    /// Periods an experiment.
    pub periods: usize,
    /// Noise of the sensors.
    pub noise: Noise,
    /// Where the controller runs.
    pub loop_kind: LoopKind,
    /// Seed of the noise. Equal seeds at equal positions give equal noise.
    pub seed: u64,
}

impl Default for ExperimentSettings {
    fn default() -> Self {
        Self {
            periods: 25,
            noise: Noise::default(),
            loop_kind: LoopKind::default(),
            seed: 0,
        }
    }
}

/// What was simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentAccount {
    /// Position of the carriage.
    pub position: f64,
    /// Number of experiments.
    pub experiments: usize,
    /// Closed-loop samples over all experiments.
    pub samples: usize,
    /// Spectral radius of the closed loop over the whole stroke: transients fade by this factor a sample.
    pub spectral_radius: f64,
}

/// The two orthogonal multisine experiments of one position, ready to run.
///
/// With references r, noise v and controllers `K`: `yhat = y' + v` (11) is recorded and fed back, `u' = K (r - yhat)`.
#[derive(Debug, Clone)]
pub struct Experiment<'a> {
    machine: &'a Machine,
    controller: &'a VerifiedController,
    position: f64,
    settings: ExperimentSettings,
    references: [[Vec<f64>; 2]; 2],
    effects: Option<Vec<HiddenEffect>>,
}

/// Memory of one experiment: outputs, inputs and references of the current period.
struct Buffers {
    outputs: [Vec<f64>; 2],
    inputs: [Vec<f64>; 2],
}

impl Buffers {
    fn new(period: usize) -> Self {
        let zeros = || [vec![0.0; period], vec![0.0; period]];
        Self {
            outputs: zeros(),
            inputs: zeros(),
        }
    }

    fn signals<'a>(&'a mut self, references: &'a [Vec<f64>; 2]) -> ExperimentSignals<'a> {
        let [y1, y2] = &mut self.outputs;
        let [u1, u2] = &mut self.inputs;
        ExperimentSignals {
            references: [&references[0], &references[1]],
            outputs: [y1, y2],
            inputs: [u1, u2],
        }
    }
}

const MOST_ORDER: usize = 8;

/// Periods of one experiment that are handed on in a row, as whoever averages them takes two short ones at a time.
const IN_A_ROW: usize = 2;

impl<'a> Experiment<'a> {
    /// Checks that everything fits.
    ///
    /// # Errors
    /// [`PlantError::Position`], [`PlantError::Length`] (a multisine that is not for two inputs),
    /// [`PlantError::Setting`], [`PlantError::ControllerOrder`] (at most 8).
    pub fn new(
        machine: &'a Machine,
        controller: &'a VerifiedController,
        multisine: &Multisine,
        position: f64,
        settings: ExperimentSettings,
    ) -> Result<Self, PlantError> {
        let position = machine.check_position(position)?;
        settings.noise.check()?;
        if multisine.inputs() != 2 {
            return Err(PlantError::Length {
                what: "inputs of the multisine",
                expected: 2,
                found: multisine.inputs(),
            });
        }
        if settings.periods == 0 {
            return Err(PlantError::Setting {
                field: "periods",
                value: 0.0,
                problem: "give at least 1",
            });
        }
        for (index, k) in controller.digital().iter().enumerate() {
            if k.order() > MOST_ORDER {
                return Err(PlantError::ControllerOrder {
                    index,
                    order: k.order(),
                    most: MOST_ORDER,
                });
            }
        }
        let signals = |experiment| -> Result<[Vec<f64>; 2], PlantError> {
            Ok([multisine.signal(experiment, 0)?, multisine.signal(experiment, 1)?])
        };
        let references = [signals(0)?, signals(1)?];
        Ok(Self {
            machine,
            controller,
            position,
            settings,
            references,
            effects: None,
        })
    }

    /// The same experiments on a machine with those of the effects that are there since the grid.
    ///
    /// With one, the exact sampled plant gives way to the simulation in steps of [`MovingExperiment`] with its
    /// default tolerance, p held; memory then grows with the number of periods.
    ///
    /// # Errors
    /// [`PlantError::EffectsNeedDigitalLoop`], [`PlantError::EffectTwice`].
    pub fn with_effects(mut self, effects: &[HiddenEffect]) -> Result<Self, PlantError> {
        let mut effects = HiddenEffect::in_order(effects)?;
        effects.retain(|e| e.info().since == Since::Grid);
        if !effects.is_empty() && self.settings.loop_kind == LoopKind::Continuous {
            return Err(PlantError::EffectsNeedDigitalLoop);
        }
        self.effects = (!effects.is_empty()).then_some(effects);
        Ok(self)
    }

    /// Position of the carriage.
    pub fn position(&self) -> f64 {
        self.position
    }
    /// The settings.
    pub fn settings(&self) -> &ExperimentSettings {
        &self.settings
    }
    /// Samples a period.
    pub fn period(&self) -> usize {
        self.references[0][0].len()
    }

    /// Simulates from rest and hands each period to `sink`, two of experiment 0, then the same of experiment 1, and so on. Memory
    /// does not grow with the number of periods.
    ///
    /// # Errors
    /// What `sink` returns; [`PlantError::NotStable`] for a continuous loop that is not stable although its sampled
    /// version is; [`PlantError::Diverged`] if signals stop being finite; [`PlantError::Integration`] with effects.
    pub fn run<E: From<PlantError>>(
        &self,
        sink: &mut dyn FnMut(PeriodBlock<'_>) -> Result<(), E>,
    ) -> Result<ExperimentAccount, E> {
        if let Some(effects) = &self.effects {
            return self.run_hidden(effects, sink);
        }
        let clock = self.controller.clock();
        let order = self
            .controller
            .digital()
            .iter()
            .map(|k| k.order())
            .max()
            .unwrap_or(0);
        match self.settings.loop_kind {
            LoopKind::Continuous => {
                let plant = self.machine.frozen(self.position)?;
                let model = ContinuousLoop::new(&plant, self.controller, clock, self.position)?;
                let mut states: [DVector<f64>; 2] = [model.rest(), model.rest()];
                self.stream(sink, &mut |experiments| {
                    for (x, signals) in states.iter_mut().zip(experiments) {
                        model.run(x, signals);
                    }
                })
            }
            LoopKind::Digital if order <= 4 => self.run_digital::<4, E>(sink),
            LoopKind::Digital => self.run_digital::<MOST_ORDER, E>(sink),
        }
    }

    fn run_hidden<E: From<PlantError>>(
        &self,
        effects: &[HiddenEffect],
        sink: &mut dyn FnMut(PeriodBlock<'_>) -> Result<(), E>,
    ) -> Result<ExperimentAccount, E> {
        let period = self.period();
        let simulated = [self.integrate(effects, 0)?, self.integrate(effects, 1)?];
        let periods = self.settings.periods;
        for first in (0..periods).step_by(IN_A_ROW) {
            for (experiment, channels) in simulated.iter().enumerate() {
                for index in first..periods.min(first + IN_A_ROW) {
                    let [outputs, inputs] = [0, 2].map(|group| {
                        [0, 1].map(|i| channels[group + i][index * period..][..period].to_vec())
                    });
                    sink(PeriodBlock {
                        experiment,
                        period: index,
                        outputs: &outputs,
                        inputs: &inputs,
                        references: &self.references[experiment],
                    })?;
                }
            }
        }
        Ok(self.account())
    }

    /// Outputs, then inputs, of one experiment by integration.
    fn integrate(&self, effects: &[HiddenEffect], experiment: usize) -> Result<[Vec<f64>; 4], PlantError> {
        let clock = self.controller.clock();
        let samples = self.period() * self.settings.periods;
        let repeat = |r: &[f64]| Setpoint::from_positions(r.repeat(self.settings.periods), clock);
        let [r1, r2] = &self.references[experiment];
        let setpoints = Setpoints {
            y1: repeat(r1)?,
            y2: repeat(r2)?,
            x1: Setpoint::constant(self.position, samples),
            injection: None,
        };
        let settings = MovingSettings {
            noise: self.settings.noise,
            seed: self.settings.seed,
            ..MovingSettings::default()
        };
        let (samples, _) = MovingExperiment::new(self.machine, self.controller, setpoints, settings)?
            .with_effects(effects)?
            .starting_at_zero(experiment as u64)
            .integrate()?;
        Ok([0, 1, 2, 3].map(|channel| {
            let value = |s: &MovingSample| [s.outputs, s.inputs].as_flattened()[channel];
            samples.iter().map(value).collect()
        }))
    }

    fn run_digital<const N: usize, E: From<PlantError>>(
        &self,
        sink: &mut dyn FnMut(PeriodBlock<'_>) -> Result<(), E>,
    ) -> Result<ExperimentAccount, E> {
        let plant = Separation::new(self.machine, self.position).sampled(self.controller.clock())?;
        let model = DigitalLoop::<N>::new(plant, self.controller.digital());
        let mut state = LoopState::<N>::new();
        self.stream(sink, &mut |experiments| model.run(&mut state, experiments))
    }

    fn stream<E: From<PlantError>>(
        &self,
        sink: &mut dyn FnMut(PeriodBlock<'_>) -> Result<(), E>,
        advance: &mut dyn FnMut(&mut [ExperimentSignals<'_>; 2]),
    ) -> Result<ExperimentAccount, E> {
        let period = self.period();
        let Self {
            settings, position, ..
        } = self;
        let mut noise = [0, 1].map(|e| NoiseStream::new(settings.noise, settings.seed, *position, e));
        let mut memory = [0; IN_A_ROW].map(|_| [Buffers::new(period), Buffers::new(period)]);
        for first in (0..settings.periods).step_by(IN_A_ROW) {
            let some = IN_A_ROW.min(settings.periods - first);
            for (both, index) in memory[..some].iter_mut().zip(first..) {
                for (stream, m) in noise.iter_mut().zip(&mut *both) {
                    let [one, other] = &mut m.outputs;
                    stream.fill(one, other);
                }
                let [one, other] = both;
                advance(&mut [
                    one.signals(&self.references[0]),
                    other.signals(&self.references[1]),
                ]);
                // Every output depends on all that came before, so a divergence shows in the last sample.
                let mut signals = both.iter().flat_map(|m| m.outputs.iter().chain(&m.inputs));
                if !signals.all(|c| c[period - 1].is_finite()) {
                    let sample = (index + 1) * period;
                    return Err(PlantError::Diverged { sample }.into());
                }
            }
            for experiment in [0, 1] {
                for (both, index) in memory[..some].iter().zip(first..) {
                    sink(PeriodBlock {
                        experiment,
                        period: index,
                        outputs: &both[experiment].outputs,
                        inputs: &both[experiment].inputs,
                        references: &self.references[experiment],
                    })?;
                }
            }
        }
        Ok(self.account())
    }

    fn account(&self) -> ExperimentAccount {
        ExperimentAccount {
            position: self.position,
            experiments: 2,
            samples: 2 * self.period() * self.settings.periods,
            spectral_radius: self.controller.robustness().spectral_radius(),
        }
    }
}
