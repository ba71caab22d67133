//! The factors that turn the error of a line into independent unit noise.

use lpv_core::FrfEstimate;
use num_complex::Complex;

type C64 = Complex<f64>;

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
        let (outputs, inputs, lines) = (frf.outputs(), frf.inputs(), frf.len());
        let mut factors = lpv_numerics::whiten::Whitening::new(outputs, inputs, lines);
        factors.set_covariance(estimate, 0..lines, model_error)?;
        let factors = factors.roots();
        Ok(Self {
            outputs,
            inputs,
            left: by_line(lines, outputs, |i, j, k| match i >= j {
                true => factors.left.entry(i, j).at(k),
                false => C64::default(),
            }),
            right: by_line(lines, inputs, |i, j, k| match j >= i {
                true => factors.right_adjoint.entry(j, i).at(k).conj(),
                false => C64::default(),
            }),
        })
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

/// Square matrices of all lines, column-major.
fn by_line(lines: usize, size: usize, entry: impl Fn(usize, usize, usize) -> C64) -> Vec<C64> {
    let places = || (0..size).flat_map(|j| (0..size).map(move |i| (i, j)));
    let line = |k| places().map(move |(i, j)| (i, j, k));
    (0..lines)
        .flat_map(line)
        .map(|(i, j, k)| entry(i, j, k))
        .collect()
}
