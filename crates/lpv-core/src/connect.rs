//! Series and parallel connections of LFRs.

use crate::clock::same_clock;
use crate::linalg::{block_diagonal, dimension, from_blocks};
use crate::{Clock, CoreError, Lfr, LfrBlocks};
use nalgebra::DMatrix;

impl<K: Clock> Lfr<K> {
    /// `next` after `self`, both scheduled by the same p.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if the signals between them or the ranges differ; [`CoreError::DifferentClocks`].
    pub fn then(&self, next: &Self) -> Result<Self, CoreError> {
        dimension(
            "LFR series: inputs of the second system",
            self.outputs(),
            next.inputs(),
        )?;
        self.same_setting(next)?;
        let (f, g) = (self.blocks(), next.blocks());
        let series = |right: &DMatrix<f64>, left: &DMatrix<f64>| left * right;
        let m = LfrBlocks {
            a: stack(&f.a, &series(&f.c2, &g.b2), &g.a)?,
            b1: stack(&f.b1, &series(&f.d21, &g.b2), &g.b1)?,
            b2: from_blocks(&[&[&f.b2], &[&series(&f.d22, &g.b2)]])?,
            c1: stack(&f.c1, &series(&f.c2, &g.d12), &g.c1)?,
            d11: stack(&f.d11, &series(&f.d21, &g.d12), &g.d11)?,
            d12: from_blocks(&[&[&f.d12], &[&series(&f.d22, &g.d12)]])?,
            c2: from_blocks(&[&[&series(&f.c2, &g.d22), &g.c2]])?,
            d21: from_blocks(&[&[&series(&f.d21, &g.d22), &g.d21]])?,
            d22: series(&f.d22, &g.d22),
        };
        Self::new(
            m,
            [self.deltas(), next.deltas()].concat(),
            self.range().clone(),
            self.clock(),
        )
    }

    /// Both systems on the same inputs and the same p, outputs added.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if inputs, outputs or ranges differ; [`CoreError::DifferentClocks`].
    pub fn plus(&self, other: &Self) -> Result<Self, CoreError> {
        dimension("LFR parallel: inputs", self.inputs(), other.inputs())?;
        dimension("LFR parallel: outputs", self.outputs(), other.outputs())?;
        self.same_setting(other)?;
        let (f, g) = (self.blocks(), other.blocks());
        let m = LfrBlocks {
            a: block_diagonal(&f.a, &g.a),
            b1: block_diagonal(&f.b1, &g.b1),
            b2: from_blocks(&[&[&f.b2], &[&g.b2]])?,
            c1: block_diagonal(&f.c1, &g.c1),
            d11: block_diagonal(&f.d11, &g.d11),
            d12: from_blocks(&[&[&f.d12], &[&g.d12]])?,
            c2: from_blocks(&[&[&f.c2, &g.c2]])?,
            d21: from_blocks(&[&[&f.d21, &g.d21]])?,
            d22: &f.d22 + &g.d22,
        };
        Self::new(
            m,
            [self.deltas(), other.deltas()].concat(),
            self.range().clone(),
            self.clock(),
        )
    }

    fn same_setting(&self, other: &Self) -> Result<(), CoreError> {
        same_clock(self.clock(), other.clock())?;
        if self.range() == other.range() {
            return Ok(());
        }
        Err(CoreError::Dimension {
            what: "LFR interconnection: scheduling ranges differ; parameters",
            expected: self.range().parameters(),
            found: other.range().parameters(),
        })
    }
}

/// `[upper_left 0; lower_left lower_right]`.
fn stack(
    upper_left: &DMatrix<f64>,
    lower_left: &DMatrix<f64>,
    lower_right: &DMatrix<f64>,
) -> Result<DMatrix<f64>, CoreError> {
    let zero = DMatrix::zeros(upper_left.nrows(), lower_right.ncols());
    from_blocks(&[&[upper_left, &zero], &[lower_left, lower_right]])
}
