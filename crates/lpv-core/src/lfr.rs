//! Linear fractional representations, equation (3) of the paper.

use crate::linalg::{dimension, eigenvalues, finite, finite_vector, from_blocks, square};
use crate::{Clock, CoreError, Discrete, SchedulingRange, StateSpace, Trajectory};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The nine constant matrices of (3). `w = Delta(p) z`; `n_d` is the number of deltas, the length of w and z.
#[derive(Debug, Clone, PartialEq)]
pub struct LfrBlocks {
    /// `n x n`.
    pub a: DMatrix<f64>,
    /// `n x n_d`.
    pub b1: DMatrix<f64>,
    /// `n x n_u`.
    pub b2: DMatrix<f64>,
    /// `n_d x n`.
    pub c1: DMatrix<f64>,
    /// `n_d x n_d`.
    pub d11: DMatrix<f64>,
    /// `n_d x n_u`.
    pub d12: DMatrix<f64>,
    /// `n_y x n`.
    pub c2: DMatrix<f64>,
    /// `n_y x n_d`.
    pub d21: DMatrix<f64>,
    /// `n_y x n_u`.
    pub d22: DMatrix<f64>,
}

impl LfrBlocks {
    /// The matrices with the names that they have in (3).
    pub fn named(&self) -> [(&'static str, &DMatrix<f64>); 9] {
        [
            ("A", &self.a),
            ("B1", &self.b1),
            ("B2", &self.b2),
            ("C1", &self.c1),
            ("D11", &self.d11),
            ("D12", &self.d12),
            ("C2", &self.c2),
            ("D21", &self.d21),
            ("D22", &self.d22),
        ]
    }
}

/// One scheduling parameter, repeated on the diagonal of `Delta`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeltaBlock {
    /// Index of the parameter, from 0.
    pub parameter: usize,
    /// How often it is repeated.
    pub repetitions: usize,
}

/// An LFR whose `Delta(p) = diag(delta_i I)` holds the parameters normalised to [-1, 1] over the scheduling range:
/// `delta_i = (p_i - centre_i) / half_width_i`.
#[derive(Debug, Clone, PartialEq)]
pub struct Lfr<K: Clock> {
    m: LfrBlocks,
    deltas: Vec<DeltaBlock>,
    range: SchedulingRange,
    clock: K,
}

/// What is known about `I - D11 Delta(p)` over the whole range.
#[derive(Debug, Clone, PartialEq)]
pub enum WellPosedness {
    /// Nonsingular everywhere, proven: by the real eigenvalues of D11 for one parameter, by the spectral radius of
    /// `|D11|` for several. `margin` is 1 minus the radius: how far the range could grow, relative to 1.
    Proven {
        /// In (0, 1].
        margin: f64,
    },
    /// Several parameters, not proven; nonsingular on a grid that includes all corners: 5 values of each parameter up
    /// to 6 parameters, 3 up to 9, 2 up to 14.
    Sampled {
        /// Smallest reciprocal condition number seen.
        smallest: f64,
    },
    /// Singular at this p.
    Fails {
        /// Scheduling value.
        p: Vec<f64>,
    },
}

impl<K: Clock> Lfr<K> {
    /// Checks shapes, finiteness, and that the deltas name parameters of the range. At its centre every LFR is
    /// well-posed, since the deltas are zero there; elsewhere ask [`Lfr::well_posedness`].
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn new(
        m: LfrBlocks,
        deltas: Vec<DeltaBlock>,
        range: SchedulingRange,
        clock: K,
    ) -> Result<Self, CoreError> {
        let (n, nd, nu, ny) = (m.a.nrows(), m.d11.nrows(), m.b2.ncols(), m.c2.nrows());
        square("LFR: columns of A", &m.a)?;
        square("LFR: columns of D11", &m.d11)?;
        for (name, block, rows, columns) in [
            ("LFR: A", &m.a, n, n),
            ("LFR: B1", &m.b1, n, nd),
            ("LFR: B2", &m.b2, n, nu),
            ("LFR: C1", &m.c1, nd, n),
            ("LFR: D11", &m.d11, nd, nd),
            ("LFR: D12", &m.d12, nd, nu),
            ("LFR: C2", &m.c2, ny, n),
            ("LFR: D21", &m.d21, ny, nd),
            ("LFR: D22", &m.d22, ny, nu),
        ] {
            dimension(name, rows, block.nrows())?;
            dimension(name, columns, block.ncols())?;
            finite(name, block)?;
        }
        let listed = deltas
            .iter()
            .fold(0_usize, |s, d| s.saturating_add(d.repetitions));
        dimension("LFR: repetitions of the deltas", nd, listed)?;
        for d in &deltas {
            if d.parameter >= range.parameters() {
                return Err(CoreError::Dimension {
                    what: "LFR: parameters of the range",
                    expected: d.parameter.saturating_add(1),
                    found: range.parameters(),
                });
            }
        }
        Ok(Self {
            m,
            deltas,
            range,
            clock,
        })
    }

    /// A model that does not depend on p: no deltas.
    ///
    /// # Errors
    /// None beyond those of [`Lfr::new`].
    pub fn from_lti(system: &StateSpace<K>, range: SchedulingRange) -> Result<Self, CoreError> {
        let (n, nu, ny) = (system.states(), system.inputs(), system.outputs());
        let m = LfrBlocks {
            a: system.a().clone(),
            b1: DMatrix::zeros(n, 0),
            b2: system.b().clone(),
            c1: DMatrix::zeros(0, n),
            d11: DMatrix::zeros(0, 0),
            d12: DMatrix::zeros(0, nu),
            c2: system.c().clone(),
            d21: DMatrix::zeros(ny, 0),
            d22: system.d().clone(),
        };
        Self::new(m, Vec::new(), range, system.clock())
    }

    /// The nine matrices.
    pub fn blocks(&self) -> &LfrBlocks {
        &self.m
    }
    /// The structure of `Delta`.
    pub fn deltas(&self) -> &[DeltaBlock] {
        &self.deltas
    }
    /// The scheduling box.
    pub fn range(&self) -> &SchedulingRange {
        &self.range
    }
    /// The clock.
    pub fn clock(&self) -> K {
        self.clock
    }
    /// Number of states, `dim x`.
    pub fn states(&self) -> usize {
        self.m.a.nrows()
    }
    /// Number of deltas, `dim z`.
    pub fn delta_count(&self) -> usize {
        self.m.d11.nrows()
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.m.b2.ncols()
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.m.c2.nrows()
    }

    /// The diagonal of `Delta(p)`.
    fn delta_diagonal(&self, p: &[f64]) -> DVector<f64> {
        let delta = self.range.normalise(p);
        let diagonal = self
            .deltas
            .iter()
            .flat_map(|d| std::iter::repeat_n(delta[d.parameter], d.repetitions));
        DVector::from_iterator(self.delta_count(), diagonal)
    }

    /// The model for constant p: `A + B1 Delta (I - D11 Delta)^-1 C1` and so on.
    ///
    /// # Errors
    /// [`CoreError::OutsideRange`], [`CoreError::IllPosed`].
    pub fn frozen(&self, p: &[f64]) -> Result<StateSpace<K>, CoreError> {
        self.range.check(p)?;
        let m = &self.m;
        let mut x = from_blocks(&[&[&m.c1, &m.d12]])?;
        self.close(p, &mut x)?;
        let (n, nu) = (self.states(), self.inputs());
        let (xc, xd) = (x.columns(0, n), x.columns(n, nu));
        StateSpace::new(
            &m.a + &m.b1 * xc,
            &m.b2 + &m.b1 * xd,
            &m.c2 + &m.d21 * xc,
            &m.d22 + &m.d21 * xd,
            self.clock,
        )
    }

    /// `w = Delta (I - D11 Delta)^-1 v`, column by column, in place.
    fn close(&self, p: &[f64], v: &mut DMatrix<f64>) -> Result<(), CoreError> {
        let nd = self.delta_count();
        if nd == 0 {
            return Ok(());
        }
        let delta = self.delta_diagonal(p);
        let gap = DMatrix::identity(nd, nd) - scaled_columns(&self.m.d11, &delta);
        let scale = gap.amax();
        let lu = gap.lu();
        let smallest = lu.lu_internal().diagonal().amin();
        if smallest <= 1e-13 * scale || !lu.solve_mut(v) {
            return Err(CoreError::IllPosed { p: p.to_vec() });
        }
        for (mut row, d) in v.row_iter_mut().zip(delta.iter()) {
            row *= *d;
        }
        Ok(())
    }

    /// Whether the LFR is well-posed for every p of the range.
    ///
    /// # Errors
    /// [`CoreError::NoConvergence`] if the eigenvalues of D11 cannot be computed; [`CoreError::Dimension`] if more than
    /// 14 parameters enter and nothing is proven, since their corners are too many to sample.
    pub fn well_posedness(&self) -> Result<WellPosedness, CoreError> {
        let entering: BTreeSet<usize> = self
            .deltas
            .iter()
            .filter(|d| d.repetitions > 0)
            .map(|d| d.parameter)
            .collect();
        if entering.len() <= 1 {
            // det(I - delta D11) = 0 for a real delta in [-1, 1] if and only if D11 has a real eigenvalue |l| >= 1.
            // Real eigenvalues of defective matrices come out as narrow conjugate pairs, hence the tolerance.
            let real = eigenvalues(&self.m.d11)?
                .into_iter()
                .filter(|l| l.im.abs() <= 1e-8 * l.norm());
            let worst = real
                .max_by(|a, b| a.re.abs().total_cmp(&b.re.abs()))
                .map_or(0.0, |l| l.re);
            if worst.abs() < 1.0 {
                return Ok(WellPosedness::Proven {
                    margin: 1.0 - worst.abs(),
                });
            }
            let mut p = self.range.centre();
            if let Some(&parameter) = entering.first() {
                p[parameter] += self.range.half_width()[parameter] / worst;
            }
            return Ok(WellPosedness::Fails { p });
        }
        let radius = eigenvalues(&self.m.d11.abs())?
            .iter()
            .map(|l| l.norm())
            .fold(0.0, f64::max);
        if radius < 1.0 {
            return Ok(WellPosedness::Proven { margin: 1.0 - radius });
        }
        let points = match entering.len() {
            ..=6 => 5,
            7..=9 => 3,
            10..=14 => 2,
            found => {
                return Err(CoreError::Dimension {
                    what: "well-posedness: parameters that enter (at most, to be sampled)",
                    expected: 14,
                    found,
                });
            }
        };
        let box_of_entering = entering.iter().map(|&i| self.range.bounds()[i]).collect();
        let mut smallest = f64::INFINITY;
        let mut sign = None;
        for values in SchedulingRange::new(box_of_entering)?.grid(points) {
            let mut p = self.range.centre();
            entering.iter().zip(values).for_each(|(&i, v)| p[i] = v);
            let delta = self.delta_diagonal(&p);
            let gap = DMatrix::identity(self.delta_count(), self.delta_count())
                - scaled_columns(&self.m.d11, &delta);
            let singular_values = gap.clone().singular_values();
            let reciprocal = singular_values.min() / singular_values.max();
            // The range is connected: a determinant that changes sign passes through zero.
            let positive = gap.determinant() > 0.0;
            if reciprocal < 1e-13 || *sign.get_or_insert(positive) != positive {
                return Ok(WellPosedness::Fails { p });
            }
            smallest = smallest.min(reciprocal);
        }
        Ok(WellPosedness::Sampled { smallest })
    }
}

/// `matrix diag(factors)`.
fn scaled_columns(matrix: &DMatrix<f64>, factors: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = matrix.clone();
    for (mut column, &f) in scaled.column_iter_mut().zip(factors.iter()) {
        column *= f;
    }
    scaled
}

impl Lfr<Discrete> {
    /// Response to `inputs` (`n_u x N`) along `scheduling` (`n_p x N`), one column a sample, from `initial_state`. The
    /// response of an unstable model may overflow, and is then infinite or NaN from there on.
    ///
    /// # Errors
    /// [`CoreError::OutsideRange`], [`CoreError::IllPosed`], [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn simulate(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
    ) -> Result<Trajectory, CoreError> {
        dimension("simulation: initial state", self.states(), initial_state.len())?;
        dimension("simulation: rows of the input", self.inputs(), inputs.nrows())?;
        dimension(
            "simulation: samples of the scheduling",
            inputs.ncols(),
            scheduling.ncols(),
        )?;
        finite("simulation: input", inputs)?;
        finite_vector("simulation: initial state", initial_state)?;
        let m = &self.m;
        let mut outputs = &m.d22 * inputs;
        let mut x = initial_state.clone();
        let mut w = DMatrix::zeros(self.delta_count(), 1);
        for k in 0..inputs.ncols() {
            let p = scheduling.column(k);
            self.range.check(p.as_slice())?;
            let u = inputs.column(k);
            // w = Delta (I - D11 Delta)^-1 (C1 x + D12 u)
            w.column_mut(0).gemv(1.0, &m.c1, &x, 0.0);
            w.column_mut(0).gemv(1.0, &m.d12, &u, 1.0);
            self.close(p.as_slice(), &mut w)?;
            let mut y = outputs.column_mut(k);
            y.gemv(1.0, &m.c2, &x, 1.0);
            y.gemv(1.0, &m.d21, &w.column(0), 1.0);
            let mut next = &m.a * &x;
            next.gemv(1.0, &m.b1, &w.column(0), 1.0);
            next.gemv(1.0, &m.b2, &u, 1.0);
            x = next;
        }
        Ok(Trajectory {
            outputs,
            final_state: x,
        })
    }
}
