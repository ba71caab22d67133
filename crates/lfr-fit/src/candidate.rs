//! An LFR whose entries are partly free: what a refinement starts from and returns.

use crate::FitError;
use crate::frozen::{Closure, close};
use crate::shape::Shape;
use lpv_core::linalg::{dimension, from_blocks};
use lpv_core::{Clock, CoreError, DeltaBlock, Lfr, LfrBlocks, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// What closes a channel, `w_j = delta_j z_j`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// `delta_j = 1`: a part of the structure that does not depend on p. [`Candidate::to_lfr`] eliminates it.
    Direct,
    /// The normalised scheduling parameter with this index.
    Parameter(usize),
}

/// An LFR with a mask of its free entries.
///
/// All nine matrices stand in one matrix M, with `n_c` channels:
///
/// `[x+; y; z] = M [x; u; w]`, `w = Delta(p) z`, `M = [A B2 B1; C2 D22 D21; C1 D12 D11]`,
///
/// where `x+` is the next state or the derivative, as the clock says. A refinement moves the entries that the mask
/// marks as free, and no other.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate<K: Clock> {
    matrix: DMatrix<f64>,
    free: DMatrix<bool>,
    states: usize,
    outputs: usize,
    inputs: usize,
    channels: Vec<Channel>,
    range: SchedulingRange,
    clock: K,
}

impl<K: Clock> Candidate<K> {
    /// From the nine matrices, the mask (true: free; shape and order of M) and what closes each channel.
    ///
    /// # Errors
    /// [`FitError::Core`]: shapes that do not fit, numbers that are not finite, a parameter that the range does not
    /// have.
    pub fn new(
        blocks: &LfrBlocks,
        free: DMatrix<bool>,
        channels: Vec<Channel>,
        range: SchedulingRange,
        clock: K,
    ) -> Result<Self, FitError> {
        // The LFR of the same shape, every channel scheduled, refuses what does not fit.
        let deltas = channels.iter().map(|c| DeltaBlock {
            parameter: match c {
                Channel::Direct => 0,
                Channel::Parameter(i) => *i,
            },
            repetitions: 1,
        });
        Lfr::new(blocks.clone(), deltas.collect(), range.clone(), clock)?;
        let m = blocks;
        let matrix = from_blocks(&[
            &[&m.a, &m.b2, &m.b1],
            &[&m.c2, &m.d22, &m.d21],
            &[&m.c1, &m.d12, &m.d11],
        ])?;
        Self {
            free: DMatrix::from_element(matrix.nrows(), matrix.ncols(), false),
            matrix,
            states: m.a.nrows(),
            outputs: m.c2.nrows(),
            inputs: m.b2.ncols(),
            channels,
            range,
            clock,
        }
        .with_free(free)
    }

    /// An LFR with every entry free but those of D22.
    ///
    /// # Errors
    /// None beyond those of [`Candidate::new`].
    pub fn from_lfr(lfr: &Lfr<K>) -> Result<Self, FitError> {
        let (n, nu, ny, nc) = (lfr.states(), lfr.inputs(), lfr.outputs(), lfr.delta_count());
        let in_d22 = |i: usize, j: usize| (n..n + ny).contains(&i) && (n..n + nu).contains(&j);
        let free = DMatrix::from_fn(n + ny + nc, n + nu + nc, |i, j| !in_d22(i, j));
        let channels = lfr
            .deltas()
            .iter()
            .flat_map(|d| std::iter::repeat_n(Channel::Parameter(d.parameter), d.repetitions))
            .collect();
        Self::new(lfr.blocks(), free, channels, lfr.range().clone(), lfr.clock())
    }

    /// The same model with another mask, in the shape and order of M.
    ///
    /// # Errors
    /// [`FitError::Core`] if the mask has another shape.
    pub fn with_free(self, free: DMatrix<bool>) -> Result<Self, FitError> {
        let (rows, columns) = self.matrix.shape();
        dimension("candidate: rows of the mask", rows, free.nrows())?;
        dimension("candidate: columns of the mask", columns, free.ncols())?;
        Ok(Self { free, ..self })
    }

    /// M, `(n + n_y + n_c) x (n + n_u + n_c)`.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }
    /// Which entries of M are free.
    pub fn free(&self) -> &DMatrix<bool> {
        &self.free
    }
    /// Row and column of each free entry, down the columns of M: the order of the parameters of a fit.
    pub fn free_entries(&self) -> Vec<(usize, usize)> {
        let rows = self.matrix.nrows();
        let marked = self.free.iter().enumerate().filter(|(_, free)| **free);
        marked.map(|(at, _)| (at % rows, at / rows)).collect()
    }
    /// Number of states.
    pub fn states(&self) -> usize {
        self.states
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }
    /// What closes each channel.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }
    /// Number of deltas that [`Candidate::to_lfr`] gives: channels that are not direct.
    pub fn delta_count(&self) -> usize {
        self.channels.iter().filter(|c| **c != Channel::Direct).count()
    }
    /// The scheduling box.
    pub fn range(&self) -> &SchedulingRange {
        &self.range
    }
    /// The clock.
    pub fn clock(&self) -> K {
        self.clock
    }

    /// The model for constant p.
    ///
    /// # Errors
    /// [`FitError::Core`]: outside the range, or not well-posed there.
    pub fn frozen(&self, p: &[f64]) -> Result<StateSpace<K>, FitError> {
        self.range.check(p)?;
        let frozen = close(&self.matrix, self.shape(), &self.deltas_at(p), Closure::Value)
            .ok_or_else(|| CoreError::IllPosed { p: p.to_vec() })?;
        Ok(self.shape().system(&frozen.s, self.clock)?)
    }

    /// The plain LFR: direct channels eliminated, deltas in the order of the channels.
    ///
    /// # Errors
    /// [`FitError::Core`] if the loop of the direct channels has no solution.
    pub fn to_lfr(&self) -> Result<Lfr<K>, FitError> {
        let (m, n, nu, ny) = (&self.matrix, self.states, self.inputs, self.outputs);
        let is_direct = |j: &usize| self.channels[*j] == Channel::Direct;
        let (direct, kept): (Vec<usize>, Vec<usize>) = (0..self.channels.len()).partition(is_direct);
        let at = |first: usize, some: &[usize]| some.iter().map(|j| first + j).collect::<Vec<_>>();
        let rows: Vec<usize> = (0..n + ny).chain(at(n + ny, &kept)).collect();
        let columns: Vec<usize> = (0..n + nu).chain(at(n + nu, &kept)).collect();
        let (z, w) = (at(n + ny, &direct), at(n + nu, &direct));
        let pick = |rows: &[usize], columns: &[usize]| m.select_rows(rows).select_columns(columns);
        let mut plain = pick(&rows, &columns);
        if !direct.is_empty() {
            let gap = DMatrix::identity(direct.len(), direct.len()) - pick(&z, &w);
            let through = gap.lu().solve(&pick(&z, &columns)).ok_or(CoreError::Singular {
                operation: "the loop of the direct channels",
            })?;
            plain += pick(&rows, &w) * through;
        }
        let nd = kept.len();
        let part = |at, size| plain.view(at, size).into_owned();
        let blocks = LfrBlocks {
            a: part((0, 0), (n, n)),
            b1: part((0, n + nu), (n, nd)),
            b2: part((0, n), (n, nu)),
            c1: part((n + ny, 0), (nd, n)),
            d11: part((n + ny, n + nu), (nd, nd)),
            d12: part((n + ny, n), (nd, nu)),
            c2: part((n, 0), (ny, n)),
            d21: part((n, n + nu), (ny, nd)),
            d22: part((n, n), (ny, nu)),
        };
        let mut deltas: Vec<DeltaBlock> = Vec::new();
        for j in kept {
            let Channel::Parameter(parameter) = self.channels[j] else {
                continue;
            };
            match deltas.last_mut() {
                Some(last) if last.parameter == parameter => last.repetitions += 1,
                _ => deltas.push(DeltaBlock {
                    parameter,
                    repetitions: 1,
                }),
            }
        }
        Ok(Lfr::new(blocks, deltas, self.range.clone(), self.clock)?)
    }

    pub(crate) fn shape(&self) -> Shape {
        Shape {
            states: self.states,
            outputs: self.outputs,
            inputs: self.inputs,
        }
    }

    /// The diagonal of `Delta(p)`, direct channels included.
    pub(crate) fn deltas_at(&self, p: &[f64]) -> Vec<f64> {
        let delta = self.range.normalise(p);
        let of = |c: &Channel| match c {
            Channel::Direct => 1.0,
            Channel::Parameter(i) => delta[*i],
        };
        self.channels.iter().map(of).collect()
    }

    /// A candidate with the channels, range and clock of another.
    pub(crate) fn from_matrix(matrix: DMatrix<f64>, free: DMatrix<bool>, shape: Shape, other: &Self) -> Self {
        Self {
            matrix,
            free,
            states: shape.states,
            outputs: shape.outputs,
            inputs: shape.inputs,
            channels: other.channels.clone(),
            range: other.range.clone(),
            clock: other.clock,
        }
    }

    /// The same model of another range with as many parameters.
    pub(crate) fn with_range(self, range: SchedulingRange) -> Self {
        Self { range, ..self }
    }

    /// The same model with other numbers in M, of the same shape.
    ///
    /// # Errors
    /// [`FitError::Core`] for another shape, or a number that is not finite.
    pub fn with_entries(&self, matrix: DMatrix<f64>) -> Result<Self, FitError> {
        dimension("entries of M: rows", self.matrix.nrows(), matrix.nrows())?;
        dimension("entries of M: columns", self.matrix.ncols(), matrix.ncols())?;
        if let Some(i) = matrix.iter().position(|v| !v.is_finite()) {
            let (row, column) = (i % matrix.nrows(), i / matrix.nrows());
            let what = "entries of M";
            return Err(CoreError::NotFinite { what, row, column }.into());
        }
        Ok(self.with_matrix(matrix))
    }

    /// The same model with other numbers in M.
    pub(crate) fn with_matrix(&self, matrix: DMatrix<f64>) -> Self {
        Self {
            matrix,
            ..self.clone()
        }
    }
}
