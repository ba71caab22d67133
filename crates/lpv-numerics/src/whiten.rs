//! The factors that turn the error of a line into independent unit noise.

use crate::planes::Planes;
use lpv_core::FrfEstimate;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// A pivot below this part of its diagonal entry is rounding. It would be taken for a direction without noise and
/// outweigh every other line.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Lower triangular matrices, one a line: planes of the entries `(i, j)`, `i >= j`, row after row.
#[derive(Debug)]
pub struct Lower {
    size: usize,
    entries: Vec<Planes>,
    /// Not zero on lines that cannot be inverted.
    bad: Vec<f64>,
}

fn place(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// `N = left dF right` has independent entries whose real and imaginary parts have variance one each, on every line of a
/// block.
///
/// With `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]`, `C / 2 = L_C D_C L_C^H` and `S = L_S D_S L_S^H`, ones on the diagonals of both
/// `L`, these are `left = D_C^-1/2 L_C^-1` and `right = L_S^-H D_S^-1/2`: then `dF = left^-1 N right^-1` has that covariance.
#[derive(Debug)]
pub struct Whitening {
    /// `L_C^-1` below the diagonal, `D_C^-1` on it; `left` after [`Whitening::roots`].
    pub left: Lower,
    /// `L_S^-1` below the diagonal, `D_S^-1` on it; the adjoint of `right` after [`Whitening::roots`].
    pub right_adjoint: Lower,
}

impl Whitening {
    /// For blocks of up to `lines` lines.
    pub fn new(outputs: usize, inputs: usize, lines: usize) -> Self {
        Self {
            left: Lower::identity(outputs, lines),
            right_adjoint: Lower::identity(inputs, lines),
        }
    }

    /// `left` the weight of each line times one; `right` one. For weights that know no covariance, which need no [`Whitening::roots`].
    pub fn set_weight(&mut self, row: usize, weight: f64) {
        for i in 0..self.left.size {
            self.left.entries[place(i, i)].set(row, Complex::from(weight));
        }
    }

    /// Computes the factors of a block from the covariance of the estimate, with `(model_error ||F_i||)^2` added to the variance of
    /// each row i, spread over its channels as the noise is; what stands beyond its lines means nothing.
    ///
    /// # Errors
    /// The first line whose covariance is not positive definite beyond rounding.
    pub fn set_covariance(
        &mut self,
        estimate: &FrfEstimate,
        lines: Range<usize>,
        model_error: f64,
    ) -> Result<(), usize> {
        let first = lines.start;
        let bad = pulp::Arch::new().dispatch(Inversion {
            whitening: self,
            estimate,
            lines,
            model_error,
        });
        bad.map_or(Ok(()), |row| Err(first + row))
    }

    /// Both with the roots of their diagonals.
    pub fn roots(mut self) -> Self {
        self.left.roots();
        self.right_adjoint.roots();
        self
    }

    /// What the basis cannot represent, as noise: `(relative ||F_i||)^2` for the variance of each row i of F, spread over
    /// its channels as the noise is, so that `C_ii` grows by that over `tr(S)`.
    #[inline(always)]
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
    estimate: &'a FrfEstimate,
    lines: Range<usize>,
    model_error: f64,
}

impl WithSimd for Inversion<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Option<usize> {
        let Self {
            whitening,
            estimate,
            lines,
            model_error,
        } = self;
        let count = lines.len();
        // Half of C, for the factor sqrt(2).
        let covariances = estimate.output_covariances();
        whitening.left.gather(lines.clone(), covariances, 0.5);
        let factors = estimate.input_factors();
        whitening.right_adjoint.gather(lines.clone(), factors, 1.0);
        whitening.add_model_error(estimate, lines, model_error);
        let Whitening { left, right_adjoint } = whitening;
        let bad = left.invert(count);
        bad.into_iter().chain(right_adjoint.invert(count)).min()
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
            bad: vec![0.0; lines],
        }
    }

    /// Rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Entry `(i, j)`, `i >= j`.
    pub fn entry(&self, i: usize, j: usize) -> &Planes {
        &self.entries[place(i, j)]
    }

    /// The lower triangles of matrices of all lines, times a factor.
    #[inline(always)]
    fn gather(&mut self, lines: Range<usize>, matrices: &[Complex<f64>], factor: f64) {
        let n = self.size;
        for i in 0..n {
            for j in 0..=i {
                self.entries[place(i, j)].gather((matrices, n * n), lines.clone(), j * n + i, factor);
            }
        }
    }

    /// Turns the lower triangles of `M = L D L^H` into `L^-1` with `D^-1` on its diagonal. The first line, if any, where `M` is
    /// not positive definite beyond rounding or its factor overflows.
    #[inline(always)]
    fn invert(&mut self, lines: usize) -> Option<usize> {
        let n = self.size;
        self.bad.fill(0.0);
        for i in 0..n {
            // The diagonal is real; the planes of its imaginary parts keep it for the comparison with what is left of it.
            let Planes { re, im } = &mut self.entries[place(i, i)];
            im.copy_from_slice(re);
        }
        for j in 0..n {
            let mut pivot = std::mem::take(&mut self.entries[place(j, j)]);
            let (left, whole) = (&mut pivot.re, &mut pivot.im);
            let least = ROUNDING * n as f64;
            for ((bad, l), w) in self.bad.iter_mut().zip(left.iter_mut()).zip(whole.iter_mut()) {
                // Also where the pivot is not a number.
                *bad += if *l > least * *w { 0.0 } else { 1.0 };
                (*l, *w) = (1.0 / *l, 0.0);
            }
            for i in j + 1..n {
                // L[i, j], and what the rows from there on lose by it.
                let mut own = std::mem::take(&mut self.entries[place(i, j)]);
                let diagonal = &mut self.entries[place(i, i)].re;
                for (((d, w), re), im) in diagonal.iter_mut().zip(left.iter()).zip(&own.re).zip(&own.im) {
                    // The square alone might be no number in extreme units.
                    *d -= re * (re * w) + im * (im * w);
                }
                own.scale(left);
                for row in i + 1..n {
                    let mut entry = std::mem::take(&mut self.entries[place(row, i)]);
                    entry.add_product(&self.entries[place(row, j)], &own, -1.0, -1.0);
                    self.entries[place(row, i)] = entry;
                }
                self.entries[place(i, j)] = own;
            }
            self.entries[place(j, j)] = pivot;
        }
        // Column by column from the left: row i still holds L right of the column.
        for j in 0..n {
            for i in j + 1..n {
                let mut sum = std::mem::take(&mut self.entries[place(i, j)]);
                sum.re.iter_mut().chain(&mut sum.im).for_each(|v| *v = -*v);
                for k in j + 1..i {
                    sum.add_product(&self.entries[place(i, k)], &self.entries[place(k, j)], -1.0, 1.0);
                }
                self.entries[place(i, j)] = sum;
            }
        }
        for entry in &self.entries {
            for ((bad, re), im) in self.bad.iter_mut().zip(&entry.re).zip(&entry.im) {
                // Nothing times what is not finite is not zero.
                *bad += if 0.0 * re + 0.0 * im == 0.0 { 0.0 } else { 1.0 };
            }
        }
        self.bad[..lines].iter().position(|b| *b != 0.0)
    }

    /// Turns `L^-1` and `D^-1` into `D^-1/2 L^-1`.
    fn roots(&mut self) {
        for i in 0..self.size {
            let root: Vec<f64> = self.entries[place(i, i)].re.iter().map(|d| d.sqrt()).collect();
            for entry in &mut self.entries[place(i, 0)..place(i, i)] {
                entry.scale(&root);
            }
            self.entries[place(i, i)].re = root;
        }
    }
}
