//! The transforms over points, in place, all lanes alike.

use super::register::{add, eight, four, mul, sixteen};
use super::{Factor, Plan, Point};
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
        let Some((first, others)) = plan.factors.split_first() else {
            return true;
        };
        let [a, b] = match first.count {
            4 => first_of_4(simd, &first.rotations, &a, &b, points),
            8 => first_of_8(simd, &first.rotations, &a, &b, points),
            _ => first_of_16(simd, &first.rotations, &a, &b, points),
        };
        for part in points.chunks_exact_mut(plan.points / first.count) {
            rest(simd, others, part);
        }
        simd.reduce_sum_f64s(simd.add_f64s(a, b)).is_finite()
    }
}

macro_rules! factor {
    ($first:ident, $name:ident, $butterfly:path, $count:literal: $($i:literal)*) => {
        /// The first factor, from the signals; their sums by lane.
        #[inline(always)]
        fn $first(
            simd: V4,
            rotations: &[[f64; 2]],
            a: &Centred<'_>,
            b: &Centred<'_>,
            points: &mut [Point],
        ) -> Point {
            let width = points.len() / $count;
            let mut sum = [simd.splat_f64s(0.0); 2];
            for (c, w) in rotations.as_chunks::<{ $count - 1 }>().0.iter().enumerate() {
                let x = [
                    [a.at(simd, c), b.at(simd, c)],
                    $([a.at(simd, c + $i * width), b.at(simd, c + $i * width)]),*
                ];
                let y = $butterfly(simd, x);
                sum = add(simd, sum, y[0]);
                points[c] = y[0];
                $(points[c + $i * width] = mul(simd, y[$i], splat(simd, w[$i - 1]));)*
            }
            sum
        }

        /// A factor in place.
        #[inline(always)]
        fn $name(simd: V4, rotations: &[[f64; 2]], points: &mut [Point]) {
            let width = points.len() / $count;
            for (c, w) in rotations.as_chunks::<{ $count - 1 }>().0.iter().enumerate() {
                let y = $butterfly(simd, [points[c], $(points[c + $i * width]),*]);
                points[c] = y[0];
                $(points[c + $i * width] = mul(simd, y[$i], splat(simd, w[$i - 1]));)*
            }
        }
    };
}

factor!(first_of_4, of_4, four, 4: 1 2 3);
factor!(first_of_8, of_8, eight, 8: 1 2 3 4 5 6 7);
factor!(first_of_16, of_16, sixteen, 16: 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);

#[inline(always)]
fn splat(simd: V4, [re, im]: [f64; 2]) -> Point {
    [simd.splat_f64s(re), simd.splat_f64s(im)]
}

/// The other factors: each part is finished while the cache holds it.
fn rest(simd: V4, factors: &[Factor], points: &mut [Point]) {
    Simd::vectorize(
        simd,
        Rest {
            simd,
            factors,
            points,
        },
    );
}

struct Rest<'a> {
    simd: V4,
    factors: &'a [Factor],
    points: &'a mut [Point],
}

impl WithSimd for Rest<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            simd,
            factors,
            points,
        } = self;
        let Some((Factor { count, rotations }, others)) = factors.split_first() else {
            return last(simd, points);
        };
        match count {
            4 => of_4(simd, rotations, points),
            8 => of_8(simd, rotations, points),
            _ => of_16(simd, rotations, points),
        }
        for part in points.chunks_exact_mut(points.len() / count) {
            rest(simd, others, part);
        }
    }
}

/// The last factor, whose butterflies are side by side and need no rotation.
#[inline(always)]
fn last(simd: V4, points: &mut [Point]) {
    for p in points.as_chunks_mut::<8>().0 {
        *p = eight(simd, *p);
    }
}
