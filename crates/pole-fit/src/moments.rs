//! Normal matrices from moments: every block of the Gauss-Newton matrix is a weighted sum over the lines of the same
//! products `conj(q_i) q_j`, so that one product of two tall matrices, block after block of lines, gives them all.

use crate::columns::{Columns, blocks, each, wide};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::DMatrix;
use std::ops::Range;

/// Sums over the lines: `re[pair, column]` of the real parts against real weights, `im` of the imaginary parts.
#[derive(Debug)]
pub(crate) struct Moments {
    re: DMatrix<f64>,
    im: DMatrix<f64>,
}

impl Moments {
    /// Sums of the products of all `q` with real weights `real` and imaginary weights `imaginary`, a column each.
    ///
    /// The products are made anew for some lines at a time: that takes less time than to fetch them from memory.
    pub(crate) fn new(q: &Columns, real: &[f64], imaginary: &[f64]) -> Self {
        let lines = q.lines();
        let pairs = q.count() * (q.count() + 1) / 2;
        let mut re = DMatrix::zeros(pairs, real.len() / lines);
        let mut im = DMatrix::zeros(pairs, imaginary.len() / lines);
        let mut products = Vec::new();
        for block in blocks(lines) {
            let part = block.len() * pairs;
            products.resize(2 * part, 0.0);
            let (of_re, of_im) = products.split_at_mut(part);
            if imaginary.is_empty() {
                multiply_real(q, &block, of_re);
            } else {
                multiply(q, &block, of_re, of_im);
            }
            add(&mut re, of_re, real, &block, lines);
            add(&mut im, of_im, imaginary, &block, lines);
        }
        Self { re, im }
    }

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

wide! {
    /// `conj(q_i) q_j` for `i <= j`, one column of the block's lines a pair.
    fn multiply(q: &'a Columns, block: &'a Range<usize>, re: &'a mut [f64], im: &'a mut [f64]) -> () {
        let lines = block.len();
        let mut pairs = re.chunks_exact_mut(lines).zip(im.chunks_exact_mut(lines));
        for j in 0..q.count() {
            for (i, to) in (0..=j).zip(&mut pairs) {
                each(q.part(i, block), q.part(j, block), to, |[a, b], [c, d], _| [a * c + b * d, a * d - b * c]);
            }
        }
    }
}

wide! {
    /// The real parts alone.
    fn multiply_real(q: &'a Columns, block: &'a Range<usize>, re: &'a mut [f64]) -> () {
        let mut pairs = re.chunks_exact_mut(block.len());
        for j in 0..q.count() {
            for (i, to) in (0..=j).zip(&mut pairs) {
                let ((a, b), (c, d)) = (q.part(i, block), q.part(j, block));
                for (to, ((a, b), (c, d))) in to.iter_mut().zip(a.iter().zip(b).zip(c.iter().zip(d))) {
                    *to = a * c + b * d;
                }
            }
        }
    }
}

/// Adds the sums over the lines of a block.
fn add(sums: &mut DMatrix<f64>, products: &[f64], weights: &[f64], block: &Range<usize>, lines: usize) {
    let (pairs, columns) = sums.shape();
    if columns == 0 {
        return;
    }
    let products = MatRef::from_column_major_slice(products, block.len(), pairs);
    let weights = MatRef::from_column_major_slice(weights, lines, columns).subrows(block.start, block.len());
    let target = MatMut::from_column_major_slice_mut(sums.as_mut_slice(), pairs, columns);
    matmul(target, Accum::Add, products.transpose(), weights, 1.0, Par::Seq);
}

fn pair(i: usize, j: usize) -> usize {
    let (low, high) = if i <= j { (i, j) } else { (j, i) };
    high * (high + 1) / 2 + low
}
