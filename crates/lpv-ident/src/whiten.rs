//! The factors that turn the error of a line into independent unit noise.

use crate::planes::Planes;
use crate::{CheckedRegression, IdentError, Weighting};
use lpv_core::FrfEstimate;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// A pivot below this part of its diagonal entry is rounding. It would be taken for a direction without noise and
/// outweigh every other line.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Lower triangular matrices, one a line: planes of the entries `(i, j)`, `i >= j`, row after row.
#[derive(Debug)]
pub(crate) struct Lower {
    size: usize,
    entries: Vec<Planes>,
    scratch: Planes,
}

fn place(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// `N = left dF right` has independent entries whose real and imaginary parts have variance one each, on every line of a
/// block.
///
/// With `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]`, `C = L_C L_C^H` and `S = L_S L_S^H`, these are
/// `left = sqrt(2) L_C^-1` and `right = L_S^-H`: then `dF = L_C N L_S^H / sqrt(2)` has the covariance
/// `C[i,k] (L_S L_S^H)[l,j]`.
pub(crate) struct Whitening {
    /// `left`.
    pub(crate) left: Lower,
    /// `L_S^-1`, the adjoint of `right`.
    pub(crate) right_adjoint: Lower,
}

impl Whitening {
    /// For blocks of up to `lines` lines.
    pub(crate) fn new(outputs: usize, inputs: usize, lines: usize) -> Self {
        Self {
            left: Lower::identity(outputs, lines),
            right_adjoint: Lower::identity(inputs, lines),
        }
    }

    /// Computes the factors of a block; what stands beyond its lines means nothing.
    pub(crate) fn set(
        &mut self,
        estimate: &FrfEstimate,
        lines: Range<usize>,
        settings: &CheckedRegression,
        position: f64,
    ) -> Result<(), IdentError> {
        let frf = estimate.frf();
        match settings.weighting() {
            Weighting::Uniform => {}
            Weighting::Relative => {
                for (row, k) in lines.enumerate() {
                    let size = frf.line(k).norm().max(f64::MIN_POSITIVE);
                    for i in 0..self.left.size {
                        self.left.entries[place(i, i)].set(row, Complex::from(1.0 / size));
                    }
                }
            }
            Weighting::Covariance => {
                // Half of C, for the factor sqrt(2).
                self.left
                    .gather(lines.clone(), estimate.output_covariances(), 0.5);
                self.right_adjoint
                    .gather(lines.clone(), estimate.input_factors(), 1.0);
                self.add_model_error(estimate, lines.clone(), settings.model_error());
                let bad = pulp::Arch::new().dispatch(Inversion {
                    whitening: self,
                    lines: lines.len(),
                });
                if let Some(row) = bad {
                    let line = lines.start + row;
                    return Err(IdentError::Covariance {
                        position,
                        line,
                        frequency_hz: frf.frequencies_hz()[line],
                    });
                }
            }
        }
        Ok(())
    }

    /// What the basis cannot represent, as noise: `(relative ||F_i||)^2` for the variance of each row i of F, spread over
    /// its channels as the noise is, so that `C_ii` grows by that over `tr(S)`.
    fn add_model_error(&mut self, estimate: &FrfEstimate, lines: Range<usize>, relative: f64) {
        if relative == 0.0 {
            return;
        }
        let (ny, nu) = (self.left.size, self.right_adjoint.size);
        let (values, factors) = (estimate.frf().values(), estimate.input_factors());
        for (at, k) in lines.enumerate() {
            let line = &values[k * ny * nu..(k + 1) * ny * nu];
            let factor = &factors[k * nu * nu..(k + 1) * nu * nu];
            let trace: f64 = factor.iter().step_by(nu + 1).map(|v| v.re).sum();
            for i in 0..ny {
                let size: f64 = line[i..].iter().step_by(ny).map(|v| v.norm_sqr()).sum();
                self.left.entries[place(i, i)].re[at] += 0.5 * relative.powi(2) * size / trace;
            }
        }
    }
}

/// Both factors of all lines of a block, in vector registers.
struct Inversion<'a> {
    whitening: &'a mut Whitening,
    lines: usize,
}

impl WithSimd for Inversion<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Option<usize> {
        let Whitening { left, right_adjoint } = self.whitening;
        let bad = left.invert_cholesky(self.lines);
        bad.into_iter()
            .chain(right_adjoint.invert_cholesky(self.lines))
            .min()
    }
}

impl Lower {
    fn identity(size: usize, lines: usize) -> Self {
        let mut entries = vec![Planes::zeros(lines); place(size, 0)];
        for i in 0..size {
            entries[place(i, i)].fill(1.0);
        }
        Self {
            size,
            entries,
            scratch: Planes::zeros(lines),
        }
    }

    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Entry `(i, j)`, `i >= j`.
    pub(crate) fn entry(&self, i: usize, j: usize) -> &Planes {
        &self.entries[place(i, j)]
    }

    /// The lower triangles of matrices of all lines, times a factor.
    fn gather(&mut self, lines: Range<usize>, matrices: &[Complex<f64>], factor: f64) {
        let n = self.size;
        for i in 0..n {
            for j in 0..=i {
                self.entries[place(i, j)].gather((matrices, n * n), lines.clone(), j * n + i, factor);
            }
        }
    }

    /// Turns the lower triangles of `M = L L^H` into `L^-1`. The first line, if any, where `M` is not positive definite
    /// beyond rounding or its factor overflows.
    #[inline(always)]
    fn invert_cholesky(&mut self, lines: usize) -> Option<usize> {
        let n = self.size;
        let mut bad = vec![0.0; lines];
        for j in 0..n {
            let mut pivot = std::mem::take(&mut self.entries[place(j, j)]);
            // The diagonal is real; the plane of its imaginary parts keeps what is left of it for the comparison.
            let (left, whole) = (&mut pivot.re, &mut pivot.im);
            whole.copy_from_slice(left);
            for k in 0..j {
                let row = &self.entries[place(j, k)];
                for ((l, re), im) in left.iter_mut().zip(&row.re).zip(&row.im) {
                    *l -= re * re + im * im;
                }
            }
            let least = ROUNDING * n as f64;
            for ((bad, l), w) in bad.iter_mut().zip(left.iter()).zip(whole.iter()) {
                // Also where the pivot is not a number.
                *bad += if *l > least * w { 0.0 } else { 1.0 };
            }
            for v in left.iter_mut() {
                *v = 1.0 / v.sqrt();
            }
            for i in j + 1..n {
                let mut entry = std::mem::take(&mut self.entries[place(i, j)]);
                for k in 0..j {
                    let (x, y) = (&self.entries[place(i, k)], &self.entries[place(j, k)]);
                    entry.add_product(x, y, -1.0, -1.0);
                }
                entry.scale(left);
                self.entries[place(i, j)] = entry;
            }
            whole.fill(0.0);
            self.entries[place(j, j)] = pivot;
        }
        // Column by column from the left: row i still holds L right of the column; the diagonal is inverted already.
        for j in 0..n {
            for i in j + 1..n {
                let sum = &mut self.scratch;
                let terms = |k| (&self.entries[place(i, k)], &self.entries[place(k, j)]);
                let (x, y) = terms(j);
                sum.set_product(x, y, -1.0, 1.0);
                for (x, y) in (j + 1..i).map(terms) {
                    sum.add_product(x, y, -1.0, 1.0);
                }
                sum.scale(&self.entries[place(i, i)].re);
                std::mem::swap(sum, &mut self.entries[place(i, j)]);
            }
        }
        for entry in &self.entries {
            for ((bad, re), im) in bad.iter_mut().zip(&entry.re).zip(&entry.im) {
                // Nothing times what is not finite is not zero.
                *bad += if 0.0 * re + 0.0 * im == 0.0 { 0.0 } else { 1.0 };
            }
        }
        bad.iter().position(|b| *b != 0.0)
    }
}
