//! The linearisation of the problem: every line of every position, compressed to a small triangle.

use super::{Linear, Problem};
use crate::frozen::{Closure, close};
use crate::lines::Chunk;
use crate::sampling::hold::Derivative;
use crate::sampling::{Sampling, apply_chain};
use crate::shape::Shape;
use lpv_core::Discrete;
use lpv_numerics::dense::{Triangle, complement, triangle_of};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Lines of one task.
const TASK: usize = 1024;

/// Lines of one factorisation: large enough for blocked Householder steps, small enough for the cache.
const CHUNK: usize = 64;

impl<K: Sampling> Problem<'_, K> {
    /// The compressed linearisation at a point where the cost exists.
    pub(crate) fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        let m = self.matrix(theta);
        let blocks: Vec<Option<Linear>> = (0..self.deltas.len())
            .into_par_iter()
            .map(|i| self.linearise_position(&m, i))
            .collect();
        let blocks = blocks.into_iter().collect::<Option<Vec<_>>>()?;
        let rows = blocks.iter().map(|b| b.residual.len()).sum();
        let mut all = Linear {
            jacobian: DMatrix::zeros(rows, self.free.len()),
            residual: DVector::zeros(rows),
            factorisations: 0,
            chains: Vec::with_capacity(blocks.len()),
        };
        let mut at = 0;
        for block in blocks {
            let count = block.residual.len();
            all.jacobian.rows_mut(at, count).copy_from(&block.jacobian);
            all.residual.rows_mut(at, count).copy_from(&block.residual);
            all.factorisations += block.factorisations;
            all.chains.extend(block.chains);
            at += count;
        }
        Some(all)
    }

    fn linearise_position(&self, m: &DMatrix<f64>, i: usize) -> Option<Linear> {
        let (position, values) = (&self.data.positions()[i], &self.values[i]);
        let (sampled, chain) = self.chain(m, &self.deltas[i])?;
        let basis = self.determined(&sampled);
        let lines = position.frf.len();
        let starts: Vec<usize> = (0..lines).step_by(TASK).collect();
        let columns = basis.ncols() + 1;
        let channels = 2 * self.shape.outputs * self.shape.inputs;
        let one = |&from: &usize| {
            let end = (from + TASK).min(lines);
            let mut triangle = Triangle::new(columns, channels * CHUNK.min(end - from));
            let mut work = Vec::new();
            for first in (from..end).step_by(CHUNK) {
                let range = first..(first + CHUNK).min(end);
                let emphasis = &self.emphasis[i];
                let chunk = Chunk::new(&sampled, self.shape, position, (values, emphasis), range)?;
                chunk.fill(&self.reach.active, &basis, &mut work, &mut triangle);
                triangle.absorb(chunk.rows());
            }
            Some(triangle.factor())
        };
        let factors: Vec<Option<DMatrix<f64>>> = if starts.len() == 1 {
            starts.iter().map(one).collect()
        } else {
            starts.par_iter().map(one).collect()
        };
        let factors = factors.into_iter().collect::<Option<Vec<_>>>()?;
        let r = match factors.as_slice() {
            [only] => only.clone(),
            several => triangle_of(columns, several.iter()),
        };
        let size = columns - 1;
        Some(Linear {
            jacobian: r.view((0, 0), (size, size)) * (basis.transpose() * &chain),
            residual: r.view((0, size), (size, 1)).column(0).into_owned(),
            factorisations: lines.div_ceil(CHUNK),
            chains: vec![(sampled, chain)],
        })
    }

    /// The sampled S at one value of Delta, and how its active entries (rows) move with the free entries (columns).
    fn chain(&self, m: &DMatrix<f64>, delta: &[f64]) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let clocks = (self.whole.clock(), self.data.clock());
        let (sampled, all) = chain(m, self.shape, delta, &self.free, clocks)?;
        let rows = self.shape.rows();
        let active: Vec<usize> = self.reach.active.iter().map(|&(i, j)| j * rows + i).collect();
        Some((sampled, all.select_rows(&active)))
    }

    /// Orthonormal basis of the changes of S that a change of the frozen system's state coordinates does not make: the
    /// response does not see the others, so that they need no columns.
    fn determined(&self, s: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.shape.states;
        let mut moves = vec![None; s.nrows() * s.ncols()];
        for (at, &(i, j)) in self.reach.active.iter().enumerate() {
            moves[j * s.nrows() + i] = Some(at);
        }
        let mut tangents = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let mut tangent = DVector::zeros(self.reach.active.len());
                let mut add = |row: usize, column: usize, v: f64| match moves[column * s.nrows() + row] {
                    Some(at) => {
                        tangent[at] += v;
                        true
                    }
                    None => v == 0.0,
                };
                // dS = E_ij S - S E_ij.
                let mut allowed = true;
                for column in 0..s.ncols() {
                    allowed &= add(i, column, s[(j, column)]);
                }
                for row in 0..s.nrows() {
                    allowed &= add(row, j, -s[(row, i)]);
                }
                if allowed {
                    tangents.push(tangent);
                }
            }
        }
        if tangents.is_empty() {
            return DMatrix::identity(self.reach.active.len(), self.reach.active.len());
        }
        // A tangent that is nearly dependent has a direction of few digits; leaving it in costs only a column.
        complement(&DMatrix::from_columns(&tangents), 1e-6)
    }
}

/// The sampled S at one value of Delta, and how its entries (rows, column-major) move with the free entries of M
/// (columns).
pub(crate) fn chain<K: Sampling>(
    m: &DMatrix<f64>,
    shape: Shape,
    delta: &[f64],
    free: &[(usize, usize)],
    (own, data): (K, Discrete),
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let frozen = close(m, shape, delta, Closure::Derivative)?;
    let sampled = own.sample(&frozen.s, shape.states, data, Derivative::Compute)?;
    let (a, b) = (shape.rows(), shape.columns());
    let mut columns = DMatrix::zeros(a * b, free.len());
    for (column, &(r, c)) in free.iter().enumerate() {
        let mut column = columns.column_mut(column);
        for j in 0..b {
            let factor = frozen.right[(c, j)];
            if factor != 0.0 {
                for i in 0..a {
                    column[j * a + i] = frozen.left[(i, r)] * factor;
                }
            }
        }
    }
    Some((sampled.s, apply_chain(sampled.chain.as_ref(), shape, columns)))
}
