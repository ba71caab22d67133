//! Sums over lines of the products of two functions with the weights of two channels.

use super::weights::Weights;
use super::{BLOCK, Equations, pair, pair_off, pairs};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use lpv_numerics::planes::{Planes, WIDEST};
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// The sums of a group of positions.
pub(super) struct Products {
    functions: usize,
    channels: usize,
    /// Real parts: rows `n <= m`, columns `s <= t` of one position after the other.
    re: Mat<f64>,
    /// Imaginary parts: rows `n < m`, columns `s < t`.
    im: Mat<f64>,
    /// The products of the functions on a block: those rows and room for a register, a line a column.
    real: Mat<f64>,
    imaginary: Mat<f64>,
}

impl Products {
    pub(super) fn new(functions: usize, channels: usize, positions: usize) -> Self {
        let (all, apart) = pairs(functions);
        let (weights, imaginary_weights) = pairs(channels);
        Self {
            functions,
            channels,
            re: Mat::zeros(all, positions * weights),
            im: Mat::zeros(apart, positions * imaginary_weights),
            real: Mat::zeros(all + WIDEST - 1, BLOCK),
            imaginary: Mat::zeros(apart + WIDEST - 1, BLOCK),
        }
    }

    /// Adds the lines of a block.
    pub(super) fn add(&mut self, weights: &Weights, functions: &[&Planes], range: Range<usize>) {
        let lines = range.len();
        pulp::Arch::new().dispatch(Pairs {
            functions,
            range,
            real: &mut self.real,
            imaginary: &mut self.imaginary,
        });
        for (sums, products, weights) in [
            (&mut self.re, &self.real, weights.re(lines)),
            (&mut self.im, &self.imaginary, weights.im(lines)),
        ] {
            let products = products.get(..sums.nrows(), ..lines);
            matmul(sums, Accum::Add, products, weights, 1.0, Par::Seq);
        }
    }

    /// `Re sum B_st conj(phi_n) phi_m` at a position of the group.
    fn entry(&self, position: usize, (s, n): (usize, usize), (t, m): (usize, usize)) -> f64 {
        // The matrix is symmetric, and so is the product for a change of both pairs.
        let (s, n, t, m) = if s <= t { (s, n, t, m) } else { (t, m, s, n) };
        let (low, high) = (n.min(m), n.max(m));
        let (all, apart) = pairs(self.channels);
        let column = position * all + pair(self.channels, s, t);
        let re = self.re[(pair(self.functions, low, high), column)];
        if s == t || n == m {
            return re;
        }
        let column = position * apart + pair_off(self.channels, s, t);
        let im = self.im[(pair_off(self.functions, low, high), column)];
        if n < m { re - im } else { re + im }
    }

    pub(super) fn matrix(&self, position: usize, equations: &Equations<'_>) -> DMatrix<f64> {
        let ng = equations.regressors.functions().len();
        let ny = equations.estimate.frf().outputs();
        let coefficients = (0..self.channels).flat_map(|s| (0..ng).map(move |n| (s, n)));
        let rigid = equations.settings.rigid_body.iter();
        let gains = rigid.map(|t| (t.input * ny + t.output, ng));
        let columns: Vec<(usize, usize)> = coefficients.chain(gains).collect();
        let mut matrix = DMatrix::zeros(columns.len(), columns.len());
        for i in 0..columns.len() {
            for j in i..columns.len() {
                matrix[(i, j)] = self.entry(position, columns[i], columns[j]);
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        matrix
    }
}

/// Lines whose functions stay in registers and the fastest cache while all pairs of them are multiplied.
const NEAR: usize = 16;

/// The products of all pairs of functions on a block: real parts for `m >= n` in the order of [`pair`], imaginary parts for
/// `m > n` in that of [`pair_off`], and room for a register more on each line.
struct Pairs<'a> {
    functions: &'a [&'a Planes],
    range: Range<usize>,
    real: &'a mut Mat<f64>,
    imaginary: &'a mut Mat<f64>,
}

impl WithSimd for Pairs<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let count = self.functions.len();
        // The functions of a line beside each other, and zeros.
        let width = count + WIDEST;
        let (mut fr, mut fi) = (vec![0.0; width * NEAR], vec![0.0; width * NEAR]);
        for from in self.range.clone().step_by(NEAR) {
            let lines = from..(from + NEAR).min(self.range.end);
            for (n, f) in self.functions.iter().enumerate() {
                let (re, im) = f.part(lines.clone());
                for (i, (re, im)) in re.iter().zip(im).enumerate() {
                    (fr[i * width + n], fi[i * width + n]) = (*re, *im);
                }
            }
            let (mut at, mut at_apart) = (0, 0);
            for n in 0..count {
                // Whole registers: what they write too much is overwritten by the next.
                let (whole, rest) = (registers::<S>(count - n), registers::<S>(count - n - 1));
                for i in 0..lines.len() {
                    let (fr, fi) = (&fr[i * width + n..], &fi[i * width + n..]);
                    let (xr, xi) = (simd.splat_f64s(fr[0]), simd.splat_f64s(fi[0]));
                    let column = from - self.range.start + i;
                    let out = &mut self.real.col_as_slice_mut(column)[at..][..whole];
                    let (yr, yi) = (S::as_simd_f64s(&fr[..whole]).0, S::as_simd_f64s(&fi[..whole]).0);
                    for ((o, yr), yi) in S::as_mut_simd_f64s(out).0.iter_mut().zip(yr).zip(yi) {
                        *o = simd.mul_add_f64s(xr, *yr, simd.mul_f64s(xi, *yi));
                    }
                    let out = &mut self.imaginary.col_as_slice_mut(column)[at_apart..][..rest];
                    let (yr, yi) = (S::as_simd_f64s(&fr[1..=rest]).0, S::as_simd_f64s(&fi[1..=rest]).0);
                    for ((o, yr), yi) in S::as_mut_simd_f64s(out).0.iter_mut().zip(yr).zip(yi) {
                        *o = simd.sub_f64s(simd.mul_f64s(xr, *yi), simd.mul_f64s(xi, *yr));
                    }
                }
                at += count - n;
                at_apart += count - n - 1;
            }
        }
    }
}

/// So many numbers in whole registers.
fn registers<S: Simd>(count: usize) -> usize {
    count.next_multiple_of(S::F64_LANES)
}
