//! The transforms over points, in place, all lanes alike.

use super::register::{eight, four, mul, sixteen};
use super::{Factor, Plan, Point};
use pulp::{Simd, WithSimd, f64x8, x86::V4};

/// A signal of a pair: what is taken from it, and by what the rest is multiplied.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Centred<'a> {
    pub(crate) signal: &'a [f64],
    pub(crate) offset: f64,
    /// A power of two, so that nothing is rounded.
    pub(crate) scale: f64,
}

impl Plan {
    /// Transforms two signals as far as lanes do not mix, into a buffer of their [size](Self::size). Gives the mean squares of
    /// both, which are not finite if a sample is not.
    pub(crate) fn transform(&self, pair: [Centred<'_>; 2], out: &mut [f64]) -> [f64; 2] {
        Simd::vectorize(
            self.simd,
            Transform {
                plan: self,
                pair,
                out,
            },
        )
    }
}

struct Transform<'a> {
    plan: &'a Plan,
    pair: [Centred<'a>; 2],
    out: &'a mut [f64],
}

/// A signal in registers.
struct Lanes<'a> {
    values: &'a [f64x8],
    offset: f64x8,
    scale: f64x8,
}

impl<'a> Lanes<'a> {
    #[inline(always)]
    fn new(simd: V4, from: Centred<'a>) -> Self {
        Self {
            values: V4::as_simd_f64s(from.signal).0,
            offset: simd.splat_f64s(-from.offset * from.scale),
            scale: simd.splat_f64s(from.scale),
        }
    }

    #[inline(always)]
    fn at(&self, simd: V4, m: usize) -> f64x8 {
        simd.mul_add_e_f64s(self.values[m], self.scale, self.offset)
    }
}

impl WithSimd for Transform<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> [f64; 2] {
        let Self { plan, pair, out } = self;
        let simd = plan.simd;
        let (a, b) = (Lanes::new(simd, pair[0]), Lanes::new(simd, pair[1]));
        let points = V4::as_mut_simd_f64s(out).0.as_chunks_mut::<2>().0;
        let (first, others) = (&plan.factors[0], &plan.factors[1..]);
        let [a, b] = match first.count {
            4 => first_of_4(simd, &first.rotations, &a, &b, points),
            8 => first_of_8(simd, &first.rotations, &a, &b, points),
            _ => first_of_16(simd, &first.rotations, &a, &b, points),
        };
        for part in points.chunks_exact_mut(plan.points / first.count) {
            rest(simd, others, part);
        }
        let count = (8 * plan.points) as f64;
        [simd.reduce_sum_f64s(a) / count, simd.reduce_sum_f64s(b) / count]
    }
}

macro_rules! factor {
    ($first:ident, $name:ident, $butterfly:path, $count:literal: $($i:literal)*) => {
        /// The first factor, from the signals; the sums of their squares by lane.
        #[inline(always)]
        fn $first(
            simd: V4,
            rotations: &[[f64; 2]],
            a: &Lanes<'_>,
            b: &Lanes<'_>,
            points: &mut [Point],
        ) -> Point {
            let width = points.len() / $count;
            let mut sum = [simd.splat_f64s(0.0); 2];
            for (c, w) in rotations.as_chunks::<{ $count - 1 }>().0.iter().enumerate() {
                let x = [
                    [a.at(simd, c), b.at(simd, c)],
                    $([a.at(simd, c + $i * width), b.at(simd, c + $i * width)]),*
                ];
                for [a, b] in x {
                    sum = [simd.mul_add_e_f64s(a, a, sum[0]), simd.mul_add_e_f64s(b, b, sum[1])];
                }
                let y = $butterfly(simd, x);
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
