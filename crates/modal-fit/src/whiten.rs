//! The factors that make the noise of a line independent, with variance one in real and imaginary parts.

use crate::ModalFitError;
use lpv_core::FrfEstimate;
use nalgebra::{DMatrix, Dyn};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Least deviation of a row, relative to the row: data without noise need a weight too.
const FLOOR: f64 = 1e-9;

/// `left dF right` has independent entries: `left = sqrt(2) L_C^-1`, `right = L_S^-H` with `C_V = L_C L_C^H`, `S = L_S L_S^H`.
pub(crate) struct Factors {
    pub(crate) left: DMatrix<C64>,
    pub(crate) right: DMatrix<C64>,
}

pub(crate) fn factors(estimate: &FrfEstimate) -> Result<Vec<Factors>, ModalFitError> {
    let (n_y, n_u) = (estimate.frf().outputs(), estimate.frf().inputs());
    let one = |k: usize| {
        let failed = || ModalFitError::Covariance {
            frequency_hz: estimate.frf().frequencies_hz()[k],
        };
        let line = estimate.frf().line(k);
        let mut c = hermitian(&estimate.output_covariance(k).into_owned());
        let mut s = hermitian(&estimate.input_factor(k).into_owned());
        let trace = s.trace().re;
        if trace <= 0.0 {
            s = DMatrix::identity(n_u, n_u);
        }
        let trace = if trace > 0.0 { trace } else { n_u as f64 };
        let largest = line.norm();
        for i in 0..n_y {
            // Outputs may have units that differ by any factor: only one that is zero is measured by the others.
            let own = line.row(i).norm();
            let row = if own > 0.0 { own } else { largest }.max(f64::MIN_POSITIVE.sqrt());
            c[(i, i)] += C64::from(FLOOR.powi(2) * row * row / trace);
        }
        for j in 0..n_u {
            s[(j, j)] *= C64::from(1.0 + 1e-14);
        }
        let left = inverse_factor(c).ok_or_else(failed)? * C64::from(std::f64::consts::SQRT_2);
        let right = inverse_factor(s).ok_or_else(failed)?.adjoint();
        Ok(Factors { left, right })
    };
    (0..estimate.frf().len()).map(one).collect()
}

fn hermitian(m: &DMatrix<C64>) -> DMatrix<C64> {
    (m + m.adjoint()) * C64::from(0.5)
}

/// `L^-1` of `M = L L^H`.
fn inverse_factor(m: DMatrix<C64>) -> Option<DMatrix<C64>> {
    let n = m.nrows();
    let lower = nalgebra::Cholesky::<C64, Dyn>::new(m)?.l();
    let inverse = lower.solve_lower_triangular(&DMatrix::identity(n, n))?;
    inverse
        .iter()
        .all(|v| v.re.is_finite() && v.im.is_finite())
        .then_some(inverse)
}
