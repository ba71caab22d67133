//! The factors that turn the error of a line into independent unit noise.

use lpv_core::FrfEstimate;
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// A pivot below this part of its diagonal entry is rounding. It would be taken for a direction without noise and
/// outweigh every other line.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// `W_y dF W_u` has independent entries whose real and imaginary parts have variance one each.
///
/// With `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]`, `C = L_C L_C^H` and `S = L_S L_S^H`, these are `W_y = sqrt(2) L_C^-1`
/// and `W_u = L_S^-H`.
#[derive(Debug, Clone)]
pub(crate) struct Whitening {
    outputs: usize,
    inputs: usize,
    /// `W_y` a line, column-major.
    left: Vec<C64>,
    /// `W_u` a line, column-major.
    right: Vec<C64>,
}

impl Whitening {
    /// The factors of every line, with `(model_error ||G_i||)^2 / tr(S)` added to `C_ii`, which adds
    /// `(model_error ||G_i||)^2` to the variance of row i. The line that has none as error.
    pub(crate) fn new(estimate: &FrfEstimate, model_error: f64) -> Result<Self, usize> {
        let frf = estimate.frf();
        let (ny, nu) = (frf.outputs(), frf.inputs());
        let mut whitening = Self {
            outputs: ny,
            inputs: nu,
            left: Vec::with_capacity(frf.len() * ny * ny),
            right: Vec::with_capacity(frf.len() * nu * nu),
        };
        for k in 0..frf.len() {
            let s = estimate.input_factor(k).into_owned();
            let mut c = estimate.output_covariance(k).into_owned();
            let trace = s.trace().re;
            for (i, row) in frf.line(k).row_iter().enumerate() {
                c[(i, i)] += model_error.powi(2) * row.norm_squared() / trace;
            }
            let left = inverse_cholesky(&c).ok_or(k)? * C64::from(std::f64::consts::SQRT_2);
            let right = inverse_cholesky(&s).ok_or(k)?.adjoint();
            whitening.left.extend(left.iter());
            whitening.right.extend(right.iter());
        }
        Ok(whitening)
    }

    /// Factors that are known, line after line, column-major.
    pub(crate) fn from_factors(outputs: usize, inputs: usize, left: Vec<C64>, right: Vec<C64>) -> Self {
        Self {
            outputs,
            inputs,
            left,
            right,
        }
    }

    pub(crate) fn left(&self, line: usize) -> &[C64] {
        let size = self.outputs * self.outputs;
        &self.left[line * size..(line + 1) * size]
    }
    pub(crate) fn right(&self, line: usize) -> &[C64] {
        let size = self.inputs * self.inputs;
        &self.right[line * size..(line + 1) * size]
    }
    pub(crate) fn select(&self, lines: &[usize]) -> Self {
        Self {
            left: lines.iter().flat_map(|&k| self.left(k).to_vec()).collect(),
            right: lines.iter().flat_map(|&k| self.right(k).to_vec()).collect(),
            ..*self
        }
    }
}

/// `L^-1` of `m = L L^H`; none where `m` is not positive definite beyond rounding.
fn inverse_cholesky(m: &DMatrix<C64>) -> Option<DMatrix<C64>> {
    let n = m.nrows();
    let factor = m.clone().cholesky()?.unpack();
    let good = |i: usize| factor[(i, i)].re.powi(2) > ROUNDING * n as f64 * m[(i, i)].re;
    if !(0..n).all(good) {
        return None;
    }
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(n, n))?;
    inverse
        .iter()
        .all(|v| v.re.is_finite() && v.im.is_finite())
        .then_some(inverse)
}
