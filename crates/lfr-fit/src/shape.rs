//! Sizes of a model beside its deltas.

use lpv_core::{Clock, CoreError, StateSpace};
use nalgebra::DMatrix;

/// Where the blocks of M begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) states: usize,
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
}

impl Shape {
    /// Rows of the frozen system matrix S, `n + n_y`.
    pub(crate) fn rows(self) -> usize {
        self.states + self.outputs
    }
    /// Columns of S, `n + n_u`.
    pub(crate) fn columns(self) -> usize {
        self.states + self.inputs
    }
    /// The model whose system matrix is `S = [A B; C D]`.
    pub(crate) fn system<K: Clock>(self, s: &DMatrix<f64>, clock: K) -> Result<StateSpace<K>, CoreError> {
        let (n, nu, ny) = (self.states, self.inputs, self.outputs);
        let part = |at, size| s.view(at, size).into_owned();
        StateSpace::new(
            part((0, 0), (n, n)),
            part((0, n), (n, nu)),
            part((n, 0), (ny, n)),
            part((n, n), (ny, nu)),
            clock,
        )
    }
}
