//! The sum over lanes, and the two signals apart.

use super::register::{eight, mul, transposed};
use super::{LANES, Plan, Point};
use crate::moments::{CHUNK, Observed, Part};
use pulp::{Simd, f64x8, x86::V4};

/// Spectra of transforms that wait, block by block.
///
/// Block `(g, d)` holds the lines `k = 8 g + i + (M / 8) d + M j`, `i` and `j` from 0 to 7, `j` being slower; where `k` is above
/// `N / 2`, the line `N - k`. Groups `g` up to the middle one have all lines, some of them twice.
pub(crate) struct Blocks<'a> {
    plan: &'a Plan,
    /// Points of all pairs of the first observation, then of the next one.
    points: &'a [Point],
    /// By what a channel is to be multiplied, observation after observation.
    scales: &'a [f64],
    channels: usize,
}

impl<'a> Blocks<'a> {
    /// Spectra of observations of so many channels, two by two; by what each is to be multiplied.
    pub(crate) fn new(plan: &'a Plan, waiting: &'a [f64], channels: usize, scales: &'a [f64]) -> Self {
        Self {
            plan,
            points: V4::as_simd_f64s(waiting).0.as_chunks::<2>().0,
            scales,
            channels,
        }
    }

    /// Blocks of a period.
    pub(crate) fn blocks(length: usize) -> usize {
        8 * (length / (LANES * 128) + 1)
    }

    /// Where line `k` is, from 1 on and below `N / 2`.
    #[inline]
    pub(crate) fn place(length: usize, k: usize) -> usize {
        // Powers of two all: an eighth of M, which the values of one `d` and `j` take.
        let eighth = length.trailing_zeros() - 6;
        let within = |k: usize| k & ((1 << eighth) - 1);
        let k = if within(k) <= 1 << (eighth - 1) {
            k
        } else {
            length - k
        };
        let (d, j) = ((k >> eighth) & 7, k >> (eighth + 3));
        let (g, i) = (within(k) >> 3, within(k) & 7);
        (((g << 3 | d) << 3 | j) << 3) | i
    }
}

/// Eight values of `A_l`, and what turns them for the sum over lanes.
struct Values {
    places: [usize; LANES],
    rotations: [Point; LANES],
}

impl Plan {
    /// Those of `k = 8 g + i + (M / 8) d`, `i` from 0 on.
    #[inline(always)]
    fn values(&self, g: usize, d: usize) -> Values {
        let coarse = self.coarse[g + d * self.places.len()];
        let mut values = Values {
            places: [self.places[g] + d; LANES],
            rotations: [coarse; LANES],
        };
        for i in 1..LANES {
            values.places[i] += self.offsets[i];
            values.rotations[i] = mul(self.simd, coarse, self.fine[i]);
        }
        values
    }

    /// Those of `M - k`, in the order of `k`.
    #[inline(always)]
    fn mirrored(&self, g: usize, d: usize) -> Values {
        let (groups, d) = (self.places.len(), 7 - d);
        let near = groups - 1 - g;
        let coarse = self.coarse[near + d * groups];
        // The first is a group further on, which from the last group is the first one of the next d, and A_l(M) is A_l(0).
        let first = if g == 0 {
            (d + 1) % 8
        } else {
            self.places[near + 1] + d
        };
        let mut values = Values {
            places: [first; LANES],
            rotations: [self.coarse[near + 1 + d * groups]; LANES],
        };
        for i in 1..LANES {
            values.places[i] = self.places[near] + self.offsets[LANES - i] + d;
            values.rotations[i] = mul(self.simd, coarse, self.fine[LANES - i]);
        }
        values
    }

    /// Sums over lanes: `Z_(k + M j)` by `j`, `k` by lane.
    #[inline(always)]
    fn sums(&self, points: &[Point], values: &Values) -> [Point; LANES] {
        let simd = self.simd;
        let [mut re, mut im] = [[simd.splat_f64s(0.0); LANES]; 2];
        for i in 0..LANES {
            [re[i], im[i]] = mul(simd, points[values.places[i]], values.rotations[i]);
        }
        let (re, im) = (transposed(simd, re), transposed(simd, im));
        let mut by_lane = [[re[0], im[0]]; LANES];
        for l in 1..LANES {
            by_lane[l] = [re[l], im[l]];
        }
        eight(simd, by_lane)
    }
}

impl Observed for Blocks<'_> {
    fn count(&self) -> usize {
        self.scales.len() / self.channels
    }

    #[inline(always)]
    fn chunk<S: Simd, const COUNT: usize>(
        &mut self,
        _simd: S,
        at: usize,
        from: usize,
        out: &mut [[Part; 2]],
    ) {
        let (plan, simd) = (self.plan, self.plan.simd);
        let (g, d) = (at / 8, at % 8);
        let (own, mirrored) = (plan.values(g, d), plan.mirrored(g, d));
        let pairs = self.channels.div_ceil(2);
        let transforms = self.points.chunks_exact(plan.points);
        let transforms = transforms.skip(from * pairs).take(COUNT * pairs);
        for (at, points) in transforms.enumerate() {
            let (m, first) = (at / pairs, 2 * (at % pairs));
            let second = (first + 1).min(self.channels - 1);
            let scales = &self.scales[(from + m) * self.channels..];
            let (of_a, of_b) = (simd.splat_f64s(scales[first]), simd.splat_f64s(scales[second]));
            let z = plan.sums(points, &own);
            let w = plan.sums(points, &mirrored);
            for j in 0..LANES {
                let ([zr, zi], [wr, wi]) = (z[j], w[7 - j]);
                // Above N / 2, the conjugates.
                let ([p, q], [s, t]) = if j < 4 {
                    ([zi, wi], [wr, zr])
                } else {
                    ([wi, zi], [zr, wr])
                };
                let a = [simd.add_f64s(zr, wr), simd.sub_f64s(p, q)];
                let b = [simd.add_f64s(zi, wi), simd.sub_f64s(s, t)];
                // Without a second signal, the first one takes its place.
                store(
                    &mut out[second * COUNT + m],
                    j,
                    [simd.mul_f64s(b[0], of_b), simd.mul_f64s(b[1], of_b)],
                );
                store(
                    &mut out[first * COUNT + m],
                    j,
                    [simd.mul_f64s(a[0], of_a), simd.mul_f64s(a[1], of_a)],
                );
            }
        }
    }
}

#[inline(always)]
fn store(out: &mut [Part; 2], j: usize, value: Point) {
    let [re, im] = out;
    let parts: [&mut [f64x8]; 2] = [V4::as_mut_simd_f64s(re).0, V4::as_mut_simd_f64s(im).0];
    let [re, im] = parts;
    [re[j], im[j]] = value;
}

const _: () = assert!(CHUNK == LANES * LANES);
