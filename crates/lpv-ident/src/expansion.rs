//! Frozen responses as products: the basis on its lines once, the weights of any position times it.

use crate::IdentError;
use crate::regression::{LocalFits, rigid_response};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use lpv_core::Frf;
use nalgebra::DMatrix;
use num_complex::Complex;

/// `sum_t c_t E_t phi_R + sum_i W_i phi_i` on given lines, but for the weights.
pub(crate) struct Expansion {
    frequencies_hz: Vec<f64>,
    /// `n_g` rows; one column a line with the real parts, then one a line with the imaginary ones.
    functions: Mat<f64>,
    /// The rigid body's part, `n_y x n_u` a line, column-major; empty without one.
    rigid: Vec<Complex<f64>>,
    channels: (usize, usize),
}

impl Expansion {
    pub(crate) fn new(fits: &LocalFits, frequencies_hz: &[f64]) -> Result<Self, IdentError> {
        let phi = fits.basis.frequency_response(frequencies_hz)?;
        let (ng, lines) = (fits.functions(), phi.len());
        let value = |i: usize, line: usize| phi.line_slice(line)[i];
        let part = |i, column: usize| match column.checked_sub(lines) {
            None => value(i, column).re,
            Some(line) => value(i, line).im,
        };
        let size = fits.outputs * fits.inputs;
        let mut rigid = Vec::new();
        if !fits.rigid_body.is_empty() {
            rigid.resize(lines * size, Complex::new(0.0, 0.0));
            for (line, &f) in rigid.chunks_exact_mut(size).zip(frequencies_hz) {
                let phi_r = rigid_response(fits.basis.clock(), f)?;
                for (t, c) in fits.rigid_body.iter().zip(fits.gains.iter()) {
                    line[t.input * fits.outputs + t.output] += phi_r * *c;
                }
            }
        }
        Ok(Self {
            frequencies_hz: frequencies_hz.to_vec(),
            functions: Mat::from_fn(ng, 2 * lines, part),
            rigid,
            channels: (fits.outputs, fits.inputs),
        })
    }

    /// The response with `[W_1 ... W_ng]`.
    pub(crate) fn response(&self, weights: &DMatrix<f64>) -> Result<Frf, IdentError> {
        let (ny, nu) = self.channels;
        let mut frf = Frf::zeros(self.frequencies_hz.clone(), ny, nu)?;
        // The entries of a W_i stand one after the other: a column each.
        let weights = MatRef::from_column_major_slice(weights.as_slice(), ny * nu, self.functions.nrows());
        let mut parts = vec![0.0; 2 * frf.values().len()];
        let product = MatMut::from_column_major_slice_mut(&mut parts, ny * nu, self.functions.ncols());
        matmul(product, Accum::Replace, weights, &self.functions, 1.0, Par::Seq);
        let (re, im) = parts.split_at(frf.values().len());
        for ((value, re), im) in frf.values_mut().iter_mut().zip(re).zip(im) {
            *value = Complex::new(*re, *im);
        }
        for (value, rigid) in frf.values_mut().iter_mut().zip(&self.rigid) {
            *value += rigid;
        }
        Ok(frf)
    }
}

impl LocalFits {
    /// The frozen response at a fitted position.
    ///
    /// # Errors
    /// Frequencies that the basis refuses; a line at zero.
    ///
    /// # Panics
    /// If there is no such position.
    pub fn response(&self, position: usize, frequencies_hz: &[f64]) -> Result<Frf, IdentError> {
        Expansion::new(self, frequencies_hz)?.response(&self.fits[position].weights)
    }
}
