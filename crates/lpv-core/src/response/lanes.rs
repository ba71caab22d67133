//! Complex numbers of several points at a time, and Hessenberg systems of them.

use nalgebra::DMatrix;
use num_complex::Complex;
use pulp::Simd;
use std::ops::Range;

/// Most lanes that a register of doubles has.
pub(super) const WIDEST: usize = 8;

/// One complex number of each point: real and imaginary parts.
pub(super) type Lanes<S> = [<S as Simd>::f64s; 2];

/// The last point fills the lanes that are left.
#[inline(always)]
pub(super) fn lanes_of<S: Simd>(simd: S, points: &[Complex<f64>]) -> Lanes<S> {
    let at = |lane: usize| points[lane.min(points.len() - 1)];
    let load = |values: [f64; WIDEST]| match S::as_simd_f64s(&values).0.first() {
        Some(lanes) => *lanes,
        None => simd.splat_f64s(values[0]),
    };
    [
        load(std::array::from_fn(|lane| at(lane).re)),
        load(std::array::from_fn(|lane| at(lane).im)),
    ]
}

/// Values by lane; zero where there is none.
#[inline(always)]
pub(super) fn values_of<S: Simd>(_simd: S, lanes: S::f64s) -> [f64; WIDEST] {
    let mut values = [0.0; WIDEST];
    if let Some(first) = S::as_mut_simd_f64s(&mut values).0.first_mut() {
        *first = lanes;
    }
    values
}

/// `a b`.
#[inline(always)]
pub(super) fn times<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let re = simd.sub_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    let im = simd.add_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0]));
    [re, im]
}

/// `sum - a b`.
#[inline(always)]
pub(super) fn less<S: Simd>(simd: S, sum: Lanes<S>, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let product = times(simd, a, b);
    [
        simd.sub_f64s(sum[0], product[0]),
        simd.sub_f64s(sum[1], product[1]),
    ]
}

/// `a / b`.
#[inline(always)]
pub(super) fn over<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let square = simd.add_f64s(simd.mul_f64s(b[0], b[0]), simd.mul_f64s(b[1], b[1]));
    let re = simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    let im = simd.sub_f64s(simd.mul_f64s(a[1], b[0]), simd.mul_f64s(a[0], b[1]));
    [simd.div_f64s(re, square), simd.div_f64s(im, square)]
}

/// The sum of the absolute values of the parts.
#[inline(always)]
pub(super) fn size<S: Simd>(simd: S, a: Lanes<S>) -> S::f64s {
    simd.add_f64s(simd.abs_f64s(a[0]), simd.abs_f64s(a[1]))
}

/// `a b`, b real.
#[inline(always)]
pub(super) fn times_real<S: Simd>(simd: S, a: Lanes<S>, b: f64) -> Lanes<S> {
    let b = simd.splat_f64s(b);
    [simd.mul_f64s(a[0], b), simd.mul_f64s(a[1], b)]
}

/// Writes `z I - h` into `out`, row after row, h upper Hessenberg within its parts; what lies outside of them is not touched.
#[inline(always)]
pub(super) fn shifted<S: Simd>(
    simd: S,
    h: &DMatrix<f64>,
    z: Lanes<S>,
    parts: &[Range<usize>],
    out: &mut [Lanes<S>],
) {
    let n = h.nrows();
    for part in parts {
        for i in part.clone() {
            for j in i.saturating_sub(1).max(part.start)..part.end {
                out[i * n + j] = [simd.splat_f64s(-h[(i, j)]), simd.splat_f64s(0.0)];
            }
            let [re, _] = out[i * n + i];
            out[i * n + i] = [simd.add_f64s(re, z[0]), z[1]];
        }
    }
}

/// Solves the Hessenberg systems of all parts in place.
#[inline(always)]
pub(super) fn solve<S: Simd>(
    simd: S,
    work: &mut [Lanes<S>],
    rhs: &mut [Lanes<S>],
    parts: &[Range<usize>],
    n: usize,
    nu: usize,
) {
    for part in parts {
        eliminate(simd, work, rhs, part, n, nu);
        substitute(simd, work, rhs, part, n, nu);
    }
}

#[inline(always)]
fn eliminate<S: Simd>(
    simd: S,
    work: &mut [Lanes<S>],
    rhs: &mut [Lanes<S>],
    part: &Range<usize>,
    n: usize,
    nu: usize,
) {
    for k in part.start..part.end - 1 {
        let (top, bottom) = work.split_at_mut((k + 1) * n);
        let (row, next) = (&mut top[k * n + k..k * n + part.end], &mut bottom[k..part.end]);
        let (above, below) = rhs.split_at_mut((k + 1) * nu);
        let (above, below) = (&mut above[k * nu..], &mut below[..nu]);
        let larger = simd.greater_than_f64s(size(simd, next[0]), size(simd, row[0]));
        if simd.first_true_m64s(larger) < S::F64_LANES {
            let rows = row.iter_mut().zip(next.iter_mut());
            for (one, other) in rows.chain(above.iter_mut().zip(below.iter_mut())) {
                for (one, other) in one.iter_mut().zip(other.iter_mut()) {
                    let (a, b) = (*one, *other);
                    *one = simd.select_f64s(larger, b, a);
                    *other = simd.select_f64s(larger, a, b);
                }
            }
        }
        let factor = over(simd, next[0], row[0]);
        for (next, row) in next[1..].iter_mut().zip(&row[1..]) {
            *next = less(simd, *next, factor, *row);
        }
        for (below, above) in below.iter_mut().zip(above.iter()) {
            *below = less(simd, *below, factor, *above);
        }
    }
}

#[inline(always)]
fn substitute<S: Simd>(
    simd: S,
    work: &[Lanes<S>],
    rhs: &mut [Lanes<S>],
    part: &Range<usize>,
    n: usize,
    nu: usize,
) {
    let one = [simd.splat_f64s(1.0), simd.splat_f64s(0.0)];
    for k in part.clone().rev() {
        let inverse = over(simd, one, work[k * n + k]);
        let (known, solved) = rhs.split_at_mut((k + 1) * nu);
        let row = &work[k * n + k + 1..k * n + part.end];
        for j in 0..nu {
            let mut sum = known[k * nu + j];
            for (factor, solved) in row.iter().zip(solved.chunks_exact(nu)) {
                sum = less(simd, sum, *factor, solved[j]);
            }
            known[k * nu + j] = times(simd, sum, inverse);
        }
    }
}
