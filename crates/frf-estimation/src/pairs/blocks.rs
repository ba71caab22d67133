//! The sum over lanes, and the two signals apart.

use super::register::{eight, mirrored, mul, transposed};
use super::{LANES, Plan, Point};
use crate::moments::{CHUNK, Observed, Part};
use pulp::{Simd, f64x8, x86::V4};

/// Lane 0 of the 8 values of a block.
type Edges = [[f64; 2]; LANES];

/// Spectra of transforms that wait, block by block.
///
/// Block `(g, d)` holds the lines `k = 8 g + i + (M / 8) d + M j`, `i` and `j` from 0 to 7, `j` being slower; where `k` is above
/// `N / 2`, the line `N - k`. Its mirror is in the block of the group `M / 64 - 1 - g`, but for its lane 0, which is a group
/// further on. Groups up to the middle one have all lines, some of them twice.
pub(crate) struct Blocks<'a> {
    plan: &'a Plan,
    /// Points of all pairs of the first observation, then of the next one.
    points: &'a [Point],
    channels: usize,
    count: usize,
    /// Of each pair and observation: lane 0 of the mirrors in the blocks `d` to come.
    edges: Vec<[Edges; 8]>,
}

impl<'a> Blocks<'a> {
    /// Spectra of `count` observations, of each so many channels, two by two.
    pub(crate) fn new(plan: &'a Plan, waiting: &'a [f64], channels: usize, count: usize) -> Self {
        let points = V4::as_simd_f64s(waiting).0.as_chunks::<2>().0;
        Self {
            plan,
            points,
            channels,
            count,
            edges: vec![[[[0.0; 2]; LANES]; 8]; count * channels.div_ceil(2)],
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

impl Plan {
    /// Rotations of block `(g, d)`.
    #[inline(always)]
    fn of_block(&self, g: usize, d: usize) -> [Point; LANES] {
        let simd = self.simd;
        let coarse = self.coarse[g + d * self.places.len()];
        let mut all = [coarse; LANES];
        for (all, fine) in all.iter_mut().zip(&self.fine).skip(1) {
            *all = mul(simd, coarse, *fine);
        }
        all
    }

    /// Values `k + M j` of block `(g, d)`, `k` by lane.
    #[inline(always)]
    fn values(&self, points: &[Point], g: usize, d: usize, rotations: &[Point; LANES]) -> [Point; LANES] {
        let simd = self.simd;
        let from = &points[self.places[g] + d..];
        let [mut re, mut im] = [[simd.splat_f64s(0.0); LANES]; 2];
        for i in 0..LANES {
            [re[i], im[i]] = mul(simd, from[self.offsets[i]], rotations[i]);
        }
        let (re, im) = (transposed(simd, re), transposed(simd, im));
        let mut values = [[re[0], im[0]]; LANES];
        for i in 1..LANES {
            values[i] = [re[i], im[i]];
        }
        eight(simd, values)
    }
}

impl Observed for Blocks<'_> {
    fn count(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn chunk<S: Simd, const COUNT: usize>(
        &mut self,
        _simd: S,
        at: usize,
        from: usize,
        out: &mut [[Part; 2]],
    ) {
        let Self {
            plan,
            points,
            channels,
            edges,
            ..
        } = self;
        let (simd, groups) = (plan.simd, plan.places.len());
        let (g, d) = (at / 8, at % 8);
        let (own, other) = (plan.of_block(g, d), plan.of_block(groups - 1 - g, 7 - d));
        let pairs = channels.div_ceil(2);
        let all = points.chunks_exact(plan.points).zip(edges);
        let all = all.skip(from * pairs).take(COUNT * pairs);
        for (at, (points, edges)) in all.enumerate() {
            if (g, d) == (0, 0) {
                first_edges(plan, points, edges);
            }
            let (m, first) = (at / pairs, 2 * (at % pairs));
            let z = plan.values(points, g, d, &own);
            let w = plan.values(points, groups - 1 - g, 7 - d, &other);
            let second = (first + 1).min(*channels - 1);
            for j in 0..LANES {
                let ([zr, zi], [wr, wi]) = (z[j], w[7 - j]);
                let [edge_re, edge_im] = edges[d][j];
                let [mr, mi] = [mirrored(simd, wr, edge_re), mirrored(simd, wi, edge_im)];
                // Above N / 2, the conjugates.
                let ([zr_, mr_], [zi_, mi_]) = if j < 4 {
                    ([zr, mr], [zi, mi])
                } else {
                    ([mr, zr], [mi, zi])
                };
                let b = [simd.add_f64s(zi, mi), simd.sub_f64s(mr_, zr_)];
                let a = [simd.add_f64s(zr, mr), simd.sub_f64s(zi_, mi_)];
                // Without a second signal, the first one takes its place.
                store(&mut out[second * COUNT + m], j, b);
                store(&mut out[first * COUNT + m], j, a);
            }
            for j in 0..LANES {
                let [re, im] = w[7 - j];
                edges[d][j] = [re.0, im.0];
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

/// Lane 0 of the first group, which is its own mirror.
#[inline(always)]
fn first_edges(plan: &Plan, points: &[Point], edges: &mut [Edges; 8]) {
    for d in 0..8 {
        let rotations = plan.of_block(0, d);
        let z = plan.values(points, 0, d, &rotations);
        for (j, [re, im]) in z.into_iter().enumerate() {
            let (d, j) = if d == 0 { (0, (8 - j) % 8) } else { (8 - d, 7 - j) };
            edges[d][j] = [re.0, im.0];
        }
    }
}

const _: () = assert!(CHUNK == LANES * LANES);
