//! What the mask implies before any number is computed: states that nothing moves, and entries of S that something
//! moves.

use crate::candidate::Candidate;
use crate::sampling::Sampling;
use crate::shape::Shape;
use lpv_core::Clock;
use nalgebra::DMatrix;

/// The pattern of a candidate.
pub(crate) struct Structure {
    /// States that belong to no free entry and are joined to nothing else, increasing: their response is computed once.
    pub(crate) constant: Vec<usize>,
    /// All other states, increasing.
    pub(crate) kept: Vec<usize>,
}

impl Structure {
    pub(crate) fn new<K: Clock>(candidate: &Candidate<K>) -> Self {
        let (m, free) = (candidate.matrix(), candidate.free());
        let Shape {
            states: n,
            outputs,
            inputs,
        } = candidate.shape();
        let joined = |i: usize, j: usize| m[(i, j)] != 0.0 || free[(i, j)];
        let alone = |i: usize| {
            let fixed = (0..m.ncols()).all(|j| !free[(i, j)]) && (0..m.nrows()).all(|j| !free[(j, i)]);
            let no_w = (n + inputs..m.ncols()).all(|j| !joined(i, j));
            let no_z = (n + outputs..m.nrows()).all(|j| !joined(j, i));
            fixed && no_w && no_z
        };
        let mut constant: Vec<bool> = (0..n).map(alone).collect();
        // A state that is joined to one that moves takes part.
        while let Some(i) =
            (0..n).find(|&i| constant[i] && (0..n).any(|j| !constant[j] && (joined(i, j) || joined(j, i))))
        {
            constant[i] = false;
        }
        let (constant, kept) = (0..n).partition(|&i| constant[i]);
        Self { constant, kept }
    }
}

/// Entries of the sampled S, and diagonal blocks of A, that free entries of M move.
pub(crate) struct Reach {
    /// Row and column of each entry of S that moves, down the columns.
    pub(crate) active: Vec<(usize, usize)>,
    /// States whose poles move: those of the connected parts of A in which an entry moves.
    pub(crate) moving: Vec<usize>,
}

impl Reach {
    pub(crate) fn new<K: Sampling>(candidate: &Candidate<K>) -> Self {
        let (m, free, shape) = (candidate.matrix(), candidate.free(), candidate.shape());
        let (a, b, nc) = (shape.rows(), shape.columns(), candidate.channels().len());
        let pattern = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] != 0.0 || free[(i, j)]);
        let loops = closure(&pattern.view((a, b), (nc, nc)).into_owned());
        let or = |x: &DMatrix<bool>, y: &DMatrix<bool>| product(x, y);
        let out = or(&pattern.view((0, b), (a, nc)).into_owned(), &loops);
        let into = or(&loops, &pattern.view((a, 0), (nc, b)).into_owned());
        let left = DMatrix::from_fn(a, m.nrows(), |i, r| if r < a { i == r } else { out[(i, r - a)] });
        let right = DMatrix::from_fn(m.ncols(), b, |c, j| if c < b { c == j } else { into[(c - b, j)] });
        let frozen = product(&product(&left, &pattern), &right);
        let mut active = product(&product(&left, free), &right);
        let moving = moving(&frozen, &active, shape.states);
        if candidate.clock().nyquist_hz().is_infinite() {
            // The exponential carries a change along every path of [A B; 0 0].
            let n = shape.states;
            let paths = closure(&DMatrix::from_fn(b, b, |i, j| i < n && frozen[(i, j)]));
            let generator = DMatrix::from_fn(b, b, |i, j| i < n && active[(i, j)]);
            let moved = product(&product(&paths, &generator), &paths);
            for j in 0..b {
                for i in 0..n {
                    active[(i, j)] = moved[(i, j)];
                }
            }
        }
        let entries = (0..b).flat_map(|j| (0..a).map(move |i| (i, j)));
        Self {
            active: entries.filter(|&at| active[at]).collect(),
            moving,
        }
    }
}

fn moving(frozen: &DMatrix<bool>, active: &DMatrix<bool>, n: usize) -> Vec<usize> {
    let joined = closure(&DMatrix::from_fn(n, n, |i, j| frozen[(i, j)] || frozen[(j, i)]));
    let moves = |i: usize| (0..n).any(|k| joined[(i, k)] && (0..n).any(|l| active[(k, l)]));
    (0..n).filter(|&i| moves(i)).collect()
}

fn product(x: &DMatrix<bool>, y: &DMatrix<bool>) -> DMatrix<bool> {
    DMatrix::from_fn(x.nrows(), y.ncols(), |i, j| {
        (0..x.ncols()).any(|k| x[(i, k)] && y[(k, j)])
    })
}

/// Where a path of any length leads, of length zero too.
fn closure(x: &DMatrix<bool>) -> DMatrix<bool> {
    let n = x.nrows();
    let mut reached = DMatrix::from_fn(n, n, |i, j| i == j || x[(i, j)]);
    for k in 0..n {
        for i in 0..n {
            if reached[(i, k)] {
                for j in 0..n {
                    reached[(i, j)] |= reached[(k, j)];
                }
            }
        }
    }
    reached
}

#[cfg(test)]
mod tests;
