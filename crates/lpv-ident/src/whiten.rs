//! The factors that turn the error of a line into independent unit noise.

use crate::{IdentError, Weighting};
use lpv_core::FrfEstimate;
use nalgebra::{DMatrix, DMatrixView};
use num_complex::Complex;

type C64 = Complex<f64>;

/// A pivot below this part of its diagonal entry is rounding. It would be taken for a direction without noise and
/// outweigh every other line.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// `N = left dF right` has independent entries whose real and imaginary parts have variance one each.
///
/// With `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]`, `C = L_C L_C^H` and `S = L_S L_S^H`, these are
/// `left = sqrt(2) L_C^-1` and `right = L_S^-H`: then `dF = L_C N L_S^H / sqrt(2)` has the covariance
/// `C[i,k] (L_S L_S^H)[l,j]`. One value serves all lines of an estimate, so that no line costs an allocation.
pub(crate) struct Whitening {
    left: DMatrix<C64>,
    /// `L_S^-1`, the adjoint of `right`.
    right_adjoint: DMatrix<C64>,
}

impl Whitening {
    pub(crate) fn new(outputs: usize, inputs: usize) -> Self {
        Self {
            left: DMatrix::identity(outputs, outputs),
            right_adjoint: DMatrix::identity(inputs, inputs),
        }
    }

    /// Entry `(r, a)` of `left`, zero for `a > r`.
    pub(crate) fn left(&self, r: usize, a: usize) -> C64 {
        self.left[(r, a)]
    }

    /// Entry `(b, s)` of `right`, zero for `b > s`.
    pub(crate) fn right(&self, b: usize, s: usize) -> C64 {
        self.right_adjoint[(s, b)].conj()
    }

    /// Computes the factors of one line.
    pub(crate) fn set(
        &mut self,
        estimate: &FrfEstimate,
        line: usize,
        weighting: Weighting,
        position: f64,
    ) -> Result<(), IdentError> {
        let frf = estimate.frf();
        match weighting {
            Weighting::Uniform => {}
            Weighting::Relative => {
                let size = frf.line(line).norm().max(f64::MIN_POSITIVE);
                self.left.fill_diagonal(C64::from(1.0 / size));
            }
            Weighting::Covariance => {
                let good = inverse_cholesky(estimate.output_covariance(line), &mut self.left)
                    && inverse_cholesky(estimate.input_factor(line), &mut self.right_adjoint);
                if !good {
                    return Err(IdentError::Covariance {
                        position,
                        line,
                        frequency_hz: frf.frequencies_hz()[line],
                    });
                }
                self.left *= C64::from(std::f64::consts::SQRT_2);
            }
        }
        Ok(())
    }
}

/// Writes `L^-1` of `m = L L^H` into `out`, whose upper triangle is left alone; the lower triangle of `m` is read.
/// Returns false, with `out` unspecified, where `m` is not positive definite beyond rounding or its factor overflows.
fn inverse_cholesky(m: DMatrixView<'_, C64>, out: &mut DMatrix<C64>) -> bool {
    let n = m.nrows();
    for j in 0..n {
        let mut pivot = m[(j, j)].re;
        for k in 0..j {
            pivot -= out[(j, k)].norm_sqr();
        }
        if pivot.is_nan() || pivot <= ROUNDING * n as f64 * m[(j, j)].re {
            return false;
        }
        let diagonal = pivot.sqrt();
        out[(j, j)] = C64::from(diagonal);
        for i in j + 1..n {
            let mut sum = m[(i, j)];
            for k in 0..j {
                sum -= out[(i, k)] * out[(j, k)].conj();
            }
            out[(i, j)] = sum / diagonal;
        }
    }
    // In place, column by column from the left: row i below the diagonal still holds L where it is needed.
    for j in 0..n {
        out[(j, j)] = C64::from(1.0 / out[(j, j)].re);
        for i in j + 1..n {
            let mut sum = C64::from(0.0);
            for k in j..i {
                sum -= out[(i, k)] * out[(k, j)];
            }
            out[(i, j)] = sum / out[(i, i)].re;
        }
    }
    (0..n).all(|j| (j..n).all(|i| out[(i, j)].re.is_finite() && out[(i, j)].im.is_finite()))
}
