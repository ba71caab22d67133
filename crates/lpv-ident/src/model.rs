//! The LPV-OBF model with the band that the noise leaves around its frozen responses.

use crate::expansion::Expansion;
use crate::interpolation::{InterpolationOperator, surrounding};
use crate::regression::LocalFits;
use crate::{IdentError, Interpolation};
use lpv_core::{Frf, MatrixFunction, Position, SchedulingRange, SeriesExpansion, StateSpace};
use nalgebra::{DMatrix, dmatrix};
use rayon::prelude::*;

/// Equation (13) with coefficient functions for every p of the range.
#[derive(Debug, Clone)]
pub struct LpvObfModel {
    fits: LocalFits,
    interpolation: Interpolation,
    operator: InterpolationOperator,
    weights: MatrixFunction,
    range: SchedulingRange,
}

impl LocalFits {
    /// Interpolates the samples over the smallest range that holds all positions.
    ///
    /// # Errors
    /// Those of [`Interpolation::operator`]; with a single position the range is that position plus and minus one.
    pub fn interpolate(&self, interpolation: Interpolation) -> Result<LpvObfModel, IdentError> {
        let positions = self.positions();
        let operator = interpolation.operator(&positions)?;
        let weights = operator.apply(&self.fits.iter().map(|f| &f.weights).collect::<Vec<_>>())?;
        let range = match positions.as_slice() {
            [only] => SchedulingRange::new(only.iter().map(|p| [p - 1.0, p + 1.0]).collect())?,
            _ => surrounding(&positions)?,
        };
        Ok(LpvObfModel {
            fits: self.clone(),
            interpolation,
            operator,
            weights,
            range,
        })
    }
}

impl LpvObfModel {
    /// The local fits that the model interpolates.
    pub fn fits(&self) -> &LocalFits {
        &self.fits
    }
    /// The interpolation.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }
    /// `[W_1(p) ... W_ng(p)]`.
    pub fn weights(&self) -> &MatrixFunction {
        &self.weights
    }
    /// The scheduling range.
    pub fn range(&self) -> &SchedulingRange {
        &self.range
    }

    /// The frozen response at p.
    ///
    /// # Errors
    /// p outside the range; frequencies above Nyquist; a line at zero if there is a rigid body.
    pub fn response(&self, p: &[f64], frequencies_hz: &[f64]) -> Result<Frf, IdentError> {
        self.range.check(p)?;
        Expansion::new(&self.fits, frequencies_hz)?.response(&self.weights.evaluate(p))
    }

    /// The frozen responses at several p; the basis is evaluated once.
    ///
    /// # Errors
    /// As [`LpvObfModel::response`].
    pub fn responses(
        &self,
        positions: impl IntoIterator<Item: Into<Position>>,
        frequencies_hz: &[f64],
    ) -> Result<Vec<Frf>, IdentError> {
        let expansion = Expansion::new(&self.fits, frequencies_hz)?;
        let positions: Vec<Position> = positions.into_iter().map(Into::into).collect();
        positions
            .par_iter()
            .map(|p| {
                self.range.check(p)?;
                expansion.response(&self.weights.evaluate(p))
            })
            .collect()
    }

    /// Standard deviation of every channel of the frozen response at p, `sqrt(E |dG_ij|^2)`, one `n_y x n_u` matrix a
    /// line: the covariance of the coefficients carried through the interpolation, also between positions. It holds
    /// what the noise does; what the basis and the interpolation cannot represent comes on top.
    ///
    /// # Errors
    /// As [`LpvObfModel::response`].
    pub fn response_deviation(
        &self,
        p: &[f64],
        frequencies_hz: &[f64],
    ) -> Result<Vec<DMatrix<f64>>, IdentError> {
        self.range.check(p)?;
        let phi = self.fits.basis.frequency_response(frequencies_hz)?;
        let (ny, nu, ng) = (self.fits.outputs, self.fits.inputs, self.fits.functions());
        let nc = self.fits.gains.len();
        // dW(p) = sum_q l_q (R_q^-1 e_q - T_q dc): the local errors are independent, dc is common.
        let cardinals = self.operator.cardinals(p);
        let mut factors = Vec::with_capacity(cardinals.len());
        let mut common = DMatrix::zeros(ny * nu * ng, nc);
        for (&l, f) in cardinals.iter().zip(&self.fits.fits) {
            if l != 0.0 {
                factors.push((l, f.r11.transpose()));
                common -= &f.gain_response * l;
            }
        }
        let gain_factor = self
            .fits
            .gain_covariance
            .clone()
            .cholesky()
            .map_or_else(|| DMatrix::zeros(nc, nc), |c| c.l());
        let mut deviations = vec![DMatrix::zeros(ny, nu); phi.len()];
        let mut rhs = DMatrix::zeros(ny * nu * ng, 2);
        for (k, deviation) in deviations.iter_mut().enumerate() {
            let phi_k = phi.line_slice(k);
            let phi_r = if nc > 0 {
                crate::regression::rigid_response(self.fits.basis.clock(), frequencies_hz[k])?
            } else {
                num_complex::Complex::new(0.0, 0.0)
            };
            for b in 0..nu {
                for a in 0..ny {
                    let from = (b * ny + a) * ng;
                    rhs.fill(0.0);
                    for (i, v) in phi_k.iter().enumerate() {
                        rhs[(from + i, 0)] = v.re;
                        rhs[(from + i, 1)] = v.im;
                    }
                    let mut variance = 0.0;
                    for (l, lower) in &factors {
                        // || R^-T phi ||^2 = phi^T R^-1 R^-T phi
                        if let Some(v) = lower.solve_lower_triangular(&rhs) {
                            variance += l * l * self.fits.row_variance * v.norm_squared();
                        }
                    }
                    let mut sensitivity = rhs.transpose() * &common;
                    for (t, term) in self.fits.rigid_body.iter().enumerate() {
                        if (term.output, term.input) == (a, b) {
                            let mut column = sensitivity.column_mut(t);
                            column += dmatrix![phi_r.re; phi_r.im].column(0);
                        }
                    }
                    variance += (sensitivity * &gain_factor).norm_squared();
                    deviation[(a, b)] = variance.sqrt();
                }
            }
        }
        Ok(deviations)
    }

    /// The model as a series expansion in fixed filters, ready to be realised or simulated.
    ///
    /// # Errors
    /// None for a model of this crate.
    pub fn series(&self) -> Result<SeriesExpansion, IdentError> {
        let (ny, nu) = (self.fits.outputs, self.fits.inputs);
        let direct = MatrixFunction::constant(DMatrix::zeros(ny, nu))?;
        Ok(SeriesExpansion::new(
            self.rigid_body()?,
            self.fits.basis.clone(),
            direct,
            self.weights.clone(),
            self.range.clone(),
        )?)
    }

    /// `c phi_R` for every term, two states each, in the coordinates of a sampled double integrator.
    fn rigid_body(&self) -> Result<StateSpace<lpv_core::Discrete>, IdentError> {
        let (ny, nu) = (self.fits.outputs, self.fits.inputs);
        let clock = self.fits.basis.clock();
        let mut system = StateSpace::gain(DMatrix::zeros(ny, nu), clock)?;
        for (term, &c) in self.fits.rigid_body.iter().zip(self.fits.gains.iter()) {
            // (z + 1) / (z - 1)^2 = [1 0] (zI - [1 1; 0 1])^-1 [1; 2]
            let mut b = DMatrix::zeros(2, nu);
            b[(0, term.input)] = c;
            b[(1, term.input)] = 2.0 * c;
            let mut output = DMatrix::zeros(ny, 2);
            output[(term.output, 0)] = 1.0;
            let own = StateSpace::new(
                dmatrix![1.0, 1.0; 0.0, 1.0],
                b,
                output,
                DMatrix::zeros(ny, nu),
                clock,
            )?;
            system = system.plus(&own)?;
        }
        Ok(system)
    }
}
