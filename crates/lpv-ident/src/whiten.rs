//! The factors that turn the error of a line into independent unit noise.

use crate::{IdentError, Weighting};
use lpv_core::FrfEstimate;
use nalgebra::{Cholesky, DMatrix};
use num_complex::Complex;

type C64 = Complex<f64>;

/// `N = left dF right` has independent entries whose real and imaginary parts have variance one each.
///
/// With `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]`, `C = L_C L_C^H` and `S = L_S L_S^H`, these are
/// `left = sqrt(2) L_C^-1` and `right = L_S^-H`: then `dF = L_C N L_S^H / sqrt(2)` has the covariance
/// `C[i,k] (L_S L_S^H)[l,j]`.
pub(crate) struct Whitening {
    pub(crate) left: DMatrix<C64>,
    pub(crate) right: DMatrix<C64>,
}

pub(crate) fn whitening(
    estimate: &FrfEstimate,
    line: usize,
    weighting: Weighting,
    position: f64,
) -> Result<Whitening, IdentError> {
    let frf = estimate.frf();
    let (ny, nu) = (frf.outputs(), frf.inputs());
    let scaled = |s: f64| Whitening {
        left: DMatrix::identity(ny, ny) * C64::from(s),
        right: DMatrix::identity(nu, nu),
    };
    match weighting {
        Weighting::Uniform => Ok(scaled(1.0)),
        Weighting::Relative => Ok(scaled(1.0 / frf.line(line).norm().max(f64::MIN_POSITIVE))),
        Weighting::Covariance => {
            let refused = || IdentError::Covariance {
                position,
                line,
                frequency_hz: frf.frequencies_hz()[line],
            };
            let inverse_factor = |m: DMatrix<C64>| {
                let n = m.nrows();
                Cholesky::new(m).and_then(|c| c.l().solve_lower_triangular(&DMatrix::identity(n, n)))
            };
            let left = inverse_factor(estimate.output_covariance(line).into_owned()).ok_or_else(refused)?;
            let right = inverse_factor(estimate.input_factor(line).into_owned())
                .ok_or_else(refused)?
                .adjoint();
            if left
                .iter()
                .chain(right.iter())
                .any(|v| !(v.re.is_finite() && v.im.is_finite()))
            {
                return Err(refused());
            }
            Ok(Whitening {
                left: left * C64::from(std::f64::consts::SQRT_2),
                right,
            })
        }
    }
}
