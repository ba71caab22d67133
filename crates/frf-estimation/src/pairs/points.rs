//! The transforms over points, in place, all lanes alike.

use super::register::{add, eight, four, mul, sub};
use super::{Plan, Point};
use pulp::{Simd, WithSimd, f64x8, x86::V4};

impl Plan {
    /// Transforms two signals less their offsets, as far as lanes do not mix, into a buffer of their [size](Self::size).
    /// Whether the sum of all samples is finite, which it is not if a sample is not.
    pub(crate) fn transform(&self, signals: [&[f64]; 2], offsets: [f64; 2], out: &mut [f64]) -> bool {
        let plan = self;
        Simd::vectorize(
            self.simd,
            Transform {
                plan,
                signals,
                offsets,
                out,
            },
        )
    }
}

struct Transform<'a> {
    plan: &'a Plan,
    signals: [&'a [f64]; 2],
    offsets: [f64; 2],
    out: &'a mut [f64],
}

/// One signal in registers, and what is taken from it.
struct Centred<'a> {
    values: &'a [f64x8],
    offset: f64x8,
}

impl Centred<'_> {
    #[inline(always)]
    fn at(&self, simd: V4, m: usize) -> f64x8 {
        simd.sub_f64s(self.values[m], self.offset)
    }
}

impl WithSimd for Transform<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> bool {
        let Self {
            plan,
            signals: [a, b],
            offsets,
            out,
        } = self;
        let simd = plan.simd;
        let centred = |signal, offset| Centred {
            values: V4::as_simd_f64s(signal).0,
            offset: simd.splat_f64s(offset),
        };
        let (a, b) = (centred(a, offsets[0]), centred(b, offsets[1]));
        let points = V4::as_mut_simd_f64s(out).0.as_chunks_mut::<2>().0;
        let [a, b] = match (plan.first, plan.rotations.first()) {
            (_, None) => return true,
            (2, Some(rotations)) => first_of_2(simd, rotations, &a, &b, points),
            (4, Some(rotations)) => first_of_4(simd, rotations, &a, &b, points),
            (_, Some(rotations)) => first_of_8(simd, rotations, &a, &b, points),
        };
        for part in points.chunks_exact_mut(plan.points / plan.first) {
            rest(simd, &plan.rotations[1..], part);
        }
        simd.reduce_sum_f64s(simd.add_f64s(a, b)).is_finite()
    }
}

macro_rules! first {
    ($name:ident, $butterfly:path, $count:literal: $($i:literal)*) => {
        /// The first factor, from the signals; their sums by lane.
        #[inline(always)]
        fn $name(
            simd: V4,
            rotations: &[[[f64; 2]; 7]],
            a: &Centred<'_>,
            b: &Centred<'_>,
            points: &mut [Point],
        ) -> Point {
            let width = points.len() / $count;
            let mut sum = [simd.splat_f64s(0.0); 2];
            for (c, w) in rotations[..width].iter().enumerate() {
                let y = $butterfly(
                    simd,
                    [
                        [a.at(simd, c), b.at(simd, c)],
                        $([a.at(simd, c + $i * width), b.at(simd, c + $i * width)]),*
                    ],
                );
                sum = add(simd, sum, y[0]);
                points[c] = y[0];
                $(points[c + $i * width] = mul(simd, y[$i], splat(simd, w[$i - 1]));)*
            }
            sum
        }
    };
}

first!(first_of_2, two, 2: 1);
first!(first_of_4, four, 4: 1 2 3);
first!(first_of_8, eight, 8: 1 2 3 4 5 6 7);

#[inline(always)]
fn splat(simd: V4, [re, im]: [f64; 2]) -> Point {
    [simd.splat_f64s(re), simd.splat_f64s(im)]
}

#[inline(always)]
fn two(simd: V4, x: [Point; 2]) -> [Point; 2] {
    [add(simd, x[0], x[1]), sub(simd, x[0], x[1])]
}

/// The other factors: each part is finished while the cache holds it.
fn rest(simd: V4, rotations: &[Vec<[[f64; 2]; 7]>], points: &mut [Point]) {
    Simd::vectorize(
        simd,
        Rest {
            simd,
            rotations,
            points,
        },
    );
}

struct Rest<'a> {
    simd: V4,
    rotations: &'a [Vec<[[f64; 2]; 7]>],
    points: &'a mut [Point],
}

impl WithSimd for Rest<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            simd,
            rotations,
            points,
        } = self;
        let Some((own, others)) = rotations.split_first() else {
            return last(simd, points);
        };
        butterflies(simd, own, points);
        let parts = points.chunks_exact_mut(points.len() / 8);
        if let [next] = others {
            for part in parts {
                butterflies(simd, next, part);
                last(simd, part);
            }
        } else {
            parts.for_each(|part| rest(simd, others, part));
        }
    }
}

#[inline(always)]
fn butterflies(simd: V4, rotations: &[[[f64; 2]; 7]], points: &mut [Point]) {
    let width = points.len() / 8;
    let (p0, p1) = points.split_at_mut(width);
    let (p1, p2) = p1.split_at_mut(width);
    let (p2, p3) = p2.split_at_mut(width);
    let (p3, p4) = p3.split_at_mut(width);
    let (p4, p5) = p4.split_at_mut(width);
    let (p5, p6) = p5.split_at_mut(width);
    let (p6, p7) = p6.split_at_mut(width);
    let p7 = &mut p7[..width];
    for (c, w) in rotations[..width].iter().enumerate() {
        let y = eight(simd, [p0[c], p1[c], p2[c], p3[c], p4[c], p5[c], p6[c], p7[c]]);
        p0[c] = y[0];
        p1[c] = mul(simd, y[1], splat(simd, w[0]));
        p2[c] = mul(simd, y[2], splat(simd, w[1]));
        p3[c] = mul(simd, y[3], splat(simd, w[2]));
        p4[c] = mul(simd, y[4], splat(simd, w[3]));
        p5[c] = mul(simd, y[5], splat(simd, w[4]));
        p6[c] = mul(simd, y[6], splat(simd, w[5]));
        p7[c] = mul(simd, y[7], splat(simd, w[6]));
    }
}

/// The last factor, whose butterflies are side by side and need no rotation.
#[inline(always)]
fn last(simd: V4, points: &mut [Point]) {
    for p in points.as_chunks_mut::<8>().0 {
        *p = eight(simd, *p);
    }
}
