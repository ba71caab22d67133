//! The linear regression of (13) at each position, with the rigid-body gains shared by all.

mod eliminate;

use crate::model_error::with_model_error;
use crate::triangle::{Triangle, solve_upper};
use crate::{CheckedRegression, IdentError, RigidTerm, Weighting};
use eliminate::{Eliminated, Regressors, eliminate};
use lpv_core::{Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::{DMatrix, DVector, Dyn, SVD};
use num_complex::Complex;
use rayon::prelude::*;

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
    /// Scheduling value.
    pub position: f64,
    /// `[W_1 ... W_ng]`, `n_y x n_g n_u`.
    pub weights: DMatrix<f64>,
    /// Weighted sum of squares that remains; with covariance weights its expectation is `equations - unknowns`.
    pub cost: f64,
    /// Real equations.
    pub equations: usize,
    /// Real unknowns at this position, the shared gains not counted.
    pub unknowns: usize,
    /// Condition number of the column-scaled regressors.
    pub condition: f64,
    /// Blocks of rows factorised: the unit of work.
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
/// The result is that of one joint least-squares problem over all positions.
///
/// # Errors
/// [`IdentError::TooFewLines`], [`IdentError::RankDeficient`], [`IdentError::Covariance`] and what is wrong with the
/// inputs.
pub fn regress(
    estimates: &[FrfEstimate],
    basis: &StateSpace<Discrete>,
    settings: &CheckedRegression,
) -> Result<LocalFits, IdentError> {
    let positions = checked_positions(estimates, settings.rigid_body())?;
    filter_bank(basis)?;
    let has_rigid_body = !settings.rigid_body().is_empty();
    // Positions mostly share their lines, and then also the responses of the filters.
    let shared = Regressors::new(
        basis,
        has_rigid_body,
        eliminate::kept_frequencies(&estimates[0], positions[0], basis, settings)?,
    )?;
    let eliminated: Vec<_> = estimates
        .par_iter()
        .zip(&positions)
        .map(|(estimate, &position)| {
            let estimate = &*with_model_error(estimate, settings.model_error())?;
            let frequencies = eliminate::kept_frequencies(estimate, position, basis, settings)?;
            if frequencies == shared.frequencies_hz() {
                return eliminate(estimate, position, &shared, settings);
            }
            let own = Regressors::new(basis, has_rigid_body, frequencies)?;
            eliminate(estimate, position, &own, settings)
        })
        .collect();
    // Of several errors the first in the order of the positions, whichever thread was faster.
    let eliminated = eliminated.into_iter().collect::<Result<Vec<_>, _>>()?;

    let nc = settings.rigid_body().len();
    let (gains, unit_covariance) = shared_gains(&eliminated, nc)?;

    let (ny, nu) = (estimates[0].frf().outputs(), estimates[0].frf().inputs());
    let fits: Vec<_> = eliminated
        .into_par_iter()
        .map(|e| back_substitute(e, &gains, ny, nu, basis.outputs()))
        .collect();
    let fits = fits.into_iter().collect::<Result<Vec<_>, _>>()?;
    let row_variance = match settings.weighting() {
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
        rigid_body: settings.rigid_body().to_vec(),
        outputs: ny,
        inputs: nu,
        gains,
        gain_covariance: unit_covariance * row_variance,
        fits,
    })
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

/// The gains and their covariance for rows of variance one, from the stacked R22 of all positions: in their order, so that
/// the sum does not depend on threads.
fn shared_gains(eliminated: &[Eliminated], nc: usize) -> Result<(DVector<f64>, DMatrix<f64>), IdentError> {
    let mut triangle = Triangle::new(nc + 1, eliminated.len() * (nc + 1));
    for j in 0..=nc {
        let stacked = triangle.column_mut(j).chunks_exact_mut(nc + 1);
        for (rows, e) in stacked.zip(eliminated) {
            let n = e.unknowns;
            rows.copy_from_slice(e.r.view((n, n + j), (nc + 1, 1)).into_owned().as_slice());
        }
    }
    triangle.absorb(eliminated.len() * (nc + 1));
    let r22 = DMatrix::from_fn(nc, nc, |i, j| triangle.column(j)[i]);
    let r2 = DMatrix::from_fn(nc, 1, |i, _| triangle.column(nc)[i]);

    // What the positions' own coefficients leave of each column, against the whole column: a part that is rounding means
    // that the basis does what the rigid body should do.
    let whole = DVector::from_fn(nc, |j, _| {
        let norms = eliminated.iter().map(|e| e.r.column(e.unknowns + j).norm());
        norms.fold(0.0, f64::hypot).max(f64::MIN_POSITIVE)
    });
    let left = DMatrix::from_fn(nc, nc, |i, j| r22[(i, j)] / whole[j]);
    let (_, smallest) = extreme_singular_values(&left).unwrap_or((0.0, 0.0));
    let deficient = || IdentError::RankDeficient {
        position: eliminated.first().map_or(0.0, |e| e.position),
        reciprocal: smallest,
        function: 0,
    };
    if nc > 0 && smallest <= LEAST_RECIPROCAL {
        return Err(deficient());
    }
    let gains = solve_upper(&r22, &r2).ok_or_else(deficient)?;
    let inverse = solve_upper(&r22, &DMatrix::identity(nc, nc)).ok_or_else(deficient)?;
    Ok((gains.column(0).into_owned(), &inverse * inverse.transpose()))
}

/// Reciprocal condition at which regressors count as dependent.
const LEAST_RECIPROCAL: f64 = 1e-12;

/// The largest and the smallest singular value; none for a matrix that is empty or not finite.
fn extreme_singular_values(m: &DMatrix<f64>) -> Option<(f64, f64)> {
    let values = decompose(m, Vectors::No)?.singular_values;
    Some((values.max(), values.min()))
}

/// The column that weighs most in the direction of the smallest singular value.
fn most_dependent_column(m: &DMatrix<f64>) -> usize {
    let column = decompose(m, Vectors::Right).and_then(|svd| {
        let weakest = svd.singular_values.imin();
        Some(svd.v_t?.row(weakest).transpose().iamax())
    });
    column.unwrap_or(0)
}

#[derive(PartialEq)]
enum Vectors {
    No,
    Right,
}

fn decompose(m: &DMatrix<f64>, vectors: Vectors) -> Option<SVD<f64, Dyn, Dyn>> {
    // The iteration neither accepts an empty matrix nor ends on one that is not finite.
    if m.is_empty() || m.iter().any(|v| !v.is_finite()) {
        return None;
    }
    SVD::try_new(
        m.clone(),
        false,
        vectors == Vectors::Right,
        5.0 * f64::EPSILON,
        10_000,
    )
}

fn checked_positions(estimates: &[FrfEstimate], rigid: &[RigidTerm]) -> Result<Vec<f64>, IdentError> {
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
    let mut positions: Vec<f64> = Vec::with_capacity(estimates.len());
    for (index, e) in estimates.iter().enumerate() {
        // A single position is a time-invariant fit: it may do without a value.
        let position = match e.position() {
            Some(p) => p,
            None if estimates.len() == 1 => 0.0,
            None => return Err(IdentError::NoPosition { index }),
        };
        let problem = if !position.is_finite() {
            Some("not a finite number")
        } else if positions.last().is_some_and(|&last| last >= position) {
            Some("not above the one before it; sort the estimates and join those of one position")
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

fn back_substitute(
    e: Eliminated,
    gains: &DVector<f64>,
    ny: usize,
    nu: usize,
    ng: usize,
) -> Result<LocalFit, IdentError> {
    let (n, nc) = (e.unknowns, gains.len());
    let r11 = e.r.view((0, 0), (n, n)).into_owned();
    let r12 = e.r.view((0, n), (n, nc)).into_owned();
    let r1 = e.r.view((0, n + nc), (n, 1)).into_owned();

    // Condition after scaling the columns to unit length: the units of the unknowns must not matter.
    let norms: Vec<f64> = (0..n)
        .map(|j| r11.column(j).norm().max(f64::MIN_POSITIVE))
        .collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| r11[(i, j)] / norms[j]);
    let (largest, smallest) = extreme_singular_values(&scaled).unwrap_or((1.0, 0.0));
    if smallest <= LEAST_RECIPROCAL * largest {
        return Err(IdentError::RankDeficient {
            position: e.position,
            reciprocal: smallest / largest,
            function: most_dependent_column(&scaled) % ng + 1,
        });
    }
    let deficient = || IdentError::RankDeficient {
        position: e.position,
        reciprocal: 0.0,
        function: 0,
    };
    let gain_response = solve_upper(&r11, &r12).ok_or_else(deficient)?;
    let w = solve_upper(&r11, &r1).ok_or_else(deficient)? - &gain_response * gains;

    // Cost: the rows below R11, at the shared gains.
    let r22 = e.r.view((n, n), (nc + 1, nc));
    let r2 = e.r.view((n, n + nc), (nc + 1, 1));
    let cost = (r2 - r22 * gains).norm_squared();

    // Unknowns stand as (b n_y + a) n_g + i; W_i is columns i n_u ... of the sample.
    let weights = DMatrix::from_fn(ny, ng * nu, |a, column| {
        let (i, b) = (column / nu, column % nu);
        w[((b * ny + a) * ng + i, 0)]
    });
    Ok(LocalFit {
        position: e.position,
        weights,
        cost,
        equations: e.equations,
        unknowns: n,
        condition: largest / smallest,
        factorisations: e.factorisations,
        r11,
        gain_response,
    })
}

impl LocalFits {
    /// Positions, increasing.
    pub fn positions(&self) -> Vec<f64> {
        self.fits.iter().map(|f| f.position).collect()
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
        let inverse = solve_upper(&f.r11, &DMatrix::identity(n, n)).unwrap_or_else(|| DMatrix::zeros(n, n));
        &inverse * inverse.transpose() * self.row_variance
            + &f.gain_response * &self.gain_covariance * f.gain_response.transpose()
    }

    /// The frozen response at a fitted position.
    ///
    /// # Errors
    /// Frequencies that the basis refuses; a line at zero.
    ///
    /// # Panics
    /// If there is no such position.
    pub fn response(&self, position: usize, frequencies_hz: &[f64]) -> Result<Frf, IdentError> {
        let phi = self.basis.frequency_response(frequencies_hz)?;
        expand(self, &self.fits[position].weights, &phi)
    }
}

/// `sum_t c_t E_t phi_R + sum_i W_i phi_i` on the lines of `phi`.
pub(crate) fn expand(fits: &LocalFits, weights: &DMatrix<f64>, phi: &Frf) -> Result<Frf, IdentError> {
    let (ny, nu) = (fits.outputs, fits.inputs);
    let mut frf = Frf::zeros(phi.frequencies_hz().to_vec(), ny, nu)?;
    for k in 0..phi.len() {
        let phi_k = phi.line_slice(k);
        let line = frf.line_slice_mut(k);
        for (i, &phi_i) in phi_k.iter().enumerate() {
            for (entry, &w) in line.iter_mut().zip(weights.columns(i * nu, nu).iter()) {
                *entry += phi_i * w;
            }
        }
        if !fits.rigid_body.is_empty() {
            let phi_r = rigid_response(fits.basis.clock(), phi.frequencies_hz()[k])?;
            for (t, c) in fits.rigid_body.iter().zip(fits.gains.iter()) {
                line[t.input * ny + t.output] += phi_r * *c;
            }
        }
    }
    Ok(frf)
}
