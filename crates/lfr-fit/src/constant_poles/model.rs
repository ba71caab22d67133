//! The model in modal coordinates.

use super::sides::{Realised, Side};
use super::{C64, Place};
use crate::{Candidate, Channel, FitError, sampled};
use lpv_core::{Continuous, CoreError, Discrete, LfrBlocks, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// What a fit may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Free {
    /// B and C.
    Ports,
    /// The poles too.
    Poles,
    /// And the functions of p.
    Functions,
}

/// Poles of all positions. The states are `[q; v; modes]`, r positions and r speeds of the rigid body first, `q' = v`; the coordinates
/// that B and C know are r of the rigid body (v of B, q of C), then two of each mode with `A = [sigma, -omega; omega, sigma]`.
#[derive(Debug, Clone)]
pub(super) struct Modal {
    rank: usize,
    /// Above the real axis, per second.
    poles: Vec<C64>,
}

impl Modal {
    /// With the sampled poles of the modes.
    pub(super) fn new(rank: usize, sampled: &[C64], clock: Discrete) -> Self {
        Self {
            rank,
            poles: sampled.iter().map(|z| z.ln() / clock.sample_time()).collect(),
        }
    }

    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// Coordinates that B and C know.
    pub(super) fn size(&self) -> usize {
        self.rank + 2 * self.poles.len()
    }

    pub(super) fn states(&self) -> usize {
        self.rank + self.size()
    }

    /// Coordinates that a change may mix without a change of A: those of the rigid body, and the two of a mode.
    pub(super) fn blocks(&self) -> impl Iterator<Item = (usize, usize)> {
        let rigid = (self.rank > 0).then_some((0, self.rank));
        let modes = (0..self.poles.len()).map(|k| (self.rank + 2 * k, 2));
        rigid.into_iter().chain(modes)
    }

    /// The generators of changes of one block: all of the rigid body, size and phase of a mode.
    pub(super) fn generators(&self, (first, size): (usize, usize)) -> Vec<DMatrix<f64>> {
        if first < self.rank {
            let one = |i: usize, j: usize| DMatrix::from_fn(size, size, |a, b| f64::from((a, b) == (i, j)));
            return (0..size)
                .flat_map(|i| (0..size).map(move |j| one(i, j)))
                .collect();
        }
        vec![
            DMatrix::identity(2, 2),
            DMatrix::from_row_slice(2, 2, &[0.0, -1.0, 1.0, 0.0]),
        ]
    }

    fn a(&self) -> DMatrix<f64> {
        let (n, r) = (self.states(), self.rank);
        let mut a = DMatrix::zeros(n, n);
        a.view_mut((0, r), (r, r)).fill_diagonal(1.0);
        for (k, s) in self.poles.iter().enumerate() {
            let at = 2 * (r + k);
            a[(at, at)] = s.re;
            a[(at + 1, at + 1)] = s.re;
            a[(at, at + 1)] = -s.im;
            a[(at + 1, at)] = s.im;
        }
        a
    }

    /// The state that coordinate i of B moves.
    fn moved(&self, i: usize) -> usize {
        self.rank + i
    }

    /// The state that coordinate i of C sees.
    fn seen(&self, i: usize) -> usize {
        if i < self.rank { i } else { self.rank + i }
    }

    /// The frozen model with these B and C.
    pub(super) fn frozen(&self, place: &Place) -> Result<StateSpace<Continuous>, FitError> {
        let (n, m) = (self.states(), self.size());
        let (ny, nu) = (place.c.nrows(), place.b.ncols());
        let mut b = DMatrix::zeros(n, nu);
        let mut c = DMatrix::zeros(ny, n);
        for i in 0..m {
            b.row_mut(self.moved(i)).copy_from(&place.b.row(i));
            c.column_mut(self.seen(i)).copy_from(&place.c.column(i));
        }
        Ok(StateSpace::new(
            self.a(),
            b,
            c,
            DMatrix::zeros(ny, nu),
            Continuous,
        )?)
    }

    /// The same, sampled.
    pub(super) fn held(&self, place: &Place, clock: Discrete) -> Result<StateSpace<Discrete>, FitError> {
        Ok(sampled(&self.frozen(place)?, clock)?.ok_or(CoreError::Singular {
            operation: "the hold of a model with constant poles",
        })?)
    }

    /// B and C of a frozen model.
    pub(super) fn place(&self, matrix: &DMatrix<f64>, outputs: usize, inputs: usize) -> Place {
        let (n, m) = (self.states(), self.size());
        Place {
            b: DMatrix::from_fn(m, inputs, |i, j| matrix[(self.moved(i), n + j)]),
            c: DMatrix::from_fn(outputs, m, |i, j| matrix[(n + i, self.seen(j))]),
        }
    }

    /// The frozen model as a candidate with B and C free, A held.
    pub(super) fn local(
        &self,
        place: &Place,
        range: &SchedulingRange,
    ) -> Result<Candidate<Continuous>, FitError> {
        let none = |constant: &DMatrix<f64>| Side::constant(constant.clone());
        let sides = Realised {
            b: none(&place.b),
            c: none(&place.c),
        };
        self.with(&sides, range, Free::Ports)
    }

    /// The LFR with these sides. What is free with the functions of p: all but the structure; without: the poles, and what the functions
    /// are multiplied by.
    pub(super) fn candidate(
        &self,
        sides: &Realised,
        range: &SchedulingRange,
        functions: bool,
    ) -> Result<Candidate<Continuous>, FitError> {
        let free = if functions { Free::Functions } else { Free::Poles };
        self.with(sides, range, free)
    }

    fn with(
        &self,
        sides: &Realised,
        range: &SchedulingRange,
        free_part: Free,
    ) -> Result<Candidate<Continuous>, FitError> {
        let (n, m, r) = (self.states(), self.size(), self.rank);
        let Realised { b, c } = sides;
        let (ny, nu) = (c.constant.nrows(), b.constant.ncols());
        let (of_c, of_b) = (c.inner.nrows(), b.inner.nrows());
        let nc = of_c + of_b;
        let mut all = LfrBlocks {
            a: self.a(),
            b1: DMatrix::zeros(n, nc),
            b2: DMatrix::zeros(n, nu),
            c1: DMatrix::zeros(nc, n),
            c2: DMatrix::zeros(ny, n),
            d11: DMatrix::zeros(nc, nc),
            d12: DMatrix::zeros(nc, nu),
            d21: DMatrix::zeros(ny, nc),
            d22: DMatrix::zeros(ny, nu),
        };
        let mut free = DMatrix::from_element(n + ny + nc, n + nu + nc, false);
        for i in 0..m {
            let (moved, seen) = (self.moved(i), self.seen(i));
            all.b2.row_mut(moved).copy_from(&b.constant.row(i));
            all.b1
                .view_mut((moved, of_c), (1, of_b))
                .copy_from(&b.left.row(i));
            free.view_mut((moved, n), (1, nu)).fill(true);
            let functions = free_part == Free::Functions;
            free.view_mut((moved, n + nu + of_c), (1, of_b)).fill(functions);
            all.c2.column_mut(seen).copy_from(&c.constant.column(i));
            all.c1
                .view_mut((0, seen), (of_c, 1))
                .copy_from(&c.right.column(i));
            free.view_mut((n, seen), (ny, 1)).fill(true);
            free.view_mut((n + ny, seen), (of_c, 1)).fill(functions);
        }
        all.d21.view_mut((0, 0), (ny, of_c)).copy_from(&c.left);
        free.view_mut((n, n + nu), (ny, of_c)).fill(true);
        all.d12.view_mut((of_c, 0), (of_b, nu)).copy_from(&b.right);
        free.view_mut((n + ny + of_c, n), (of_b, nu)).fill(true);
        for (first, side) in [(0, c), (of_c, b)] {
            let size = side.inner.shape();
            all.d11.view_mut((first, first), size).copy_from(&side.inner);
            free.view_mut((n + ny + first, n + nu + first), size)
                .fill(free_part == Free::Functions);
        }
        if free_part != Free::Ports {
            for k in 0..self.poles.len() {
                free.view_mut((2 * (r + k), 2 * (r + k)), (2, 2)).fill(true);
            }
        }
        Candidate::new(
            &all,
            free,
            vec![Channel::Parameter(0); nc],
            range.clone(),
            Continuous,
        )
    }
}
