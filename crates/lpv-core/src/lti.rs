//! Linear time-invariant state space.

use crate::clock::same_clock;
use crate::linalg::{block_diagonal, dimension, eigenvalues, finite, finite_vector, from_blocks, square};
use crate::recursion;
use crate::{Clock, CoreError, Discrete};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// `delta x = A x + B u`, `y = C x + D u`, where `delta` is the derivative or the forward shift, as the clock says.
///
/// Shapes: A `n x n`, B `n x n_u`, C `n_y x n`, D `n_y x n_u`. Entries are finite: [`StateSpace::new`] is the only
/// way in.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace<K: Clock> {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    clock: K,
}

impl<K: Clock> StateSpace<K> {
    /// Checks and keeps the four matrices.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] or [`CoreError::NotFinite`], naming the matrix.
    pub fn new(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        clock: K,
    ) -> Result<Self, CoreError> {
        square("state space: columns of A", &a)?;
        dimension("state space: rows of B", a.nrows(), b.nrows())?;
        dimension("state space: columns of C", a.nrows(), c.ncols())?;
        dimension("state space: rows of D", c.nrows(), d.nrows())?;
        dimension("state space: columns of D", b.ncols(), d.ncols())?;
        finite("state space: A", &a)?;
        finite("state space: B", &b)?;
        finite("state space: C", &c)?;
        finite("state space: D", &d)?;
        Ok(Self { a, b, c, d, clock })
    }

    /// A system without states: `y = D u`.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`].
    pub fn gain(d: DMatrix<f64>, clock: K) -> Result<Self, CoreError> {
        let (ny, nu) = d.shape();
        Self::new(
            DMatrix::zeros(0, 0),
            DMatrix::zeros(0, nu),
            DMatrix::zeros(ny, 0),
            d,
            clock,
        )
    }

    /// State matrix, `n x n`.
    pub fn a(&self) -> &DMatrix<f64> {
        &self.a
    }
    /// Input matrix, `n x n_u`.
    pub fn b(&self) -> &DMatrix<f64> {
        &self.b
    }
    /// Output matrix, `n_y x n`.
    pub fn c(&self) -> &DMatrix<f64> {
        &self.c
    }
    /// Feed-through, `n_y x n_u`.
    pub fn d(&self) -> &DMatrix<f64> {
        &self.d
    }
    /// The clock.
    pub fn clock(&self) -> K {
        self.clock
    }
    /// Number of states.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.c.nrows()
    }

    /// Eigenvalues of A.
    ///
    /// # Errors
    /// If the QR iteration does not converge.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, CoreError> {
        eigenvalues(&self.a)
    }

    /// Whether every pole is strictly inside the stable region.
    ///
    /// # Errors
    /// As [`StateSpace::poles`].
    pub fn is_stable(&self) -> Result<bool, CoreError> {
        Ok(self.poles()?.into_iter().all(|p| self.clock.is_stable_pole(p)))
    }

    /// `next` after `self`: the outputs of `self` drive `next`.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if the signals between them differ in number; [`CoreError::DifferentClocks`].
    pub fn then(&self, next: &Self) -> Result<Self, CoreError> {
        same_clock(self.clock, next.clock)?;
        dimension(
            "series: inputs of the second system",
            self.outputs(),
            next.inputs(),
        )?;
        let zero = DMatrix::zeros(self.states(), next.states());
        let a = from_blocks(&[&[&self.a, &zero], &[&(&next.b * &self.c), &next.a]])?;
        let b = from_blocks(&[&[&self.b], &[&(&next.b * &self.d)]])?;
        let c = from_blocks(&[&[&(&next.d * &self.c), &next.c]])?;
        Self::new(a, b, c, &next.d * &self.d, self.clock)
    }

    /// Both systems on the same inputs, outputs added.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if inputs or outputs differ in number; [`CoreError::DifferentClocks`].
    pub fn plus(&self, other: &Self) -> Result<Self, CoreError> {
        same_clock(self.clock, other.clock)?;
        dimension("parallel: inputs", self.inputs(), other.inputs())?;
        dimension("parallel: outputs", self.outputs(), other.outputs())?;
        let a = block_diagonal(&self.a, &other.a);
        let b = from_blocks(&[&[&self.b], &[&other.b]])?;
        let c = from_blocks(&[&[&self.c, &other.c]])?;
        Self::new(a, b, c, &self.d + &other.d, self.clock)
    }

    /// Both systems side by side: `diag(self, other)`.
    ///
    /// # Errors
    /// [`CoreError::DifferentClocks`].
    pub fn beside(&self, other: &Self) -> Result<Self, CoreError> {
        same_clock(self.clock, other.clock)?;
        Self::new(
            block_diagonal(&self.a, &other.a),
            block_diagonal(&self.b, &other.b),
            block_diagonal(&self.c, &other.c),
            block_diagonal(&self.d, &other.d),
            self.clock,
        )
    }
}

/// A simulated response: outputs `n_y x N`, one column a sample, and the state after the last sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Outputs, one column a sample.
    pub outputs: DMatrix<f64>,
    /// State after the last sample.
    pub final_state: DVector<f64>,
}

impl StateSpace<Discrete> {
    /// Response to `inputs` (`n_u x N`, one column a sample) from `initial_state`. The response of an unstable system
    /// may overflow, and is then infinite or NaN from there on.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn simulate(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
    ) -> Result<Trajectory, CoreError> {
        dimension("simulation: initial state", self.states(), initial_state.len())?;
        dimension("simulation: rows of the input", self.inputs(), inputs.nrows())?;
        finite("simulation: input", inputs)?;
        finite_vector("simulation: initial state", initial_state)?;
        let mut x = initial_state.clone();
        let outputs = recursion::outputs([&self.a, &self.b, &self.c, &self.d], &mut x, inputs);
        Ok(Trajectory {
            outputs,
            final_state: x,
        })
    }
}
