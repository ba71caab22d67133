//! Controllers that were checked over the whole stroke, with the account of the check.

use crate::controller::{closed_loop_matrix, diagonal};
use crate::error::positive;
use crate::{ControllerSettings, DigitalController, Discretisation, Machine, PlantError, discretise};
use lpv_core::linalg::eigenvalues;
use lpv_core::{Continuous, Discrete, ResponseKernel, StateSpace};
use nalgebra::{Complex, Matrix2};

/// How a controller is checked, unchecked; [`VerifiedController::new`] checks it.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `discretisation` | zero-order hold | how K(s) becomes digital | |
/// | `positions` | 61 | equidistant positions of the check | 2 to 10,000 |
/// | `frequencies` | 400 | frequencies up to Nyquist, spaced logarithmically over four decades | 2 to 100,000 |
/// | `largest_sensitivity` | 4 | limit of `max sigma_max(S)`; the modulus margin is its inverse | > 1 |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VerificationSettings {
    /// How K(s) becomes digital.
    pub discretisation: Discretisation,
    /// Number of positions.
    pub positions: usize,
    /// Number of frequencies.
    pub frequencies: usize,
    /// Limit of the sensitivity.
    pub largest_sensitivity: f64,
}

impl Default for VerificationSettings {
    fn default() -> Self {
        Self {
            discretisation: Discretisation::default(),
            positions: 61,
            frequencies: 400,
            largest_sensitivity: 4.0,
        }
    }
}

/// What the check found for the sampled closed loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Robustness {
    /// Positions checked.
    pub positions: Vec<f64>,
    /// Spectral radius at each position.
    pub spectral_radii: Vec<f64>,
    /// Largest `sigma_max(S)` at each position, `S = (I + P K)^-1`.
    pub sensitivities: Vec<f64>,
    /// Frequency of the largest sensitivity at each position.
    pub worst_frequencies_hz: Vec<f64>,
}

impl Robustness {
    /// Index of the position with the largest spectral radius.
    pub fn least_stable(&self) -> usize {
        largest(&self.spectral_radii)
    }
    /// Index of the position with the largest sensitivity.
    pub fn least_robust(&self) -> usize {
        largest(&self.sensitivities)
    }
    /// Largest spectral radius over all positions.
    pub fn spectral_radius(&self) -> f64 {
        self.spectral_radii.iter().copied().fold(0.0, f64::max)
    }
    /// Largest sensitivity over all positions.
    pub fn largest_sensitivity(&self) -> f64 {
        self.sensitivities.iter().copied().fold(0.0, f64::max)
    }
    /// Smallest distance from singularity of the return difference, `1 / max sigma_max(S)`.
    pub fn modulus_margin(&self) -> f64 {
        1.0 / self.largest_sensitivity()
    }
}

/// Two SISO controllers that stabilise the sampled plant at every position checked, with a margin.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifiedController {
    continuous: [StateSpace<Continuous>; 2],
    sampled: [StateSpace<Discrete>; 2],
    digital: [DigitalController; 2],
    clock: Discrete,
    robustness: Robustness,
}

impl VerifiedController {
    /// Checks `controllers` (for y'_1 and y'_2) on the sampled plant over the stroke of `machine`.
    ///
    /// # Errors
    /// [`PlantError::NotStable`], [`PlantError::NotRobust`] name the worst position; [`PlantError::Setting`],
    /// [`PlantError::Length`] for settings out of range and controllers that are not SISO.
    pub fn new(
        machine: &Machine,
        controllers: [StateSpace<Continuous>; 2],
        clock: Discrete,
        settings: &VerificationSettings,
    ) -> Result<Self, PlantError> {
        settings.check()?;
        let sampled = [
            discretise(&controllers[0], clock, settings.discretisation)?,
            discretise(&controllers[1], clock, settings.discretisation)?,
        ];
        let digital = [
            DigitalController::from_state_space(&sampled[0])?,
            DigitalController::from_state_space(&sampled[1])?,
        ];
        // The difference equations are checked, not the state spaces they come from: they are what runs.
        let as_run = [digital[0].state_space(clock)?, digital[1].state_space(clock)?];
        let robustness = check(machine, &diagonal(&as_run)?, clock, settings)?;
        let i = robustness.least_stable();
        if robustness.spectral_radii[i] >= 1.0 || robustness.spectral_radii[i].is_nan() {
            return Err(PlantError::NotStable {
                position: robustness.positions[i],
                spectral_radius: robustness.spectral_radii[i],
            });
        }
        let i = robustness.least_robust();
        if robustness.sensitivities[i] > settings.largest_sensitivity {
            return Err(PlantError::NotRobust {
                sensitivity: robustness.sensitivities[i],
                position: robustness.positions[i],
                frequency_hz: robustness.worst_frequencies_hz[i],
                limit: settings.largest_sensitivity,
            });
        }
        Ok(Self {
            continuous: controllers,
            sampled,
            digital,
            clock,
            robustness,
        })
    }

    /// One rule for both loops, checked with the default settings.
    ///
    /// # Errors
    /// As [`VerifiedController::new`] and [`ControllerSettings::design`].
    pub fn by_rule(
        machine: &Machine,
        rule: &ControllerSettings,
        clock: Discrete,
    ) -> Result<Self, PlantError> {
        let k = rule.design()?;
        Self::new(machine, [k.clone(), k], clock, &VerificationSettings::default())
    }

    /// The controllers in continuous time.
    pub fn continuous(&self) -> &[StateSpace<Continuous>; 2] {
        &self.continuous
    }
    /// The sampled controllers as state space.
    pub fn sampled(&self) -> &[StateSpace<Discrete>; 2] {
        &self.sampled
    }
    /// The sampled controllers as difference equations.
    pub fn digital(&self) -> &[DigitalController; 2] {
        &self.digital
    }
    /// The clock of the sampled controllers.
    pub fn clock(&self) -> Discrete {
        self.clock
    }
    /// The account of the check.
    pub fn robustness(&self) -> &Robustness {
        &self.robustness
    }
}

impl VerificationSettings {
    fn check(&self) -> Result<(), PlantError> {
        positive("largest_sensitivity", self.largest_sensitivity)?;
        for (field, value, most) in [
            ("positions", self.positions, 10_000),
            ("frequencies", self.frequencies, 100_000),
        ] {
            if !(2..=most).contains(&value) {
                return Err(PlantError::Setting {
                    field,
                    value: value as f64,
                    problem: "give a number from 2 to 10,000 (positions) or 100,000 (frequencies)",
                });
            }
        }
        Ok(())
    }
}

fn check(
    machine: &Machine,
    controller: &StateSpace<Discrete>,
    clock: Discrete,
    settings: &VerificationSettings,
) -> Result<Robustness, PlantError> {
    let nyquist = 0.5 / clock.sample_time();
    let last = (settings.frequencies - 1) as f64;
    let mut frequencies: Vec<f64> = (0..settings.frequencies)
        .map(|i| nyquist * 1e4_f64.powf(i as f64 / last - 1.0))
        .collect();
    let mut account = Robustness {
        positions: machine.positions(settings.positions),
        spectral_radii: Vec::new(),
        sensitivities: Vec::new(),
        worst_frequencies_hz: Vec::new(),
    };
    let common = frequencies.len();
    for &p in &account.positions {
        let plant = machine.sampled(p, clock)?;
        let radius = eigenvalues(&closed_loop_matrix(&plant, controller)?)?
            .iter()
            .map(|z| z.norm())
            .fold(0.0, f64::max);
        account.spectral_radii.push(radius);
        // The resonances are narrow, so their own frequencies join the logarithmic ones.
        frequencies.truncate(common);
        frequencies.extend(
            machine
                .flexible_poles(p)?
                .iter()
                .flat_map(|s| [0.98, 0.99, 1.0, 1.01, 1.02].map(|r| r * s.im.abs() / std::f64::consts::TAU))
                .filter(|f| *f > 0.0 && *f <= nyquist),
        );
        let (sensitivity, frequency) = largest_sensitivity(&plant, controller, clock, &frequencies)?;
        account.sensitivities.push(sensitivity);
        account.worst_frequencies_hz.push(frequency);
    }
    Ok(account)
}

/// Largest singular value of `(I + P K)^-1` and where; infinite where the return difference is singular.
fn largest_sensitivity(
    plant: &StateSpace<Discrete>,
    controller: &StateSpace<Discrete>,
    clock: Discrete,
    frequencies_hz: &[f64],
) -> Result<(f64, f64), PlantError> {
    use lpv_core::Clock;
    let points: Vec<Complex<f64>> = frequencies_hz.iter().map(|&f| clock.point(f)).collect();
    let loops = responses(plant, &points)?
        .into_iter()
        .zip(responses(controller, &points)?);
    let mut worst = (0.0, 0.0);
    for (loop_, &f) in loops.zip(frequencies_hz) {
        // A pole on the line means infinite loop gain: the sensitivity is zero there.
        let (Some(p), Some(k)) = loop_ else {
            continue;
        };
        let difference = Matrix2::identity() + p * k;
        let s = difference
            .try_inverse()
            .map_or(f64::INFINITY, |s| spectral_norm(&s));
        if s > worst.0 {
            worst = (s, f);
        }
    }
    Ok(worst)
}

/// The response at each point; none at a pole.
fn responses(
    system: &StateSpace<Discrete>,
    points: &[Complex<f64>],
) -> Result<Vec<Option<Matrix2<Complex<f64>>>>, PlantError> {
    let mut kernel = ResponseKernel::new(system)?;
    let mut values = vec![Complex::new(0.0, 0.0); 4 * points.len()];
    let mut found = Vec::with_capacity(points.len());
    while found.len() < points.len() {
        let from = found.len();
        let pole = kernel.evaluate(&points[from..], &mut values[4 * from..]).err();
        let until = pole.map_or(points.len(), |pole| from + pole);
        let matrices = values[4 * from..4 * until].chunks_exact(4);
        found.extend(matrices.map(|v| Some(Matrix2::from_column_slice(v))));
        if pole.is_some() {
            found.push(None);
        }
    }
    Ok(found)
}

/// Largest singular value of a 2 x 2 matrix from its Frobenius norm and determinant.
fn spectral_norm(m: &Matrix2<Complex<f64>>) -> f64 {
    let frobenius = m.iter().map(|v| v.norm_sqr()).sum::<f64>();
    let determinant = m.determinant().norm_sqr();
    (0.5 * (frobenius + (frobenius * frobenius - 4.0 * determinant).max(0.0).sqrt())).sqrt()
}

fn largest(values: &[f64]) -> usize {
    (0..values.len())
        .max_by(|&i, &j| values[i].total_cmp(&values[j]))
        .unwrap_or(0)
}
