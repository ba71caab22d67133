//! Sums over lines of the products of two functions with the weights of two channels.

use super::sums::{ROWS, Sums};
use super::weights::Weights;
use super::{BLOCK, Equations, pair, pair_off};
use crate::planes::Planes;
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// The sums of one position.
pub(super) struct Products {
    functions: usize,
    channels: usize,
    /// Real parts: rows `n <= m`, columns `s <= t`.
    re: Sums,
    /// Imaginary parts: rows `n < m`, columns `s < t`.
    im: Sums,
}

impl Products {
    pub(super) fn new(equations: &Equations<'_>) -> Self {
        let functions = equations.all_functions().len();
        let channels = equations.channels();
        Self {
            functions,
            channels,
            re: Sums::new(functions * (functions + 1) / 2, channels * (channels + 1) / 2),
            im: Sums::new(
                functions * functions.saturating_sub(1) / 2,
                channels * (channels - 1) / 2,
            ),
        }
    }

    /// `Re sum B_st conj(phi_n) phi_m`.
    fn entry(&self, (s, n): (usize, usize), (t, m): (usize, usize)) -> f64 {
        // The matrix is symmetric, and so is the product for a change of both pairs.
        let (s, n, t, m) = if s <= t { (s, n, t, m) } else { (t, m, s, n) };
        let (low, high) = (n.min(m), n.max(m));
        let re = self
            .re
            .get(pair(self.functions, low, high), pair(self.channels, s, t));
        if s == t || n == m {
            return re;
        }
        let row = pair_off(self.functions, low, high);
        let im = self.im.get(row, pair_off(self.channels, s, t));
        if n < m { re - im } else { re + im }
    }

    pub(super) fn matrix(&self, equations: &Equations<'_>) -> DMatrix<f64> {
        let ng = equations.regressors.functions().len();
        let ny = equations.estimate.frf().outputs();
        let coefficients = (0..self.channels).flat_map(|s| (0..ng).map(move |n| (s, n)));
        let rigid = equations.settings.rigid_body().iter();
        let gains = rigid.map(|t| (t.input * ny + t.output, ng));
        let columns: Vec<(usize, usize)> = coefficients.chain(gains).collect();
        let mut matrix = DMatrix::zeros(columns.len(), columns.len());
        for i in 0..columns.len() {
            for j in i..columns.len() {
                matrix[(i, j)] = self.entry(columns[i], columns[j]);
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        matrix
    }
}

/// Adds the lines of a block to the sums of all positions of a group.
pub(super) fn add(all: &mut [Products], weights: &[&Weights], functions: &[&Planes], range: Range<usize>) {
    pulp::Arch::new().dispatch(Block {
        all,
        weights,
        functions,
        range,
    });
}

/// The lines of a block, in the registers of one kind of machine.
struct Block<'a> {
    all: &'a mut [Products],
    weights: &'a [&'a Weights],
    functions: &'a [&'a Planes],
    range: Range<usize>,
}

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        self.pairs::<S, 0>(simd);
        if self.weights.iter().any(|w| !w.im.is_empty()) {
            self.pairs::<S, 1>(simd);
        }
    }
}

impl Block<'_> {
    /// Real parts of all pairs `m >= n` for 0; imaginary parts of those `m > n` for 1. As many at a time as there are rows;
    /// their order is that of [`pair`] and of [`pair_off`].
    #[inline(always)]
    fn pairs<S: Simd, const APART: usize>(&mut self, simd: S) {
        let (count, lines) = (self.functions.len(), self.range.len());
        let mut planes = [[0.0; BLOCK]; ROWS];
        let (mut at, mut filled) = (0, 0);
        for n in 0..count {
            for m in n + APART..count {
                let x = self.functions[n].part(self.range.clone());
                let y = self.functions[m].part(self.range.clone());
                match APART {
                    0 => real::<S>(simd, x, y, &mut planes[filled]),
                    _ => imaginary::<S>(simd, x, y, &mut planes[filled]),
                }
                filled += 1;
                if filled == ROWS || n + APART + 1 == count {
                    let rows = parts(&planes, lines);
                    for (products, weights) in self.all.iter_mut().zip(self.weights) {
                        match APART {
                            0 => products.re.add::<S>(simd, at, rows, &weights.re),
                            _ => products.im.add::<S>(simd, at, rows, &weights.im),
                        }
                    }
                    (at, filled) = (at + ROWS, 0);
                }
            }
        }
    }
}

#[inline(always)]
fn parts(planes: &[[f64; BLOCK]; ROWS], lines: usize) -> [&[f64]; ROWS] {
    let mut rows: [&[f64]; ROWS] = [&[]; ROWS];
    for (row, plane) in rows.iter_mut().zip(planes) {
        *row = &plane[..lines];
    }
    rows
}

/// `Re conj(x) y`.
#[inline(always)]
fn real<S: Simd>(simd: S, x: (&[f64], &[f64]), y: (&[f64], &[f64]), out: &mut [f64]) {
    let (xr, xi) = (S::as_simd_f64s(x.0).0, S::as_simd_f64s(x.1).0);
    let (yr, yi) = (S::as_simd_f64s(y.0).0, S::as_simd_f64s(y.1).0);
    let (out, _) = S::as_mut_simd_f64s(out);
    for ((((o, xr), xi), yr), yi) in out.iter_mut().zip(xr).zip(xi).zip(yr).zip(yi) {
        *o = simd.mul_add_f64s(*xr, *yr, simd.mul_f64s(*xi, *yi));
    }
}

/// `Im conj(x) y`.
#[inline(always)]
fn imaginary<S: Simd>(simd: S, x: (&[f64], &[f64]), y: (&[f64], &[f64]), out: &mut [f64]) {
    let (xr, xi) = (S::as_simd_f64s(x.0).0, S::as_simd_f64s(x.1).0);
    let (yr, yi) = (S::as_simd_f64s(y.0).0, S::as_simd_f64s(y.1).0);
    let (out, _) = S::as_mut_simd_f64s(out);
    for ((((o, xr), xi), yr), yi) in out.iter_mut().zip(xr).zip(xi).zip(yr).zip(yi) {
        *o = simd.sub_f64s(simd.mul_f64s(*xr, *yi), simd.mul_f64s(*xi, *yr));
    }
}
