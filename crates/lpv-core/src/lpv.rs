//! LPV state space with static dependence on p, equation (2) of the paper.

use crate::linalg::{dimension, finite, finite_vector};
use crate::{
    Clock, Continuous, CoreError, Discrete, MatrixFunction, SchedulingRange, StateSpace, Trajectory,
};
use nalgebra::{DMatrix, DVector};

/// `delta x = A(p) x + B(p) u`, `y = C(p) x + D(p) u` for p in a box.
#[derive(Debug, Clone, PartialEq)]
pub struct LpvStateSpace<K: Clock> {
    a: MatrixFunction,
    b: MatrixFunction,
    c: MatrixFunction,
    d: MatrixFunction,
    range: SchedulingRange,
    clock: K,
}

impl<K: Clock> LpvStateSpace<K> {
    /// Checks that the shapes fit and that the functions ask for no more parameters than the range has.
    ///
    /// # Errors
    /// [`CoreError::Dimension`].
    pub fn new(
        a: MatrixFunction,
        b: MatrixFunction,
        c: MatrixFunction,
        d: MatrixFunction,
        range: SchedulingRange,
        clock: K,
    ) -> Result<Self, CoreError> {
        let n = a.shape().0;
        dimension("LPV state space: columns of A", n, a.shape().1)?;
        dimension("LPV state space: rows of B", n, b.shape().0)?;
        dimension("LPV state space: columns of C", n, c.shape().1)?;
        dimension("LPV state space: rows of D", c.shape().0, d.shape().0)?;
        dimension("LPV state space: columns of D", b.shape().1, d.shape().1)?;
        for f in [&a, &b, &c, &d] {
            if f.basis().parameters() > range.parameters() {
                return Err(CoreError::Dimension {
                    what: "LPV state space: parameters of the range",
                    expected: f.basis().parameters(),
                    found: range.parameters(),
                });
            }
        }
        Ok(Self {
            a,
            b,
            c,
            d,
            range,
            clock,
        })
    }

    /// `A(p)`, `n x n`.
    pub fn a(&self) -> &MatrixFunction {
        &self.a
    }
    /// `B(p)`, `n x n_u`.
    pub fn b(&self) -> &MatrixFunction {
        &self.b
    }
    /// `C(p)`, `n_y x n`.
    pub fn c(&self) -> &MatrixFunction {
        &self.c
    }
    /// `D(p)`, `n_y x n_u`.
    pub fn d(&self) -> &MatrixFunction {
        &self.d
    }
    /// The scheduling box.
    pub fn range(&self) -> &SchedulingRange {
        &self.range
    }
    /// The clock.
    pub fn clock(&self) -> K {
        self.clock
    }
    /// Number of states.
    pub fn states(&self) -> usize {
        self.a.shape().0
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.b.shape().1
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.c.shape().0
    }

    /// The model for constant p.
    ///
    /// # Errors
    /// [`CoreError::OutsideRange`], [`CoreError::Dimension`].
    pub fn frozen(&self, p: &[f64]) -> Result<StateSpace<K>, CoreError> {
        self.range.check(p)?;
        StateSpace::new(
            self.a.evaluate(p),
            self.b.evaluate(p),
            self.c.evaluate(p),
            self.d.evaluate(p),
            self.clock,
        )
    }

    fn check_signals(
        &self,
        x: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
    ) -> Result<(), CoreError> {
        dimension("simulation: initial state", self.states(), x.len())?;
        dimension("simulation: rows of the input", self.inputs(), inputs.nrows())?;
        dimension(
            "simulation: samples of the scheduling",
            inputs.ncols(),
            scheduling.ncols(),
        )?;
        finite("simulation: input", inputs)?;
        finite_vector("simulation: initial state", x)?;
        scheduling
            .column_iter()
            .try_for_each(|p| self.range.check(p.as_slice()))
    }
}

/// Matrices at one p, evaluated in place so that a simulation allocates nothing a sample.
struct Frozen {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    scratch: Vec<f64>,
}

impl Frozen {
    fn new<K: Clock>(model: &LpvStateSpace<K>) -> Self {
        let p = model.range.centre();
        Self {
            a: model.a.evaluate(&p),
            b: model.b.evaluate(&p),
            c: model.c.evaluate(&p),
            d: model.d.evaluate(&p),
            scratch: Vec::new(),
        }
    }
    fn update(&mut self, f: &MatrixFunction, p: &[f64], which: fn(&mut Self) -> &mut DMatrix<f64>) {
        if !f.basis().is_constant() {
            let mut scratch = std::mem::take(&mut self.scratch);
            f.evaluate_into(p, &mut scratch, which(self));
            self.scratch = scratch;
        }
    }
    fn dynamics<K: Clock>(&mut self, model: &LpvStateSpace<K>, p: &[f64]) {
        self.update(&model.a, p, |s| &mut s.a);
        self.update(&model.b, p, |s| &mut s.b);
    }
    fn output<K: Clock>(&mut self, model: &LpvStateSpace<K>, p: &[f64]) {
        self.update(&model.c, p, |s| &mut s.c);
        self.update(&model.d, p, |s| &mut s.d);
    }
}

impl LpvStateSpace<Discrete> {
    /// Response to `inputs` (`n_u x N`) along `scheduling` (`n_p x N`), one column a sample, from `initial_state`. The
    /// response of an unstable model may overflow, and is then infinite or NaN from there on.
    ///
    /// # Errors
    /// [`CoreError::OutsideRange`], [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn simulate(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
    ) -> Result<Trajectory, CoreError> {
        self.check_signals(initial_state, inputs, scheduling)?;
        let mut frozen = Frozen::new(self);
        let mut outputs = DMatrix::zeros(self.outputs(), inputs.ncols());
        let mut x = initial_state.clone();
        let mut next = x.clone();
        for k in 0..inputs.ncols() {
            let p = scheduling.column(k);
            frozen.dynamics(self, p.as_slice());
            frozen.output(self, p.as_slice());
            let u = inputs.column(k);
            let mut y = outputs.column_mut(k);
            y.gemv(1.0, &frozen.c, &x, 0.0);
            y.gemv(1.0, &frozen.d, &u, 1.0);
            next.gemv(1.0, &frozen.a, &x, 0.0);
            next.gemv(1.0, &frozen.b, &u, 1.0);
            std::mem::swap(&mut x, &mut next);
        }
        Ok(Trajectory {
            outputs,
            final_state: x,
        })
    }
}

/// Most sub-steps a sample that the integrator tries.
const MOST_SUBSTEPS: usize = 4096;

/// One run of the integrator.
struct Run {
    trajectory: Trajectory,
    largest_state: f64,
}

impl Run {
    /// Largest relative difference from a coarser run; infinite where one of them overflowed.
    fn difference(&self, coarse: &Self) -> f64 {
        let (y, x) = (&self.trajectory.outputs, &self.trajectory.final_state);
        let (y_coarse, x_coarse) = (&coarse.trajectory.outputs, &coarse.trajectory.final_state);
        // amax skips NaN, so that overflow must be looked for.
        let (dy, dx) = (y - y_coarse, x - x_coarse);
        if !dy.iter().chain(dx.iter()).all(|v| v.is_finite()) {
            return f64::INFINITY;
        }
        let relative = |error: f64, scale: f64| error / scale.max(f64::MIN_POSITIVE);
        relative(dy.amax(), y.amax()).max(relative(dx.amax(), self.largest_state))
    }
}

impl LpvStateSpace<Continuous> {
    /// Response, at the samples of `clock`, to inputs that are held between samples while p runs linearly from one
    /// sample to the next (and stays after the last).
    ///
    /// Classical Runge-Kutta with equal sub-steps, doubled over the whole record until two runs agree within
    /// `tolerance`: in the outputs relative to the largest output, in the final state relative to the largest state on
    /// the way. The error of the result is then about a fifteenth of it.
    ///
    /// # Errors
    /// [`CoreError::Integration`] if 4096 sub-steps a sample are not enough, or if the response overflows; otherwise as
    /// for discrete time.
    pub fn simulate_held(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
        clock: Discrete,
        tolerance: f64,
    ) -> Result<Trajectory, CoreError> {
        self.check_signals(initial_state, inputs, scheduling)?;
        let mut substeps = 1;
        let mut coarse = self.integrate(initial_state, inputs, scheduling, clock, substeps);
        loop {
            substeps *= 2;
            let fine = self.integrate(initial_state, inputs, scheduling, clock, substeps);
            let error = fine.difference(&coarse);
            if error <= tolerance {
                return Ok(fine.trajectory);
            }
            if substeps >= MOST_SUBSTEPS {
                return Err(CoreError::Integration {
                    error,
                    substeps,
                    tolerance,
                });
            }
            coarse = fine;
        }
    }

    fn integrate(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
        clock: Discrete,
        substeps: usize,
    ) -> Run {
        let h = clock.sample_time() / substeps as f64;
        let samples = inputs.ncols();
        let mut frozen = Frozen::new(self);
        let mut outputs = DMatrix::zeros(self.outputs(), samples);
        let mut x = initial_state.clone();
        let mut largest_state = x.amax();
        let n = x.len();
        let mut k: [DVector<f64>; 4] = std::array::from_fn(|_| DVector::zeros(n));
        let mut stage = x.clone();
        let mut p = vec![0.0; self.range.parameters()];
        for sample in 0..samples {
            let u = inputs.column(sample);
            let p0 = scheduling.column(sample);
            let p1 = scheduling.column((sample + 1).min(samples - 1));
            frozen.output(self, p0.as_slice());
            let mut y = outputs.column_mut(sample);
            y.gemv(1.0, &frozen.c, &x, 0.0);
            y.gemv(1.0, &frozen.d, &u, 1.0);
            for step in 0..substeps {
                for (i, (node, weight)) in [(0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)]
                    .into_iter()
                    .enumerate()
                {
                    if i != 2 {
                        // Stages two and three stand at the same instant.
                        let t = (step as f64 + node) / substeps as f64;
                        p.iter_mut()
                            .enumerate()
                            .for_each(|(j, v)| *v = p0[j] + t * (p1[j] - p0[j]));
                        frozen.dynamics(self, &p);
                    }
                    stage.copy_from(&x);
                    if i > 0 {
                        stage.axpy(weight * h, &k[i - 1], 1.0);
                    }
                    k[i].gemv(1.0, &frozen.a, &stage, 0.0);
                    k[i].gemv(1.0, &frozen.b, &u, 1.0);
                }
                for (slope, weight) in k.iter().zip([1.0, 2.0, 2.0, 1.0]) {
                    x.axpy(weight * h / 6.0, slope, 1.0);
                }
            }
            largest_state = largest_state.max(x.amax());
        }
        Run {
            trajectory: Trajectory {
                outputs,
                final_state: x,
            },
            largest_state,
        }
    }
}
