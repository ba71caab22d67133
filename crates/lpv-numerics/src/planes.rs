//! Complex numbers of many lines as two planes, which lets products over lines run in vector registers.

use num_complex::Complex;
use std::ops::Range;

/// Most lanes that a register of doubles has.
pub const WIDEST: usize = 8;

/// Real and imaginary parts by line.
#[derive(Debug, Clone, Default)]
pub struct Planes {
    /// Real parts.
    pub re: Vec<f64>,
    /// Imaginary parts.
    pub im: Vec<f64>,
}

impl Planes {
    /// Zeros on so many lines.
    pub fn zeros(n: usize) -> Self {
        Self {
            re: vec![0.0; n],
            im: vec![0.0; n],
        }
    }

    /// So many lines, of which these come first and zeros follow.
    pub fn collect(n: usize, values: impl Iterator<Item = Complex<f64>>) -> Self {
        let mut all = Self::zeros(n);
        for ((re, im), v) in all.re.iter_mut().zip(&mut all.im).zip(values) {
            (*re, *im) = (v.re, v.im);
        }
        all
    }

    /// Overwrites the first lines with entry `at` of each of `lines` times a factor; `values` has `size` entries a line.
    #[inline(always)]
    pub fn gather(
        &mut self,
        (values, size): (&[Complex<f64>], usize),
        lines: Range<usize>,
        at: usize,
        factor: f64,
    ) {
        let lines = values[lines.start * size..lines.end * size].chunks_exact(size);
        for ((re, im), line) in self.re.iter_mut().zip(&mut self.im).zip(lines) {
            (*re, *im) = (factor * line[at].re, factor * line[at].im);
        }
    }

    /// The number on one line.
    pub fn at(&self, k: usize) -> Complex<f64> {
        Complex::new(self.re[k], self.im[k])
    }

    /// Sets one line.
    pub fn set(&mut self, k: usize, v: Complex<f64>) {
        (self.re[k], self.im[k]) = (v.re, v.im);
    }

    /// The same real number on all lines.
    pub fn fill(&mut self, v: f64) {
        self.re.fill(v);
        self.im.fill(0.0);
    }

    /// These lines, both parts.
    #[inline(always)]
    pub fn part(&self, lines: Range<usize>) -> (&[f64], &[f64]) {
        (&self.re[lines.clone()], &self.im[lines])
    }

    /// `self += sign x y`, or with `conj(y)` for a negative `conjugate`.
    #[inline(always)]
    pub fn add_product(&mut self, x: &Self, y: &Self, sign: f64, conjugate: f64) {
        let n = self.re.len();
        let (re, im) = (&mut self.re[..n], &mut self.im[..n]);
        let (xr, xi, yr, yi) = (&x.re[..n], &x.im[..n], &y.re[..n], &y.im[..n]);
        for k in 0..n {
            let yi = conjugate * yi[k];
            re[k] += sign * (xr[k] * yr[k] - xi[k] * yi);
            im[k] += sign * (xr[k] * yi + xi[k] * yr[k]);
        }
    }

    /// `self *= factor`, line by line.
    #[inline(always)]
    pub fn scale(&mut self, factor: &[f64]) {
        for ((re, im), f) in self.re.iter_mut().zip(&mut self.im).zip(factor) {
            *re *= f;
            *im *= f;
        }
    }
}
