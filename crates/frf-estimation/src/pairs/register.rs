//! Butterflies in registers.

use super::{LANES, Point};
use pulp::{Simd, cast, f64x8, x86::V4};
use std::arch::x86_64::__m512d;
use std::f64::consts::FRAC_1_SQRT_2;

#[inline(always)]
pub(super) fn mul(simd: V4, a: Point, b: Point) -> Point {
    [
        simd.negate_mul_add_e_f64s(a[1], b[1], simd.mul_f64s(a[0], b[0])),
        simd.mul_add_e_f64s(a[0], b[1], simd.mul_f64s(a[1], b[0])),
    ]
}

#[inline(always)]
pub(super) fn add(simd: V4, a: Point, b: Point) -> Point {
    [simd.add_f64s(a[0], b[0]), simd.add_f64s(a[1], b[1])]
}

#[inline(always)]
pub(super) fn sub(simd: V4, a: Point, b: Point) -> Point {
    [simd.sub_f64s(a[0], b[0]), simd.sub_f64s(a[1], b[1])]
}

/// `a - j b` and `a + j b`.
#[inline(always)]
fn turned(simd: V4, a: Point, b: Point) -> [Point; 2] {
    [
        [simd.add_f64s(a[0], b[1]), simd.sub_f64s(a[1], b[0])],
        [simd.sub_f64s(a[0], b[1]), simd.add_f64s(a[1], b[0])],
    ]
}

/// Transform of four values, lane by lane.
#[inline(always)]
pub(super) fn four(simd: V4, x: [Point; 4]) -> [Point; 4] {
    let (a, b) = (add(simd, x[0], x[2]), sub(simd, x[0], x[2]));
    let (c, d) = (add(simd, x[1], x[3]), sub(simd, x[1], x[3]));
    let [e, f] = turned(simd, b, d);
    [add(simd, a, c), e, sub(simd, a, c), f]
}

/// `a + b / sqrt 2`.
#[inline(always)]
fn plus(simd: V4, a: f64x8, b: f64x8) -> f64x8 {
    simd.mul_add_e_f64s(simd.splat_f64s(FRAC_1_SQRT_2), b, a)
}

/// `a - b / sqrt 2`.
#[inline(always)]
fn minus(simd: V4, a: f64x8, b: f64x8) -> f64x8 {
    simd.negate_mul_add_e_f64s(simd.splat_f64s(FRAC_1_SQRT_2), b, a)
}

/// Transform of eight values, lane by lane.
#[inline(always)]
pub(super) fn eight(simd: V4, x: [Point; 8]) -> [Point; 8] {
    let even = four(simd, [x[0], x[2], x[4], x[6]]);
    let odd = four(simd, [x[1], x[3], x[5], x[7]]);
    // W_8 = (1 - j) / sqrt 2, W_8^3 = (-1 - j) / sqrt 2.
    let [[ar, ai], [br, bi]] = [odd[1], odd[3]];
    let [p, q] = [simd.add_f64s(ar, ai), simd.sub_f64s(ai, ar)];
    let [s, t] = [simd.sub_f64s(bi, br), simd.add_f64s(br, bi)];
    let [two, six] = turned(simd, even[2], odd[2]);
    [
        add(simd, even[0], odd[0]),
        [plus(simd, even[1][0], p), plus(simd, even[1][1], q)],
        two,
        [plus(simd, even[3][0], s), minus(simd, even[3][1], t)],
        sub(simd, even[0], odd[0]),
        [minus(simd, even[1][0], p), minus(simd, even[1][1], q)],
        six,
        [minus(simd, even[3][0], s), plus(simd, even[3][1], t)],
    ]
}

/// Transform of sixteen values, lane by lane.
#[inline(always)]
pub(super) fn sixteen(simd: V4, x: [Point; 16]) -> [Point; 16] {
    let even = eight(simd, [x[0], x[2], x[4], x[6], x[8], x[10], x[12], x[14]]);
    let odd = eight(simd, [x[1], x[3], x[5], x[7], x[9], x[11], x[13], x[15]]);
    let [a, b] = [add(simd, even[0], odd[0]), sub(simd, even[0], odd[0])];
    let [e, m] = turned(simd, even[4], odd[4]);
    let mut y = [a; 16];
    (y[8], y[4], y[12]) = (b, e, m);
    // The others turned by W_16^k.
    for k in [1, 2, 3, 5, 6, 7] {
        let w = SIXTEENTHS[k];
        let odd = mul(simd, odd[k], [simd.splat_f64s(w[0]), simd.splat_f64s(w[1])]);
        y[k] = add(simd, even[k], odd);
        y[k + 8] = sub(simd, even[k], odd);
    }
    y
}

/// Cosine of an eighth and of three eighths of pi.
const COS_1: f64 = 0.923_879_532_511_286_7;
const COS_3: f64 = 0.382_683_432_365_089_8;

/// `W_16^k`.
const SIXTEENTHS: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [COS_1, -COS_3],
    [FRAC_1_SQRT_2, -FRAC_1_SQRT_2],
    [COS_3, -COS_1],
    [0.0, -1.0],
    [-COS_3, -COS_1],
    [-FRAC_1_SQRT_2, -FRAC_1_SQRT_2],
    [-COS_1, -COS_3],
];

/// Lane `i` of register `l` becomes lane `l` of register `i`.
#[inline(always)]
pub(super) fn transposed(simd: V4, x: [f64x8; LANES]) -> [f64x8; LANES] {
    let avx = simd.avx512f;
    let [x0, x1, x2, x3]: [__m512d; 4] = [cast(x[0]), cast(x[1]), cast(x[2]), cast(x[3])];
    let [x4, x5, x6, x7]: [__m512d; 4] = [cast(x[4]), cast(x[5]), cast(x[6]), cast(x[7])];
    // Of rows two by two: even columns, odd columns.
    let [a0, b0] = [avx._mm512_unpacklo_pd(x0, x1), avx._mm512_unpackhi_pd(x0, x1)];
    let [a2, b2] = [avx._mm512_unpacklo_pd(x2, x3), avx._mm512_unpackhi_pd(x2, x3)];
    let [a4, b4] = [avx._mm512_unpacklo_pd(x4, x5), avx._mm512_unpackhi_pd(x4, x5)];
    let [a6, b6] = [avx._mm512_unpacklo_pd(x6, x7), avx._mm512_unpackhi_pd(x6, x7)];
    let [c04, d04] = [low(simd, a0, a2), low(simd, a4, a6)];
    let [c15, d15] = [low(simd, b0, b2), low(simd, b4, b6)];
    let [c26, d26] = [high(simd, a0, a2), high(simd, a4, a6)];
    let [c37, d37] = [high(simd, b0, b2), high(simd, b4, b6)];
    [
        cast(low(simd, c04, d04)),
        cast(low(simd, c15, d15)),
        cast(low(simd, c26, d26)),
        cast(low(simd, c37, d37)),
        cast(high(simd, c04, d04)),
        cast(high(simd, c15, d15)),
        cast(high(simd, c26, d26)),
        cast(high(simd, c37, d37)),
    ]
}

/// Quarters 0 and 2 of both.
#[inline(always)]
fn low(simd: V4, a: __m512d, b: __m512d) -> __m512d {
    simd.avx512f._mm512_shuffle_f64x2::<0b10_00_10_00>(a, b)
}

/// Quarters 1 and 3 of both.
#[inline(always)]
fn high(simd: V4, a: __m512d, b: __m512d) -> __m512d {
    simd.avx512f._mm512_shuffle_f64x2::<0b11_01_11_01>(a, b)
}
