//! The linear regression of (13) at each position, with the rigid-body gains shared by all.

mod eliminate;
mod equations;
mod gram;
mod solve;

use crate::{IdentError, RegressionSettings, RigidTerm, Weighting};
use equations::{Equations, Regressors};
use lpv_core::{Discrete, FrfEstimate, Position, StateSpace};
use lpv_numerics::dense::invert_upper;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use rayon::prelude::*;
use solve::{by_products, by_reflections, each};
use std::ops::Range;

/// The regression's account: gains, samples of the coefficient functions, covariances, what remains.
#[derive(Debug, Clone)]
pub struct LocalFits {
    pub(crate) basis: StateSpace<Discrete>,
    pub(crate) rigid_body: Vec<RigidTerm>,
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    pub(crate) gains: DVector<f64>,
    pub(crate) gain_covariance: DMatrix<f64>,
    /// Variance of a whitened row: 1 by definition with covariance weights, else what the residuals show.
    pub(crate) row_variance: f64,
    pub(crate) fits: Vec<LocalFit>,
}

/// The fit at one position.
#[derive(Debug, Clone)]
pub struct LocalFit {
    /// Scheduling values.
    pub position: Position,
    /// `[W_1 ... W_ng]`, `n_y x n_g n_u`.
    pub weights: DMatrix<f64>,
    /// Weighted sum of squares that remains; with covariance weights its expectation is `equations - unknowns`.
    pub cost: f64,
    /// Real equations.
    pub equations: usize,
    /// Real unknowns at this position, the shared gains not counted.
    pub unknowns: usize,
    /// Factorisations: one of the sums of products, or one a block of rows and channel.
    pub factorisations: usize,
    /// `R11` of the whitened regressors `[Phi_W, Phi_c] = Q [R11 R12; 0 R22]`.
    pub(crate) r11: DMatrix<f64>,
    /// `R11^-1 R12`: how the coefficients move with the gains.
    pub(crate) gain_response: DMatrix<f64>,
}

/// Fits `F(z) = sum_t c_t E_t phi_R(z) + sum_i W_i phi_i(z)` to FRFs at all positions.
///
/// `basis`: one input, `n_g` outputs. Each position is whitened and factorised once; its own `n_g n_y n_u` coefficients
/// are eliminated, the few rows that remain decide the shared gains, and the coefficients follow by back-substitution.
/// The result is that of one joint least-squares problem over all positions. Its triangular factors come from sums of
/// products where the condition of the regressors allows it, and from reflections of the whitened rows elsewhere.
///
/// # Errors
/// [`IdentError::TooFewLines`], [`IdentError::RankDeficient`], [`IdentError::Covariance`] and what is wrong with the
/// inputs.
pub fn regress(
    estimates: &[FrfEstimate],
    basis: &StateSpace<Discrete>,
    settings: &RegressionSettings,
) -> Result<LocalFits, IdentError> {
    settings.check()?;
    let positions = checked_positions(estimates, &settings.rigid_body)?;
    filter_bank(basis)?;
    let has_rigid_body = !settings.rigid_body.is_empty();
    let kept: Vec<Range<usize>> = estimates
        .iter()
        .zip(&positions)
        .map(|(estimate, position)| eliminate::kept(estimate, position, basis, settings))
        .collect::<Result<_, _>>()?;
    // Positions mostly share their lines, and then also the responses of the filters.
    let shared = Regressors::new(
        basis,
        has_rigid_body,
        frequencies(&estimates[0], &kept[0]).to_vec(),
    )?;
    let own = each(estimates.par_iter().zip(&kept), |(estimate, kept)| {
        let frequencies = frequencies(estimate, kept);
        let others = frequencies != shared.frequencies_hz();
        others
            .then(|| Regressors::new(basis, has_rigid_body, frequencies.to_vec()))
            .transpose()
    })?;
    let equations: Vec<Equations<'_>> = estimates
        .iter()
        .zip(&positions)
        .zip(kept)
        .zip(&own)
        .map(|(((estimate, position), kept), own)| Equations {
            estimate,
            position,
            kept,
            regressors: own.as_ref().unwrap_or(&shared),
            settings,
        })
        .collect();

    let nc = settings.rigid_body.len();
    let sizes = (
        estimates[0].frf().outputs(),
        estimates[0].frf().inputs(),
        basis.outputs(),
    );
    let ((gains, unit_covariance), fits) = match by_products(&equations, nc, sizes)? {
        Some(solved) => solved,
        None => by_reflections(&equations, nc, sizes)?,
    };
    let (ny, nu, _) = sizes;
    let row_variance = match settings.weighting {
        Weighting::Covariance => 1.0,
        Weighting::Relative | Weighting::Uniform => {
            let free = fits
                .iter()
                .map(|f| f.equations - f.unknowns)
                .sum::<usize>()
                .saturating_sub(nc)
                .max(1);
            fits.iter().map(|f| f.cost).sum::<f64>() / free as f64
        }
    };
    Ok(LocalFits {
        row_variance,
        basis: basis.clone(),
        rigid_body: settings.rigid_body.clone(),
        outputs: ny,
        inputs: nu,
        gains,
        gain_covariance: unit_covariance * row_variance,
        fits,
    })
}

fn frequencies<'a>(estimate: &'a FrfEstimate, kept: &Range<usize>) -> &'a [f64] {
    &estimate.frf().frequencies_hz()[kept.clone()]
}

impl LocalFit {
    /// Condition number of the regressors, scaled to columns of one length; infinite for one that is zero in numbers.
    pub fn condition(&self) -> f64 {
        solve::condition(&self.r11).unwrap_or(f64::INFINITY)
    }
}

fn filter_bank(basis: &StateSpace<Discrete>) -> Result<(), IdentError> {
    let refused = |what, found| {
        let expected = 1;
        Err(lpv_core::CoreError::Dimension {
            what,
            expected,
            found,
        }
        .into())
    };
    match (basis.inputs(), basis.outputs()) {
        (1, 0) => refused("regression: functions of the basis, at least", 0),
        (1, _) => Ok(()),
        (found, _) => refused("regression: inputs of the basis", found),
    }
}

fn checked_positions(estimates: &[FrfEstimate], rigid: &[RigidTerm]) -> Result<Vec<Position>, IdentError> {
    let first = estimates.first().ok_or(IdentError::NoEstimates)?.frf();
    let (outputs, inputs) = (first.outputs(), first.inputs());
    for (index, t) in rigid.iter().enumerate() {
        if t.output >= outputs || t.input >= inputs {
            return Err(IdentError::RigidChannel {
                index,
                output: t.output,
                input: t.input,
                outputs,
                inputs,
            });
        }
    }
    let mut positions: Vec<Position> = Vec::with_capacity(estimates.len());
    for (index, e) in estimates.iter().enumerate() {
        // A single position is a time-invariant fit: it may do without a value.
        let position = match e.position() {
            Some(p) => p.clone(),
            None if estimates.len() == 1 => Position::from(0.0),
            None => return Err(IdentError::NoPosition { index }),
        };
        let above = |last: &Position| match (last.single(), position.single()) {
            (Some(last), Some(own)) => last < own,
            _ => true,
        };
        let problem = if positions
            .first()
            .is_some_and(|first| first.len() != position.len())
        {
            Some("not as many scheduling values as the first position has")
        } else if !positions.last().is_none_or(above) {
            Some("not above the one before it; sort the estimates and join those of one position")
        } else if positions.contains(&position) {
            Some("the same as an earlier one; join the estimates of one position")
        } else {
            None
        };
        if let Some(problem) = problem {
            return Err(IdentError::Position {
                index,
                position,
                problem,
            });
        }
        if (e.frf().outputs(), e.frf().inputs()) != (outputs, inputs) {
            return Err(IdentError::Channels {
                index,
                outputs,
                inputs,
                found_outputs: e.frf().outputs(),
                found_inputs: e.frf().inputs(),
            });
        }
        positions.push(position);
    }
    Ok(positions)
}

/// `phi_R(z) = (z + 1) / (z - 1)^2`, equation (12).
pub(crate) fn rigid_response(clock: Discrete, frequency_hz: f64) -> Result<Complex<f64>, IdentError> {
    use lpv_core::Clock;
    let z = clock.point(frequency_hz);
    let value = (z + 1.0) / ((z - 1.0) * (z - 1.0));
    if frequency_hz == 0.0 || !value.norm().is_finite() {
        return Err(lpv_core::CoreError::PoleOnLine { frequency_hz }.into());
    }
    Ok(value)
}

impl LocalFits {
    /// Positions; increasing, where there is one scheduling signal.
    pub fn positions(&self) -> Vec<Position> {
        self.fits.iter().map(|f| f.position.clone()).collect()
    }
    /// The fit at each position.
    pub fn fits(&self) -> &[LocalFit] {
        &self.fits
    }
    /// The shared rigid-body gains `c`, in the order of the settings, with their covariance.
    pub fn gains(&self) -> (&DVector<f64>, &DMatrix<f64>) {
        (&self.gains, &self.gain_covariance)
    }
    /// The filters: one input, `n_g` outputs.
    pub fn basis(&self) -> &StateSpace<Discrete> {
        &self.basis
    }
    /// Number of basis functions `n_g`.
    pub fn functions(&self) -> usize {
        self.basis.outputs()
    }
    /// Covariance of the coefficients at one position: that of the local fit and what the gains' own error adds.
    /// Ordered as (input, output, function), the function fastest.
    ///
    /// # Panics
    /// If there is no such position.
    pub fn coefficient_covariance(&self, position: usize) -> DMatrix<f64> {
        let f = &self.fits[position];
        let n = f.r11.nrows();
        let inverse = invert_upper(&f.r11).unwrap_or_else(|| DMatrix::zeros(n, n));
        &inverse * inverse.transpose() * self.row_variance
            + &f.gain_response * &self.gain_covariance * f.gain_response.transpose()
    }
}
