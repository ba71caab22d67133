//! The weights of the channels of a line.

use super::{BLOCK, pair, pair_off};
use crate::planes::Planes;
use crate::whiten::{Lower, Whitening};
use pulp::Simd;

/// `B` on the lines of a block, for channels `s <= t`: real parts, imaginary parts off the diagonal.
pub(super) struct Weights {
    outputs: usize,
    channels: usize,
    pub(super) re: Vec<Vec<f64>>,
    pub(super) im: Vec<Vec<f64>>,
    /// `2 C^-1` and `S^-1`, upper triangles row after row.
    c: Vec<Planes>,
    s: Vec<Planes>,
}

/// The weighted residuals of a block, by channel.
pub(super) struct Weighted {
    pub(super) re: Vec<Vec<f64>>,
    pub(super) im: Vec<Vec<f64>>,
}

impl Weighted {
    pub(super) fn new(channels: usize) -> Self {
        Self {
            re: vec![vec![0.0; BLOCK]; channels],
            im: vec![vec![0.0; BLOCK]; channels],
        }
    }

    /// Real part of the product with the residuals themselves, summed over lines and channels.
    #[inline(always)]
    pub(super) fn dot<S: Simd>(&self, simd: S, residual: &[Planes]) -> f64 {
        let mut sum = simd.splat_f64s(0.0);
        for ((r, re), im) in residual.iter().zip(&self.re).zip(&self.im) {
            for (x, y) in [(&r.re, re), (&r.im, im)] {
                for (x, y) in S::as_simd_f64s(x).0.iter().zip(S::as_simd_f64s(y).0) {
                    sum = simd.mul_add_f64s(*x, *y, sum);
                }
            }
        }
        simd.reduce_sum_f64s(sum)
    }
}

impl Weights {
    pub(super) fn new(outputs: usize, inputs: usize) -> Self {
        let channels = outputs * inputs;
        let pairs = channels * (channels + 1) / 2;
        Self {
            outputs,
            channels,
            re: vec![vec![0.0; BLOCK]; pairs],
            im: vec![vec![0.0; BLOCK]; pairs - channels],
            c: vec![Planes::zeros(BLOCK); outputs * (outputs + 1) / 2],
            s: vec![Planes::zeros(BLOCK); inputs * (inputs + 1) / 2],
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, whitening: &Whitening, lines: usize) {
        square(&whitening.left, &mut self.c);
        square(&whitening.right_adjoint, &mut self.s);
        let (c, s) = (&self.c, &self.s);
        let ny = self.outputs;
        for i in 0..self.channels {
            for j in i..self.channels {
                let ((b1, a1), (b2, a2)) = ((i / ny, i % ny), (j / ny, j % ny));
                let s = &s[pair(self.channels / ny, b1, b2)];
                // Of a Hermitian matrix the upper triangle is there.
                let (c, conjugate) = match a1 <= a2 {
                    true => (&c[pair(ny, a1, a2)], 1.0),
                    false => (&c[pair(ny, a2, a1)], -1.0),
                };
                let n = lines;
                let ((sr, si), (cr, ci)) = (s.part(0..n), c.part(0..n));
                let (re, rest) = self.re[pair(self.channels, i, j)].split_at_mut(n);
                for k in 0..n {
                    re[k] = sr[k] * cr[k] + si[k] * conjugate * ci[k];
                }
                rest.fill(0.0);
                if i < j {
                    let (im, rest) = self.im[pair_off(self.channels, i, j)].split_at_mut(n);
                    for k in 0..n {
                        im[k] = sr[k] * conjugate * ci[k] - si[k] * cr[k];
                    }
                    rest.fill(0.0);
                }
            }
        }
    }

    /// `out = B residual`.
    #[inline(always)]
    pub(super) fn apply(&self, residual: &[Planes], out: &mut Weighted) {
        for (i, (or, oi)) in out.re.iter_mut().zip(&mut out.im).enumerate() {
            let (or, oi) = (&mut or[..BLOCK], &mut oi[..BLOCK]);
            or.fill(0.0);
            oi.fill(0.0);
            for (j, e) in residual.iter().enumerate() {
                let (low, high) = (i.min(j), i.max(j));
                let re = &self.re[pair(self.channels, low, high)][..BLOCK];
                let (er, ei) = (&e.re[..BLOCK], &e.im[..BLOCK]);
                if i == j {
                    for k in 0..BLOCK {
                        or[k] += re[k] * er[k];
                        oi[k] += re[k] * ei[k];
                    }
                    continue;
                }
                let im = &self.im[pair_off(self.channels, low, high)][..BLOCK];
                let sign = if i < j { 1.0 } else { -1.0 };
                for k in 0..BLOCK {
                    let im = sign * im[k];
                    or[k] += re[k] * er[k] - im * ei[k];
                    oi[k] += re[k] * ei[k] + im * er[k];
                }
            }
        }
    }
}

/// The upper triangle of `L^H L`, row after row.
#[inline(always)]
fn square(lower: &Lower, out: &mut [Planes]) {
    let n = lower.size();
    for i in 0..n {
        for j in i..n {
            let sum = &mut out[pair(n, i, j)];
            sum.fill(0.0);
            for r in j..n {
                // conj(L[r, i]) L[r, j].
                sum.add_product(lower.entry(r, j), lower.entry(r, i), 1.0, -1.0);
            }
        }
    }
}
