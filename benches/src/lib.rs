//! Inputs of the benches: exact frozen responses of the default machine with the noise that its experiment would leave.
//!
//! No experiment is simulated. The spectra of the inputs follow from the closed loop, the covariance of an FRF from them
//! and from the sensors, so that sizes, scales and conditioning are those of the real thing and the set-up is short.

pub mod refinement;

use criterion::Criterion;
use frf_estimation::{FrfError, Layout, PeriodicAccumulator, PeriodicSettings, SkipRule};
use lpv_core::nalgebra::{DMatrix, Matrix2};
use lpv_core::num_complex::Complex;
use lpv_core::{CoreError, Discrete, FrfEstimate, Position, StateSpace};
use obf_basis::{BasisError, FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, Weighting};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Duration;
use xytable_plant::{
    ControllerSettings, Machine, MachineParameters, MoveLimits, Noise, PlantError, Profile, Setpoint,
    Setpoints, VerificationSettings, VerifiedController,
};

type C64 = Complex<f64>;

/// Why an input could not be made.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// From the machine.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// From the models.
    #[error(transparent)]
    Core(#[from] CoreError),
    /// From the basis.
    #[error(transparent)]
    Basis(#[from] BasisError),
    /// From the LFR.
    #[error(transparent)]
    Fit(#[from] lfr_fit::FitError),
    /// From the accumulator.
    #[error(transparent)]
    Frf(#[from] FrfError),
    /// The inputs of a line do not excite the plant in every direction.
    #[error("line {line}: the spectra of the inputs are singular")]
    Singular {
        /// Index of the line.
        line: usize,
    },
}

/// The one in the middle, the upper of two; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// What a page says of a bar.
pub fn verdict(is_met: bool) -> &'static str {
    if is_met { "met" } else { "MISSED" }
}

/// How the benches measure: seconds each, since each is there to be compared with itself.
pub fn short() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
}

/// Settings of a pole fit of order twelve to a response without noise.
pub fn twelve_poles() -> PoleFitSettings {
    PoleFitSettings {
        integrators: Integrators::Fixed(2),
        numerator: NumeratorDegree::StrictlyProper,
        weighting: Weighting::Relative,
        ..PoleFitSettings::new(12)
    }
}

/// Samples a unit of time.
const RATE: f64 = 20.0;
/// Peak of the multisines.
const AMPLITUDE: f64 = 1e-4;
/// Peak over rms that a crest reduction reaches.
const CREST: f64 = 1.7;
/// Periods that are averaged.
const PERIODS: usize = 15;

/// The sums of an experiment with as many inputs, outputs, references and repetitions, all periods taken.
///
/// # Errors
/// A period too short to have lines.
pub fn accumulator(
    period: usize,
    channels: usize,
    position: Option<Position>,
) -> Result<PeriodicAccumulator, InputError> {
    let layout = Layout {
        period,
        outputs: channels,
        inputs: channels,
        references: channels,
        experiments: channels,
        sample_rate_hz: RATE,
    };
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(0),
        ..PeriodicSettings::default()
    };
    Ok(PeriodicAccumulator::new(layout, &settings, position)?)
}

/// The default machine in its loop.
#[derive(Debug, Clone)]
pub struct Bench {
    /// The machine.
    pub machine: Machine,
    /// Its clock.
    pub clock: Discrete,
    /// Its controllers.
    pub controller: VerifiedController,
}

impl Bench {
    /// The default machine with the controllers of the default rule.
    ///
    /// # Errors
    /// None for the defaults.
    pub fn new() -> Result<Self, InputError> {
        let machine = MachineParameters::default().check()?;
        let clock = Discrete::from_rate(RATE)?;
        let rule = ControllerSettings::default().design()?;
        let check = VerificationSettings {
            positions: 5,
            frequencies: 50,
            ..VerificationSettings::default()
        };
        let controller = VerifiedController::new(&machine, [rule.clone(), rule], clock, &check)?;
        Ok(Self {
            machine,
            clock,
            controller,
        })
    }

    /// `lines` equidistant lines, all but zero and Nyquist of a period of `2 (lines + 1)` samples.
    pub fn lines_hz(&self, lines: usize) -> Vec<f64> {
        let period = 2.0 * (lines + 1) as f64;
        (1..=lines).map(|k| k as f64 * RATE / period).collect()
    }

    /// Setpoints of so many samples: steps of y'_1 while the carriage crosses its stroke.
    ///
    /// # Errors
    /// None for the default machine.
    pub fn sweep(&self, samples: usize) -> Result<Setpoints, InputError> {
        let limits = |speed: f64| MoveLimits {
            speed,
            acceleration: 0.5 * speed,
            jerk: speed,
        };
        let steps = Profile::at(0.0, limits(0.02))?
            .dwell(5.0)?
            .steps(&[0.05, 0.1, 0.05, 0.0], 12.0)?;
        Ok(Setpoints {
            y1: steps.sample(self.clock, samples),
            y2: Setpoint::constant(0.0, samples),
            x1: Profile::sweep(&self.machine, 0.98, limits(0.01))?.sample(self.clock, samples),
            injection: None,
        })
    }

    /// What orthogonal multisines on `lines` lines give at `position`: the exact response with one draw of its error, and
    /// a covariance that scatters as one from two experiments of fifteen periods does.
    ///
    /// # Errors
    /// A position outside the stroke.
    pub fn estimate(&self, position: f64, lines: usize) -> Result<FrfEstimate, InputError> {
        let frequencies = self.lines_hz(lines);
        let plant = self.machine.sampled(position, self.clock)?;
        let mut frf = plant.frequency_response(&frequencies)?;
        let [k1, k2] = self.controller.sampled();
        let controllers = k1.beside(k2)?.frequency_response(&frequencies)?;

        // Multisines [r, r] and [r, -r] of flat spectrum; noise of the sensors averaged over samples and periods.
        let samples = 2.0 * (lines + 1) as f64;
        let r = AMPLITUDE / CREST / (2.0 * lines as f64).sqrt();
        let references = Matrix2::new(r, r, r, -r).map(C64::from);
        let deviations = Noise::default()
            .deviations()
            .map(|s| s / (samples * PERIODS as f64).sqrt());
        let degrees = 2 * (PERIODS - 1);
        let mut rng = ChaCha8Rng::seed_from_u64(position.to_bits());
        let mut normal = |deviation: f64| {
            let (re, im): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
            C64::new(re, im) * (deviation * std::f64::consts::FRAC_1_SQRT_2)
        };
        let (mut covariance, mut factor) = (Vec::with_capacity(4 * lines), Vec::with_capacity(4 * lines));
        for line in 0..lines {
            let p = Matrix2::from_column_slice(frf.line_slice(line));
            let k = Matrix2::from_column_slice(controllers.line_slice(line));
            let inverse = (Matrix2::identity() + k * p)
                .try_inverse()
                .and_then(|sensitivity| (sensitivity * k * references).try_inverse())
                .ok_or(InputError::Singular { line })?;
            let mut error = Matrix2::zeros();
            let mut scatter = Matrix2::zeros();
            for column in 0..2 {
                error[(0, column)] = normal(deviations[0]);
                error[(1, column)] = normal(deviations[1]);
            }
            for _ in 0..degrees {
                let v = Matrix2::new(
                    normal(deviations[0]),
                    C64::from(0.0),
                    normal(deviations[1]),
                    C64::from(0.0),
                );
                scatter += v * v.adjoint() / C64::from(degrees as f64);
            }
            frf.line_slice_mut(line)
                .copy_from_slice((p + error * inverse).as_slice());
            covariance.extend_from_slice(scatter.as_slice());
            factor.extend_from_slice((inverse.adjoint() * inverse).as_slice());
        }
        Ok(FrfEstimate::new(
            frf,
            covariance,
            factor,
            degrees as f64,
            Some(position.into()),
        )?)
    }

    /// The estimates at `positions` equidistant positions.
    ///
    /// # Errors
    /// As [`Bench::estimate`].
    pub fn estimates(&self, positions: usize, lines: usize) -> Result<Vec<FrfEstimate>, InputError> {
        self.machine
            .positions(positions)
            .into_iter()
            .map(|p| self.estimate(p, lines))
            .collect()
    }

    /// The flexible poles at `positions` equidistant positions.
    ///
    /// # Errors
    /// None for the default machine.
    pub fn observed_poles(&self, positions: usize) -> Result<PoleSet, InputError> {
        let mut poles = Vec::new();
        for p in self.machine.positions(positions) {
            poles.extend(self.machine.sampled_flexible_poles(p, self.clock)?);
        }
        Ok(PoleSet::new(&poles)?)
    }

    /// `functions` orthonormal functions for the flexible poles.
    ///
    /// # Errors
    /// As [`fkcm`].
    pub fn basis(&self, functions: usize) -> Result<StateSpace<Discrete>, InputError> {
        let settings = FkcmSettings {
            starts: 2,
            max_iterations: 50,
            ..FkcmSettings::new(functions)
        };
        let found = fkcm(&self.observed_poles(11)?, &settings)?;
        Ok(OrthonormalBasis::takenaka_malmquist(&found.poles, self.clock)?
            .state_space()
            .clone())
    }

    /// A stable model of `states` states with two inputs and outputs: the frozen plant and basis functions beside it.
    ///
    /// # Errors
    /// As [`Bench::basis`]; fewer than 12 states are refused by it.
    pub fn large_model(&self, states: usize) -> Result<StateSpace<Discrete>, InputError> {
        let plant = self.machine.sampled(0.2, self.clock)?;
        let functions = states.saturating_sub(plant.states());
        let bank = self.basis(functions)?;
        let spread = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |i, j| 1.0 / (1.0 + i as f64 + 2.0 * j as f64))
        };
        let shaped = StateSpace::new(
            bank.a().clone(),
            bank.b() * spread(1, 2),
            spread(2, functions),
            DMatrix::zeros(2, 2),
            self.clock,
        )?;
        Ok(plant.plus(&shaped)?)
    }
}
