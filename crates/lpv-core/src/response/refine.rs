//! States to the last digits: near a pole, and where they are small among others.

use super::Matrices;
use super::lanes::{Lanes, plus, size, solve, times_real};
use nalgebra::DMatrix;
use pulp::Simd;
use std::ops::Range;

/// Most corrections.
const MOST: usize = 6;

/// Where every correction is so small a part of its state it is the last.
const LAST: f64 = 1e-15;

/// Sums with what rounding took from them \[ogita2005\].
#[derive(Clone, Copy)]
struct Twofold<S: Simd>([S::f64s; 2]);

impl<S: Simd> Twofold<S> {
    #[inline(always)]
    fn plus(self, simd: S, a: S::f64s, b: S::f64s) -> Self {
        let Self([sum, low]) = self;
        let product = simd.mul_f64s(a, b);
        let lost = simd.mul_add_f64s(a, b, simd.neg_f64s(product));
        let next = simd.add_f64s(sum, product);
        let part = simd.sub_f64s(next, sum);
        let other = simd.sub_f64s(sum, simd.sub_f64s(next, part));
        let rounded = simd.add_f64s(other, simd.sub_f64s(product, part));
        Self([next, simd.add_f64s(low, simd.add_f64s(lost, rounded))])
    }

    #[inline(always)]
    fn value(self, simd: S) -> S::f64s {
        simd.add_f64s(self.0[0], self.0[1])
    }
}

/// From a solution in the coordinates of T, in `rhs`, to the `states` of the model, until a correction by the residual
/// `B - (z I - A) X` is lost.
#[inline(always)]
pub(super) fn refine<S: Simd>(
    simd: S,
    (model, t, q): (&Matrices, &DMatrix<f64>, &DMatrix<f64>),
    z: Lanes<S>,
    parts: &[Range<usize>],
    [rhs, left, states]: [&mut [Lanes<S>]; 3],
) {
    let nu = model.b.ncols();
    let zero = simd.splat_f64s(0.0);
    states.fill([zero; 2]);
    let mut last = simd.splat_f64s(f64::INFINITY);
    for _ in 0..MOST {
        let mut change = zero;
        for part in parts {
            for i in part.clone() {
                for j in 0..nu {
                    left[i * nu + j] = row_times(simd, |k| q[(i, k)], part, rhs, j, nu);
                    change = simd.max_f64s(change, size(simd, left[i * nu + j]));
                }
            }
        }
        // Where it does not get smaller the correction is none.
        let is_smaller = simd.less_than_f64s(change, last);
        last = simd.select_f64s(is_smaller, simd.mul_f64s(change, simd.splat_f64s(0.5)), zero);
        let mut more = zero;
        for (x, turned) in states.iter_mut().zip(left.iter()) {
            let next = plus(simd, *x, *turned);
            for w in 0..2 {
                x[w] = simd.select_f64s(is_smaller, next[w], x[w]);
            }
            let seen = simd.mul_f64s(size(simd, *x), simd.splat_f64s(LAST));
            more = simd.max_f64s(more, simd.sub_f64s(size(simd, *turned), seen));
        }
        let is_more = simd.greater_than_f64s(simd.select_f64s(is_smaller, more, zero), zero);
        if simd.first_true_m64s(is_more) >= S::F64_LANES {
            break;
        }
        residual(simd, model, z, parts, states, left);
        for part in parts {
            for i in part.clone() {
                for j in 0..nu {
                    rhs[i * nu + j] = row_times(simd, |k| q[(k, i)], part, left, j, nu);
                }
            }
        }
        solve::<S>(simd, t, z, rhs, parts, nu);
    }
}

/// `sum_k row(k) x_kj` over a part.
#[inline(always)]
fn row_times<S: Simd>(
    simd: S,
    row: impl Fn(usize) -> f64,
    part: &Range<usize>,
    x: &[Lanes<S>],
    j: usize,
    nu: usize,
) -> Lanes<S> {
    let zero = [simd.splat_f64s(0.0); 2];
    part.clone().fold(zero, |sum, k| {
        plus(simd, sum, times_real(simd, x[k * nu + j], row(k)))
    })
}

/// `B - (z I - A) X`, rounded once.
#[inline(always)]
fn residual<S: Simd>(
    simd: S,
    model: &Matrices,
    z: Lanes<S>,
    parts: &[Range<usize>],
    states: &[Lanes<S>],
    left: &mut [Lanes<S>],
) {
    let nu = model.b.ncols();
    let zero = simd.splat_f64s(0.0);
    let [re, im] = z;
    let (minus_re, minus_im) = (simd.neg_f64s(re), simd.neg_f64s(im));
    for part in parts {
        for i in part.clone() {
            for j in 0..nu {
                let [x, y] = states[i * nu + j];
                let mut real = Twofold::<S>([simd.splat_f64s(model.b[(i, j)]), zero]);
                real = real.plus(simd, minus_re, x).plus(simd, im, y);
                let mut imaginary = Twofold::<S>([zero; 2]);
                imaginary = imaginary.plus(simd, minus_re, y).plus(simd, minus_im, x);
                for k in part.clone() {
                    let (a, [x, y]) = (simd.splat_f64s(model.a[(i, k)]), states[k * nu + j]);
                    real = real.plus(simd, a, x);
                    imaginary = imaginary.plus(simd, a, y);
                }
                left[i * nu + j] = [real.value(simd), imaginary.value(simd)];
            }
        }
    }
}
