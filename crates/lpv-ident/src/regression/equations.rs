//! The equations of one position, and what is left of them.

use super::rigid_response;
use crate::{IdentError, RegressionSettings};
use lpv_core::{Discrete, Frf, FrfEstimate, Position, StateSpace};
use lpv_numerics::planes::{Planes, WIDEST};
use nalgebra::DMatrix;
use num_complex::Complex;
use rayon::prelude::*;
use std::ops::Range;

type C64 = Complex<f64>;

/// Lines that one task of the filters' response takes.
const CHUNK: usize = 1024;

/// The equations of one position.
pub(super) struct Equations<'a> {
    pub(super) estimate: &'a FrfEstimate,
    pub(super) position: &'a Position,
    /// Lines of the estimate that are fitted.
    pub(super) kept: Range<usize>,
    pub(super) regressors: &'a Regressors,
    pub(super) settings: &'a RegressionSettings,
}

/// What one position leaves after its own coefficients are eliminated: `R22 c = r2`, and the residual.
pub(super) struct Eliminated {
    pub(super) position: Position,
    /// The triangular factor of `[Phi_W, Phi_c, F]`, whitened.
    pub(super) r: DMatrix<f64>,
    pub(super) unknowns: usize,
    pub(super) equations: usize,
    pub(super) factorisations: usize,
}

/// The responses of the filters, and of the rigid body, on one set of lines.
pub(super) struct Regressors {
    pub(super) frequencies_hz: Vec<f64>,
    pub(super) functions: Vec<Planes>,
    pub(super) rigid: Option<Planes>,
}

/// With zeros behind, so that whole registers can be read.
fn padded(lines: usize, values: impl Iterator<Item = C64>) -> Planes {
    Planes::collect(lines + WIDEST, values)
}

impl Regressors {
    pub(super) fn new(
        basis: &StateSpace<Discrete>,
        has_rigid_body: bool,
        frequencies_hz: Vec<f64>,
    ) -> Result<Self, IdentError> {
        let parts: Result<Vec<Frf>, _> = frequencies_hz
            .par_chunks(CHUNK)
            .map(|f| basis.frequency_response(f))
            .collect();
        // The whole list again on an error, so that the error counts its lines from the first.
        let parts = parts.or_else(|_| basis.frequency_response(&frequencies_hz).map(|whole| vec![whole]))?;
        let mut functions = vec![Planes::zeros(frequencies_hz.len() + WIDEST); basis.outputs()];
        for (part, start) in parts.iter().zip((0..).step_by(CHUNK)) {
            for (i, function) in functions.iter_mut().enumerate() {
                for (k, value) in (start..).zip(part.channel(i, 0)) {
                    function.set(k, value);
                }
            }
        }
        let rigid = has_rigid_body
            .then(|| {
                let phi_r = frequencies_hz.iter().map(|&f| rigid_response(basis.clock(), f));
                let phi_r = phi_r.collect::<Result<Vec<_>, _>>()?;
                Ok::<_, IdentError>(padded(phi_r.len(), phi_r.into_iter()))
            })
            .transpose()?;
        Ok(Self {
            frequencies_hz,
            functions,
            rigid,
        })
    }

    /// Planes of the functions, with zeros for some lines more than there are.
    pub(super) fn functions(&self) -> &[Planes] {
        &self.functions
    }

    /// The same of the rigid body, where it is needed.
    pub(super) fn rigid(&self) -> Option<&Planes> {
        self.rigid.as_ref()
    }

    pub(super) fn frequencies_hz(&self) -> &[f64] {
        &self.frequencies_hz
    }
}
