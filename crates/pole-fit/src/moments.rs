//! Normal matrices from moments: every block of the Gauss-Newton matrix is a weighted sum over the lines of the same
//! products `conj(q_i) q_j`, so that one product of two tall matrices gives them all.

use crate::basis::Basis;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;

/// `conj(q_i) q_j` for `i <= j`, one column of lines a pair.
#[derive(Debug, Clone)]
pub(crate) struct Products {
    lines: usize,
    pairs: usize,
    re: Vec<f64>,
    im: Vec<f64>,
}

/// Sums over the lines: `re[pair, column]` of the real parts against real weights, `im` of the imaginary parts.
#[derive(Debug)]
pub(crate) struct Moments {
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

impl Products {
    pub(crate) fn new(basis: &Basis) -> Self {
        let (lines, size) = (basis.lines, basis.size());
        let pairs = size * (size + 1) / 2;
        let mut re = vec![0.0; pairs * lines];
        let mut im = vec![0.0; pairs * lines];
        let mut pair = 0;
        for j in 0..size {
            let (c, d) = basis.column(j);
            for i in 0..=j {
                let (a, b) = basis.column(i);
                let re = &mut re[pair * lines..(pair + 1) * lines];
                let im = &mut im[pair * lines..(pair + 1) * lines];
                for k in 0..lines {
                    re[k] = a[k] * c[k] + b[k] * d[k];
                    im[k] = a[k] * d[k] - b[k] * c[k];
                }
                pair += 1;
            }
        }
        Self { lines, pairs, re, im }
    }

    /// Sums with real weights `real` and imaginary weights `imaginary`, one column of lines each.
    pub(crate) fn sum(&self, real: &[f64], imaginary: &[f64]) -> Moments {
        Moments {
            re: self.product(&self.re, real),
            im: self.product(&self.im, imaginary),
        }
    }

    fn product(&self, left: &[f64], right: &[f64]) -> DMatrix<f64> {
        let columns = right.len() / self.lines;
        let mut out = DMatrix::zeros(self.pairs, columns);
        if columns > 0 {
            let left = MatRef::from_column_major_slice(left, self.lines, self.pairs);
            let right = MatRef::from_column_major_slice(right, self.lines, columns);
            let target = MatMut::from_column_major_slice_mut(out.as_mut_slice(), self.pairs, columns);
            matmul(target, Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
        }
        out
    }
}

impl Moments {
    /// `sum_k w_k Re(conj(q_i) q_j)` with the real weight in column `r`.
    pub(crate) fn real(&self, i: usize, j: usize, r: usize) -> f64 {
        self.re[(pair(i, j), r)]
    }
    /// `sum_k Re(w_k conj(q_i) q_j)` with the weight's real part in column `r` and imaginary part in column `s`.
    pub(crate) fn complex(&self, i: usize, j: usize, r: usize, s: usize) -> f64 {
        let (re, im) = (self.re[(pair(i, j), r)], self.im[(pair(i, j), s)]);
        if i <= j { re - im } else { re + im }
    }
}

fn pair(i: usize, j: usize) -> usize {
    let (low, high) = if i <= j { (i, j) } else { (j, i) };
    high * (high + 1) / 2 + low
}
