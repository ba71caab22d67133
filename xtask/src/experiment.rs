//! The simulated experiments of Sec. III-C and IV-B, and the FRF estimates of Sec. IV-C.

use crate::TaskError;
use crate::size::Size;
use frf_estimation::{
    FrfError, Layout, LineSelection, PeriodicAccumulator, PeriodicEstimate, PeriodicSettings, SkipRule,
    confidence_radius,
};
use indicatif::ProgressBar;
use lpv_core::{Discrete, Frf, FrfEstimate};
use rayon::prelude::*;
use serde::Serialize;
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, LoopKind, Machine, MachineParameters, Multisine,
    MultisineSettings, Noise, PlantError, VerifiedController,
};

/// The machine with its controllers and excitation.
pub(crate) struct Bench {
    pub(crate) machine: Machine,
    pub(crate) controller: VerifiedController,
    pub(crate) clock: Discrete,
    pub(crate) multisine: Multisine,
    pub(crate) positions: Vec<f64>,
    pub(crate) size: Size,
    pub(crate) seed: u64,
}

/// What the experiments gave.
pub(crate) struct Measured {
    /// FRF estimates, one a position.
    pub(crate) estimates: Vec<FrfEstimate>,
    /// Figures on all of them.
    pub(crate) account: FrfAccount,
    /// Error of the FRF with continuous controllers at the first position, by line: what the held-input model misses.
    pub(crate) continuous_error: Vec<(f64, f64)>,
}

/// Figures on the FRF estimates.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct FrfAccount {
    /// Largest relative error of the estimates from noise-free records, all positions and lines.
    pub(crate) noise_free_max_rel: f64,
    /// Share of the channels and lines whose true value lies in the stated 95 % region.
    pub(crate) coverage95: f64,
    /// Median over lines and positions of the relative error with noise.
    pub(crate) median_rel: f64,
    /// Median of the error in the band of the flexible modes, 1 to 3.
    pub(crate) median_rel_modes: f64,
    /// Lines a position.
    pub(crate) lines: usize,
    /// Largest condition number of U R^H.
    pub(crate) worst_condition: f64,
    /// Peak over rms of the multisines.
    pub(crate) crest_factor: f64,
    /// Spectral radius of the closed loop, the largest over p.
    pub(crate) spectral_radius: f64,
    /// Modulus margin, the smallest over p.
    pub(crate) modulus_margin: f64,
    /// Median relative error at the first position where the controllers are continuous and the input is not held.
    pub(crate) continuous_median_rel: f64,
}

/// Periods of the noise-free copies; their transient is gone after two.
const CLEAN_PERIODS: usize = 4;

impl Bench {
    pub(crate) fn new(size: Size, seed: u64) -> Result<Self, TaskError> {
        let machine = MachineParameters::default().check()?;
        let clock = Discrete::from_rate(20.0)?;
        let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock)?;
        let multisine = MultisineSettings {
            period: size.period,
            seed,
            ..MultisineSettings::default()
        }
        .check()?;
        let positions = machine.positions(size.positions);
        Ok(Self {
            machine,
            controller,
            clock,
            multisine,
            positions,
            size,
            seed,
        })
    }

    /// Closed-loop samples of the noisy experiments.
    pub(crate) fn samples(&self) -> usize {
        self.positions.len() * 2 * self.size.periods * self.size.period
    }

    /// The true frozen response.
    pub(crate) fn truth(&self, p: f64, frequencies_hz: &[f64]) -> Result<Frf, TaskError> {
        Ok(self
            .machine
            .sampled(p, self.clock)?
            .frequency_response(frequencies_hz)?)
    }

    fn estimate(
        &self,
        p: f64,
        settings: ExperimentSettings,
        frf: &PeriodicSettings,
    ) -> Result<PeriodicEstimate, TaskError> {
        let experiment = Experiment::new(&self.machine, &self.controller, &self.multisine, p, settings)?;
        let layout = Layout {
            period: self.size.period,
            outputs: 2,
            inputs: 2,
            references: 2,
            experiments: 2,
            sample_rate_hz: 1.0 / self.clock.sample_time(),
        };
        let mut accumulator = PeriodicAccumulator::new(layout, frf, Some(p.into()))?;
        experiment.run::<StreamError>(&mut |block| Ok(accumulator.push(&block)?))?;
        Ok(accumulator.finish()?)
    }

    /// Runs every experiment and estimates every FRF; positions in parallel, results in their order.
    pub(crate) fn run(&self, progress: &ProgressBar) -> Result<Measured, TaskError> {
        let skip = |n| PeriodicSettings {
            skip: SkipRule::Fixed(n),
            lines: LineSelection::All,
            ..PeriodicSettings::default()
        };
        let (noisy, clean) = (skip(self.size.skip), skip(CLEAN_PERIODS / 2));
        let noise_free = ExperimentSettings {
            periods: CLEAN_PERIODS,
            noise: Noise::Off,
            ..ExperimentSettings::default()
        };
        let at = |p: &f64| -> Result<Run, TaskError> {
            let settings = ExperimentSettings {
                periods: self.size.periods,
                seed: self.seed,
                ..ExperimentSettings::default()
            };
            let (found, perfect) = rayon::join(
                || self.estimate(*p, settings, &noisy),
                || self.estimate(*p, noise_free, &clean),
            );
            let (found, perfect) = (found?, perfect?);
            let truth = self.truth(*p, found.estimate.frf().frequencies_hz())?;
            let run = Run::new(found, &truth, perfect.estimate.frf())?;
            progress.inc(1);
            Ok(run)
        };
        let continuous = ExperimentSettings {
            loop_kind: LoopKind::Continuous,
            ..noise_free
        };
        let (runs, held) = rayon::join(
            || self.positions.par_iter().map(at).collect::<Result<Vec<Run>, _>>(),
            || self.estimate(self.positions[0], continuous, &clean),
        );
        let (runs, held) = (runs?, held?);
        let frequencies = held.estimate.frf().frequencies_hz();
        let errors = held
            .estimate
            .frf()
            .relative_error(&self.truth(self.positions[0], frequencies)?)?;
        let continuous_error = frequencies.iter().copied().zip(errors.iter().copied()).collect();
        let largest = |f: fn(&Run) -> f64| runs.iter().map(f).fold(0.0, f64::max);
        let inside: usize = runs.iter().map(|r| r.inside).sum();
        let counted: usize = runs.iter().map(|r| r.counted).sum();
        let account = FrfAccount {
            noise_free_max_rel: largest(|r| r.noise_free),
            coverage95: inside as f64 / counted as f64,
            median_rel: median(runs.iter().flat_map(|r| r.errors.iter().map(|e| e.1)).collect()),
            median_rel_modes: median(
                runs.iter()
                    .flat_map(|r| {
                        r.errors
                            .iter()
                            .filter(|e| (1.0..=3.0).contains(&e.0))
                            .map(|e| e.1)
                    })
                    .collect(),
            ),
            lines: runs[0].estimate.frf().len(),
            worst_condition: largest(|r| r.condition),
            crest_factor: self.multisine.crest_factor(),
            spectral_radius: self.controller.robustness().spectral_radius(),
            modulus_margin: self.controller.robustness().modulus_margin(),
            continuous_median_rel: median(errors),
        };
        Ok(Measured {
            estimates: runs.into_iter().map(|r| r.estimate).collect(),
            account,
            continuous_error,
        })
    }
}

/// Errors of a streamed experiment, from either end of the stream.
#[derive(Debug, thiserror::Error)]
enum StreamError {
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Frf(#[from] FrfError),
}

struct Run {
    estimate: FrfEstimate,
    errors: Vec<(f64, f64)>,
    noise_free: f64,
    condition: f64,
    inside: usize,
    counted: usize,
}

impl Run {
    fn new(found: PeriodicEstimate, truth: &Frf, noise_free: &Frf) -> Result<Self, TaskError> {
        let estimate = found.estimate;
        let frf = estimate.frf();
        let (mut inside, mut counted) = (0, 0);
        for k in 0..frf.len() {
            for i in 0..frf.outputs() {
                for j in 0..frf.inputs() {
                    let error = (frf.line(k)[(i, j)] - truth.line(k)[(i, j)]).norm();
                    inside += usize::from(error <= confidence_radius(&estimate, k, i, j, 0.95));
                    counted += 1;
                }
            }
        }
        let largest = |v: Vec<f64>| v.into_iter().fold(0.0, f64::max);
        let errors = frf
            .frequencies_hz()
            .iter()
            .copied()
            .zip(frf.relative_error(truth)?)
            .collect();
        Ok(Self {
            errors,
            noise_free: largest(noise_free.relative_error(truth)?),
            condition: found.condition.worst,
            inside,
            counted,
            estimate,
        })
    }
}

/// Median; NaN of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
