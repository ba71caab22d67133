//! The linear regression of (13) at each position, with the rigid-body gains shared by all.

use crate::triangle::Triangle;
use crate::whiten::whitening;
use crate::{CheckedRegression, IdentError, RigidTerm, Weighting};
use lpv_core::{Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::{DMatrix, DVector};
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
    /// QR factorisations made: the unit of work.
    pub factorisations: usize,
    /// `R11` of the whitened regressors `[Phi_W, Phi_c] = Q [R11 R12; 0 R22]`.
    pub(crate) r11: DMatrix<f64>,
    /// `R11^-1 R12`: how the coefficients move with the gains.
    pub(crate) gain_response: DMatrix<f64>,
}

/// What one position leaves after its own coefficients are eliminated: `R22 c = r2`, and the residual.
struct Eliminated {
    position: f64,
    r: DMatrix<f64>,
    unknowns: usize,
    equations: usize,
    factorisations: usize,
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
    one_input(basis)?;
    let eliminated = estimates
        .par_iter()
        .zip(&positions)
        .map(|(estimate, &position)| eliminate(estimate, position, basis, settings))
        .collect::<Result<Vec<_>, _>>()?;

    // The gains: the stacked R22 of all positions, in their order, so that the sum does not depend on threads.
    let nc = settings.rigid_body().len();
    let mut triangle = Triangle::new(nc + 1);
    for e in &eliminated {
        let n = e.unknowns;
        triangle.push(nc + 1, |put| {
            for i in 0..=nc {
                for j in i..=nc {
                    put(i, j, e.r[(n + i, n + j)]);
                }
            }
        });
    }
    let (rc, _) = triangle.finish();
    let r22 = rc.view((0, 0), (nc, nc)).into_owned();
    let gains = solve_upper(&r22, &rc.view((0, nc), (nc, 1)).into_owned())
        .ok_or_else(|| IdentError::RankDeficient {
            position: positions[0],
            reciprocal: 0.0,
            function: 0,
        })?
        .column(0)
        .into_owned();
    let inverse = solve_upper(&r22, &DMatrix::identity(nc, nc)).unwrap_or_else(|| DMatrix::zeros(nc, nc));
    let unit_covariance = &inverse * inverse.transpose();

    let (ny, nu) = (estimates[0].frf().outputs(), estimates[0].frf().inputs());
    let fits = eliminated
        .into_iter()
        .map(|e| back_substitute(e, &gains, ny, nu, basis.outputs()))
        .collect::<Result<Vec<_>, _>>()?;
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

fn one_input(basis: &StateSpace<Discrete>) -> Result<(), IdentError> {
    if basis.inputs() == 1 {
        return Ok(());
    }
    let what = "regression: inputs of the basis";
    Err(lpv_core::CoreError::Dimension {
        what,
        expected: 1,
        found: basis.inputs(),
    }
    .into())
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

/// The triangular factor of `[Phi_W, Phi_c, F]`, whitened.
fn eliminate(
    estimate: &FrfEstimate,
    position: f64,
    basis: &StateSpace<Discrete>,
    settings: &CheckedRegression,
) -> Result<Eliminated, IdentError> {
    let frf = estimate.frf();
    let (ny, nu, ng) = (frf.outputs(), frf.inputs(), basis.outputs());
    let rigid = settings.rigid_body();
    let unknowns = ny * nu * ng;
    let lines: Vec<usize> = (0..frf.len())
        .filter(|&k| settings.keeps(frf.frequencies_hz()[k]))
        .collect();
    let equations = 2 * ny * nu * lines.len();
    if equations < unknowns + rigid.len() + 1 {
        return Err(IdentError::TooFewLines {
            position,
            lines: lines.len(),
            equations,
            unknowns,
        });
    }
    let frequencies: Vec<f64> = lines.iter().map(|&k| frf.frequencies_hz()[k]).collect();
    let phi = basis.frequency_response(&frequencies)?;
    let columns = unknowns + rigid.len() + 1;
    let mut triangle = Triangle::new(columns);
    for (row, &k) in lines.iter().enumerate() {
        let w = whitening(estimate, k, settings.weighting(), position)?;
        let phi_r = rigid_response(basis.clock(), frequencies[row])?;
        let whitened = &w.left * frf.line(k) * &w.right;
        let phi_k = phi.line_slice(row);
        triangle.push(2 * ny * nu, |put| {
            for s in 0..nu {
                for r in 0..ny {
                    let at = 2 * (s * ny + r);
                    let mut both = |column: usize, v: Complex<f64>| {
                        put(at, column, v.re);
                        put(at + 1, column, v.im);
                    };
                    // Unknown (a, b, i), entry (a, b) of W_i: the factors are triangular, a <= r and b <= s.
                    for b in 0..=s {
                        for a in 0..=r {
                            let factor = w.left[(r, a)] * w.right[(b, s)];
                            for (i, &phi_i) in phi_k.iter().enumerate() {
                                both((b * ny + a) * ng + i, factor * phi_i);
                            }
                        }
                    }
                    for (t, term) in rigid.iter().enumerate() {
                        both(
                            unknowns + t,
                            w.left[(r, term.output)] * w.right[(term.input, s)] * phi_r,
                        );
                    }
                    both(columns - 1, whitened[(r, s)]);
                }
            }
        });
    }
    let (r, factorisations) = triangle.finish();
    Ok(Eliminated {
        position,
        r,
        unknowns,
        equations,
        factorisations,
    })
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
    let scaled = DMatrix::from_columns(
        &(0..n)
            .map(|j| r11.column(j) / r11.column(j).norm().max(f64::MIN_POSITIVE))
            .collect::<Vec<_>>(),
    );
    let svd = scaled.svd(false, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    if smallest <= 1e-12 * largest {
        let direction = svd
            .v_t
            .as_ref()
            .map(|v| v.row(svd.singular_values.imin()).transpose());
        let function = direction.map_or(0, |d| d.iamax() % ng + 1);
        return Err(IdentError::RankDeficient {
            position: e.position,
            reciprocal: smallest / largest,
            function,
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

pub(crate) fn solve_upper(r: &DMatrix<f64>, rhs: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if r.is_empty() {
        return Some(DMatrix::zeros(r.ncols(), rhs.ncols()));
    }
    r.solve_upper_triangular(rhs)
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
        &inverse * inverse.transpose()
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
