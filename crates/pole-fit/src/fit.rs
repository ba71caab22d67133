//! The fit and its result.

use crate::basis::Recurrence;
use crate::columns::{Columns, dot};
use crate::model::Setup;
use crate::realise::realise;
use crate::relocate::most_important;
use crate::search::{Begin, StopReason, search};
use crate::uncertainty::{denominator_covariance, expected_cost, root_covariance};
use crate::weights::Lines;
use crate::{PoleFitError, PoleFitSettings};
use lpv_core::{Clock, CoreError, Discrete, Frf, FrfEstimate, StateSpace};
use lpv_numerics::poles::Oscillation;
use nalgebra::{DMatrix, DVector, Matrix2};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Poles and numerators of a common-denominator model, with an account of how they were found.
#[derive(Debug, Clone, PartialEq)]
pub struct PoleFit {
    /// All roots of the denominator: the fixed integrators first, then by natural frequency `|ln z|`; of a conjugate
    /// pair the one with positive imaginary part first.
    pub poles: Vec<C64>,
    /// How many of them, at the front, were fixed at `z = 1`.
    pub fixed_integrators: usize,
    /// Covariance of `(Re, Im)` of each pole; zero for fixed ones.
    pub pole_covariance: Vec<Matrix2<f64>>,
    /// How the fit went.
    pub account: Account,
    pub(crate) recurrence: Recurrence,
    pub(crate) alpha: DVector<f64>,
    pub(crate) beta: DMatrix<f64>,
    pub(crate) channels: (usize, usize),
    pub(crate) clock: Discrete,
    delay_samples: usize,
    rigid_body_hz: f64,
}

/// How a fit went.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// Degree of the denominator.
    pub order: usize,
    /// Why the search ended.
    pub stop: StopReason,
    /// Passes of the start whose best result the search began with.
    pub start_iterations: usize,
    /// Gauss-Newton trials.
    pub iterations: usize,
    /// Cholesky factorisations of the numerators' normal matrix: the unit of work.
    pub factorisations: usize,
    /// Weighted sum of squares `sum_k r^H K r`; in complex equations, so noise alone gives about one for each.
    pub cost: f64,
    /// What [`Account::cost`] would be on average if only noise were left.
    pub expected_cost: f64,
    /// Standard deviation of that.
    pub expected_cost_deviation: f64,
    /// Real equations: two a line and channel.
    pub equations: usize,
    /// Real unknowns.
    pub unknowns: usize,
    /// Condition number of the normal matrix of the denominator, its diagonal scaled to one; about 1e15 and above
    /// means that the data do not determine all poles.
    pub condition: f64,
    /// Root mean square over the lines of `||F - model||_F / ||F||_F`.
    pub relative_error_rms: f64,
    /// The largest of these.
    pub relative_error_max: f64,
    /// Lines used.
    pub lines: usize,
    /// Lines outside the band, or at `z = 1` with fixed integrators.
    pub lines_left_out: usize,
    /// Lines whose covariance was not positive definite, so that its diagonal was used.
    pub diagonal_fallbacks: usize,
    /// Indices of the poles with `|z| >= 1` that are not fixed integrators.
    pub unstable_poles: Vec<usize>,
}

impl Account {
    /// How far the cost is above what noise alone would give, in standard deviations. Around zero: the noise level is
    /// reached; far above: something is not modelled, or the covariance is too small.
    #[must_use]
    pub fn cost_excess(&self) -> f64 {
        (self.cost - self.expected_cost) / self.expected_cost_deviation
    }

    /// Whether the cost is within this factor of what noise alone leaves, or within four of its standard deviations: that of few equations
    /// scatters.
    #[must_use]
    pub fn is_noise(&self, factor: f64) -> bool {
        /// Standard deviations.
        const SCATTER: f64 = 4.0;
        self.cost <= factor * self.expected_cost || self.cost_excess() <= SCATTER
    }
}

/// A pole as an oscillation: `z = exp(s T_s)`, `s = w (-d + j sqrt(1 - d^2))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Index of the pole.
    pub pole: usize,
    /// Natural frequency `|s| / (2 pi)`, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_deviation_hz: f64,
    /// Damping ratio `-Re s / |s|`.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: f64,
}

/// Fits `F(z) = z^-d B(z) / ((z-1)^m a(z))` to an estimated frequency response.
///
/// # Errors
/// [`PoleFitError`]: no lines, no channels, too few lines for the order, a covariance from too little data, lines above
/// Nyquist, numbers that overflow. A fit that is merely poor is a result; the [`Account`] says so.
pub fn fit(
    estimate: &FrfEstimate,
    clock: Discrete,
    settings: &PoleFitSettings,
) -> Result<PoleFit, PoleFitError> {
    settings.check()?;
    fit_lines(
        &Lines::new(estimate, clock, settings)?,
        clock,
        settings,
        Begin::Data,
    )
}

/// As [`fit`], but the search begins at these poles, one of each conjugate pair, without the fixed integrators: those of another
/// fit, or of a measurement at a position nearby.
///
/// # Errors
/// As [`fit`]. Poles from which no search can begin (too few, on a line, not finite) are no error: it begins at the data.
pub fn fit_from(
    estimate: &FrfEstimate,
    clock: Discrete,
    settings: &PoleFitSettings,
    poles: &[C64],
) -> Result<PoleFit, PoleFitError> {
    settings.check()?;
    let lines = Lines::new(estimate, clock, settings)?;
    fit_lines(&lines, clock, settings, Begin::Poles(poles))
}

pub(crate) fn fit_lines(
    lines: &Lines,
    clock: Discrete,
    settings: &PoleFitSettings,
    begin: Begin<'_>,
) -> Result<PoleFit, PoleFitError> {
    let set = settings;
    let m = settings.fixed_integrators();
    let setup = Setup::of(lines, settings);
    if setup.equations() <= setup.unknowns() {
        return Err(PoleFitError::TooFewLines {
            order: set.order,
            equations: setup.equations(),
            unknowns: setup.unknowns(),
        });
    }
    let found = search(&setup, settings, begin)?;
    let covariance = denominator_covariance(&setup, &found, set.weighting)?;
    let recurrence = found.basis.recurrence.clone();
    let alpha = found.point.alpha.clone();
    let roots = recurrence.roots(&alpha)?;
    let mut poles = vec![C64::new(1.0, 0.0); m];
    let mut pole_covariance = vec![Matrix2::zeros(); m];
    for root in roots {
        poles.push(root);
        pole_covariance.push(root_covariance(&recurrence, &alpha, &covariance, root));
    }
    let (relative_error_rms, relative_error_max) = relative_error(lines, &found.point.residual);
    let (expected_cost, expected_cost_deviation) = expected_cost(&setup, set.weighting);
    let account = Account {
        order: set.order,
        stop: found.stop,
        start_iterations: found.start_iterations,
        iterations: found.iterations,
        factorisations: found.factorisations,
        cost: found.point.cost,
        expected_cost,
        expected_cost_deviation,
        equations: setup.equations(),
        unknowns: setup.unknowns(),
        condition: covariance.condition,
        relative_error_rms,
        relative_error_max,
        lines: lines.len(),
        lines_left_out: lines.lines_left_out,
        diagonal_fallbacks: lines.diagonal_fallbacks,
        unstable_poles: (m..poles.len()).filter(|&i| poles[i].norm() >= 1.0).collect(),
    };
    let lowest = lines
        .frequencies_hz
        .iter()
        .copied()
        .find(|&f| f > 0.0)
        .unwrap_or(0.0);
    Ok(PoleFit {
        poles,
        fixed_integrators: m,
        pole_covariance,
        account,
        recurrence,
        alpha,
        beta: found.point.beta,
        channels: (lines.n_y, lines.n_u),
        clock,
        delay_samples: set.delay_samples,
        rigid_body_hz: set.rigid_body_hz.unwrap_or(lowest),
    })
}

/// Root mean square and maximum; lines where the response vanishes are measured by its mean.
fn relative_error(lines: &Lines, residual: &Columns) -> (f64, f64) {
    let square = |of: &Columns, k: usize| -> f64 { (0..of.count()).map(|c| of.at(k, c).norm_sqr()).sum() };
    let mean = dot(lines.f.parts(), lines.f.parts()) / lines.len() as f64;
    let (mut sum, mut largest) = (0.0, 0.0f64);
    for k in 0..lines.len() {
        let size = square(&lines.f, k);
        let error = square(residual, k) / if size > 0.0 { size } else { mean };
        sum += error;
        largest = largest.max(error);
    }
    ((sum / lines.len() as f64).sqrt(), largest.sqrt())
}

/// `sum_j c_j p_j`.
fn combined(coefficients: &[f64], p: &[C64]) -> C64 {
    p.iter().zip(coefficients).map(|(p, c)| p * *c).sum()
}

impl PoleFit {
    /// The poles other than integrators.
    ///
    /// With `Integrators::Fixed` these are exactly the estimated poles. With `Free` they are those whose natural
    /// frequency `|ln z| / (2 pi T_s)` is at least `rigid_body_hz` of the settings, by default the lowest line used
    /// that is not zero: below it nothing tells a slow mode from an integrator.
    #[must_use]
    pub fn flexible_poles(&self) -> Vec<C64> {
        let flexible = self.flexible_indices();
        flexible.into_iter().map(|i| self.poles[i]).collect()
    }

    /// Indices of [`PoleFit::flexible_poles`] in [`PoleFit::poles`].
    #[must_use]
    pub fn flexible_indices(&self) -> Vec<usize> {
        (self.fixed_integrators..self.poles.len())
            .filter(|&i| self.fixed_integrators > 0 || self.natural_frequency_hz(i) >= self.rigid_body_hz)
            .collect()
    }

    fn natural_frequency_hz(&self, i: usize) -> f64 {
        self.poles[i].ln().norm() / (std::f64::consts::TAU * self.clock.sample_time())
    }

    /// Natural frequency and damping of the flexible poles, one entry a conjugate pair or real pole.
    #[must_use]
    pub fn modes(&self) -> Vec<Mode> {
        let indices = self.flexible_indices().into_iter();
        indices
            .filter(|&i| self.poles[i].im >= 0.0)
            .map(|i| self.mode(i))
            .collect()
    }

    fn mode(&self, i: usize) -> Mode {
        let found = Oscillation::new(self.poles[i], &self.pole_covariance[i], self.clock.sample_time());
        Mode {
            pole: i,
            frequency_hz: found.frequency_hz,
            frequency_deviation_hz: found.frequency_deviation_hz,
            damping: found.damping,
            damping_deviation: found.damping_deviation,
        }
    }

    /// One of each pair of the estimated poles that matter most: so many, fixed integrators included, that an order asks for.
    pub(crate) fn most_important(&self, setup: &Setup<'_>, order: usize) -> Option<Vec<C64>> {
        let upper: Vec<C64> = self.poles[self.fixed_integrators..]
            .iter()
            .filter(|l| l.im >= 0.0)
            .copied()
            .collect();
        most_important(setup, &upper, order.saturating_sub(self.fixed_integrators))
    }

    /// The clock of the poles.
    #[must_use]
    pub fn clock(&self) -> Discrete {
        self.clock
    }

    /// The fitted response, delay included, at frequencies in Hz.
    ///
    /// # Errors
    /// [`CoreError::Frequency`] for frequencies that are negative, not finite, not increasing or above Nyquist,
    /// [`CoreError::PoleOnLine`] where the response is infinite.
    pub fn response(&self, frequencies_hz: &[f64]) -> Result<Frf, CoreError> {
        let (n_y, n_u) = self.channels;
        let limit = self.clock.nyquist_hz() * (1.0 + 1e-12);
        if let Some(index) = frequencies_hz.iter().position(|&f| f > limit) {
            return Err(CoreError::Frequency {
                index,
                value_hz: frequencies_hz[index],
                problem: "above the Nyquist frequency of the fit",
            });
        }
        let mut frf = Frf::zeros(frequencies_hz.to_vec(), n_y, n_u)?;
        let mut p = Vec::with_capacity(self.beta.nrows());
        for (k, &frequency_hz) in frequencies_hz.iter().enumerate() {
            let z = self.clock.point(frequency_hz);
            let delay = z.powu(self.delay_samples as u32);
            let line = frf.line_slice_mut(k);
            self.set_values(z, &mut p, line);
            for value in line {
                *value /= delay;
                if !value.is_finite() {
                    return Err(CoreError::PoleOnLine { frequency_hz });
                }
            }
        }
        Ok(frf)
    }

    /// `B` at a point, a value a channel, column-major.
    pub(crate) fn numerators(&self, z: C64) -> Vec<C64> {
        let p = self.recurrence.values(z);
        let columns = self.beta.as_slice().chunks_exact(self.beta.nrows());
        columns.map(|beta| combined(beta, &p)).collect()
    }

    /// `B / ((z-1)^m a)` at a point, a value a channel, column-major; `p` is for the values of the polynomials.
    pub(crate) fn set_values(&self, z: C64, p: &mut Vec<C64>, values: &mut [C64]) {
        self.recurrence.set_values(z, p);
        let a = combined(self.alpha.as_slice(), p);
        let factor = (a * (z - 1.0).powu(self.fixed_integrators as u32)).inv();
        let columns = self.beta.as_slice().chunks_exact(self.beta.nrows());
        for (value, beta) in values.iter_mut().zip(columns) {
            *value = combined(beta, p) * factor;
        }
    }

    /// A state space of `B / ((z-1)^m a)` with `order * min(n_y, n_u)` states, minimal only if all residues have full
    /// rank. Fixed integrators are exact. The delay of the settings is not part of it.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`] or [`CoreError::Singular`] if the leading coefficient of the denominator vanishes.
    pub fn state_space(&self) -> Result<StateSpace<Discrete>, CoreError> {
        realise(
            &self.recurrence,
            &self.alpha,
            &self.beta,
            self.fixed_integrators,
            self.channels,
            self.clock,
        )
    }
}
