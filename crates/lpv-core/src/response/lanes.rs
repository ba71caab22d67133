//! Complex numbers of several points at a time, and systems in Schur form at them.

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

/// The first of so many lanes that is not zero. What is not finite less itself is not zero.
#[inline(always)]
pub(super) fn first_nonzero<S: Simd>(simd: S, lanes: S::f64s, count: usize) -> Option<usize> {
    values_of::<S>(simd, lanes)[..count]
        .iter()
        .position(|l| *l != 0.0)
}

/// `a b`.
#[inline(always)]
pub(super) fn times<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let re = simd.sub_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    let im = simd.add_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0]));
    [re, im]
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

/// `a + b`.
#[inline(always)]
pub(super) fn plus<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    [simd.add_f64s(a[0], b[0]), simd.add_f64s(a[1], b[1])]
}

/// `z - t`, t real.
#[inline(always)]
fn minus_real<S: Simd>(simd: S, z: Lanes<S>, t: f64) -> Lanes<S> {
    [simd.sub_f64s(z[0], simd.splat_f64s(t)), z[1]]
}

/// Solves `(z I - T) X = rhs` in place, part by part from the last state on. `t` is `T^T`: its columns are the rows of T.
// Loops, since what takes a function is not always compiled for these registers.
#[inline(always)]
pub(super) fn solve<S: Simd>(
    simd: S,
    t: &DMatrix<f64>,
    z: Lanes<S>,
    rhs: &mut [Lanes<S>],
    parts: &[Range<usize>],
    nu: usize,
) {
    let (n, t) = (t.nrows(), t.as_slice());
    for part in parts {
        let mut end = part.end;
        while end > part.start {
            // A block of two has an entry below the diagonal of T.
            let is_pair = end - part.start > 1 && t[(end - 1) * n + end - 2] != 0.0;
            let from = end - if is_pair { 2 } else { 1 };
            let (rows, known) = rhs[from * nu..part.end * nu].split_at_mut((end - from) * nu);
            let first = &t[from * n..][..part.end];
            if is_pair {
                let second = &t[(from + 1) * n..][..part.end];
                add_rows::<S, 2>(simd, [&first[end..], &second[end..]], known, rows, nu);
                let gaps = [
                    minus_real(simd, z, first[from]),
                    minus_real(simd, z, second[from + 1]),
                ];
                solve_pair(simd, gaps, [first[from + 1], second[from]], rows, nu);
            } else {
                add_rows::<S, 1>(simd, [&first[end..]], known, rows, nu);
                let one = [simd.splat_f64s(1.0), simd.splat_f64s(0.0)];
                let inverse = over(simd, one, minus_real(simd, z, first[from]));
                for x in rows {
                    *x = times(simd, *x, inverse);
                }
            }
            end = from;
        }
    }
}

/// Adds to R rows those of T times what is known.
#[inline(always)]
fn add_rows<S: Simd, const R: usize>(
    simd: S,
    t: [&[f64]; R],
    known: &[Lanes<S>],
    rows: &mut [Lanes<S>],
    nu: usize,
) {
    let mut at = 0;
    while at < nu {
        at += match nu - at {
            1 => add_columns::<S, R, 1>(simd, t, known, rows, at, nu),
            _ => add_columns::<S, R, 2>(simd, t, known, rows, at, nu),
        };
    }
}

/// The same for N right sides from `at` on; N.
#[inline(always)]
fn add_columns<S: Simd, const R: usize, const N: usize>(
    simd: S,
    t: [&[f64]; R],
    known: &[Lanes<S>],
    rows: &mut [Lanes<S>],
    at: usize,
    nu: usize,
) -> usize {
    let mut sums = [[rows[0]; N]; R];
    for r in 0..R {
        for j in 0..N {
            sums[r][j] = rows[r * nu + at + j];
        }
    }
    for (m, known) in known.chunks_exact(nu).enumerate() {
        for r in 0..R {
            for j in 0..N {
                sums[r][j] = plus(simd, sums[r][j], times_real(simd, known[at + j], t[r][m]));
            }
        }
    }
    for r in 0..R {
        for j in 0..N {
            rows[r * nu + at + j] = sums[r][j];
        }
    }
    N
}

/// Two rows `[[g_0, -b_0], [-b_1, g_1]] x = rows`, all right sides, by the inverse.
#[inline(always)]
fn solve_pair<S: Simd>(simd: S, gaps: [Lanes<S>; 2], beside: [f64; 2], rows: &mut [Lanes<S>], nu: usize) {
    let determinant = minus_real(simd, times(simd, gaps[0], gaps[1]), beside[0] * beside[1]);
    let inverse = over(simd, [simd.splat_f64s(1.0), simd.splat_f64s(0.0)], determinant);
    let [g0, g1] = [times(simd, gaps[0], inverse), times(simd, gaps[1], inverse)];
    let [b0, b1] = [
        times_real(simd, inverse, beside[0]),
        times_real(simd, inverse, beside[1]),
    ];
    let (first, second) = rows.split_at_mut(nu);
    for (x, y) in first.iter_mut().zip(second) {
        let (a, b) = (*x, *y);
        *x = plus(simd, times(simd, g1, a), times(simd, b0, b));
        *y = plus(simd, times(simd, g0, b), times(simd, b1, a));
    }
}
