//! The weights of the channels of a line.

use super::{BLOCK, pair, pair_off, pairs};
use faer::MatRef;
use lpv_numerics::planes::Planes;
use lpv_numerics::whiten::{Lower, Whitening};
use pulp::Simd;

/// `B` on the lines of a block at each position of a group, for channels `s <= t`: real parts, imaginary parts off the diagonal,
/// [`BLOCK`] numbers each.
pub(super) struct Weights {
    outputs: usize,
    channels: usize,
    re: Vec<f64>,
    im: Vec<f64>,
    /// `2 C^-1` and `S^-1`, upper triangles row after row.
    c: Vec<Planes>,
    s: Vec<Planes>,
}

/// Those at one position.
pub(super) struct WeightsAt<'a> {
    outputs: usize,
    channels: usize,
    re: &'a mut [f64],
    im: &'a mut [f64],
    c: &'a mut [Planes],
    s: &'a mut [Planes],
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
    pub(super) fn new(outputs: usize, inputs: usize, positions: usize) -> Self {
        let channels = outputs * inputs;
        let (all, apart) = pairs(channels);
        Self {
            outputs,
            channels,
            re: vec![0.0; positions * all * BLOCK],
            im: vec![0.0; positions * apart * BLOCK],
            c: vec![Planes::zeros(BLOCK); pairs(outputs).0],
            s: vec![Planes::zeros(BLOCK); pairs(inputs).0],
        }
    }

    pub(super) fn at(&mut self, position: usize) -> WeightsAt<'_> {
        let (all, apart) = pairs(self.channels);
        let part = |pairs: usize| position * pairs * BLOCK..(position + 1) * pairs * BLOCK;
        WeightsAt {
            outputs: self.outputs,
            channels: self.channels,
            re: &mut self.re[part(all)],
            im: &mut self.im[part(apart)],
            c: &mut self.c,
            s: &mut self.s,
        }
    }

    /// Real parts, a column a pair of channels.
    pub(super) fn re(&self, lines: usize) -> MatRef<'_, f64> {
        columns(&self.re, lines)
    }

    /// Imaginary parts.
    pub(super) fn im(&self, lines: usize) -> MatRef<'_, f64> {
        columns(&self.im, lines)
    }
}

/// Planes of a block as the columns of a matrix.
fn columns(planes: &[f64], lines: usize) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice_with_stride(planes, lines, planes.len() / BLOCK, BLOCK)
}

fn plane(planes: &[f64], i: usize) -> &[f64] {
    &planes[i * BLOCK..(i + 1) * BLOCK]
}

fn plane_mut(planes: &mut [f64], i: usize) -> &mut [f64] {
    &mut planes[i * BLOCK..(i + 1) * BLOCK]
}

impl WeightsAt<'_> {
    #[inline(always)]
    pub(super) fn set(&mut self, whitening: &Whitening, lines: usize) {
        turned_over(&whitening.left, self.c);
        turned_over(&whitening.right_adjoint, self.s);
        let (c, s) = (&*self.c, &*self.s);
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
                let (re, rest) = plane_mut(self.re, pair(self.channels, i, j)).split_at_mut(n);
                for k in 0..n {
                    re[k] = sr[k] * cr[k] + si[k] * conjugate * ci[k];
                }
                rest.fill(0.0);
                if i < j {
                    let (im, rest) = plane_mut(self.im, pair_off(self.channels, i, j)).split_at_mut(n);
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
            let re = plane(self.re, pair(self.channels, i, i));
            let (er, ei) = (&residual[i].re[..BLOCK], &residual[i].im[..BLOCK]);
            for k in 0..BLOCK {
                or[k] = re[k] * er[k];
                oi[k] = re[k] * ei[k];
            }
            for (j, e) in residual.iter().enumerate().filter(|(j, _)| *j != i) {
                let (low, high) = (i.min(j), i.max(j));
                let re = plane(self.re, pair(self.channels, low, high));
                let (er, ei) = (&e.re[..BLOCK], &e.im[..BLOCK]);
                let im = plane(self.im, pair_off(self.channels, low, high));
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

/// The upper triangle of `M^H D^-1 M` with `M = L^-1`, row after row.
#[inline(always)]
fn turned_over(lower: &Lower, out: &mut [Planes]) {
    let n = lower.size();
    for i in 0..n {
        for j in i..n {
            let sum = &mut out[pair(n, i, j)];
            // 1 / D[j].
            let d = &lower.entry(j, j).re;
            if i == j {
                sum.re.copy_from_slice(d);
                sum.im.fill(0.0);
            } else {
                let m = lower.entry(j, i);
                let (re, im) = (&mut sum.re[..BLOCK], &mut sum.im[..BLOCK]);
                let (d, mr, mi) = (&d[..BLOCK], &m.re[..BLOCK], &m.im[..BLOCK]);
                for k in 0..BLOCK {
                    re[k] = d[k] * mr[k];
                    im[k] = -d[k] * mi[k];
                }
            }
            for r in j + 1..n {
                // conj(M[r, i]) M[r, j] / D[r].
                let (x, y, d) = (lower.entry(r, j), lower.entry(r, i), &lower.entry(r, r).re);
                let (re, im, d) = (&mut sum.re[..BLOCK], &mut sum.im[..BLOCK], &d[..BLOCK]);
                let ((xr, xi), (yr, yi)) = (x.part(0..BLOCK), y.part(0..BLOCK));
                for k in 0..BLOCK {
                    re[k] += d[k] * (xr[k] * yr[k] + xi[k] * yi[k]);
                    im[k] += d[k] * (xi[k] * yr[k] - xr[k] * yi[k]);
                }
            }
        }
    }
}
