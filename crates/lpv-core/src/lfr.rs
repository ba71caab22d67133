//! Linear fractional representations, equation (3) of the paper.

use crate::linalg::{block_diagonal, dimension, eigenvalues, finite, from_blocks, square};
use crate::{Clock, CoreError, Discrete, SchedulingRange, StateSpace, Trajectory};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

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
    /// Several parameters, not proven; nonsingular on a grid that includes all corners.
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
    /// Checks shapes, finiteness, that the deltas name parameters of the range, and well-posedness at its centre.
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
        let x = self.close(p)?;
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

    /// `Delta (I - D11 Delta)^-1 [C1 D12]`.
    fn close(&self, p: &[f64]) -> Result<DMatrix<f64>, CoreError> {
        let nd = self.delta_count();
        let delta = self.delta_diagonal(p);
        let rhs = from_blocks(&[&[&self.m.c1, &self.m.d12]])?;
        if nd == 0 {
            return Ok(rhs);
        }
        let gap = DMatrix::identity(nd, nd) - &self.m.d11 * DMatrix::from_diagonal(&delta);
        let scale = gap.amax();
        let lu = gap.lu();
        let smallest = lu.u().diagonal().amin();
        let solved = lu.solve(&rhs).filter(|_| smallest > 1e-13 * scale);
        let mut x = solved.ok_or_else(|| CoreError::IllPosed { p: p.to_vec() })?;
        for (mut row, d) in x.row_iter_mut().zip(delta.iter()) {
            row *= *d;
        }
        Ok(x)
    }

    /// Whether the LFR is well-posed for every p of the range.
    ///
    /// # Errors
    /// If the eigenvalues of D11 cannot be computed.
    pub fn well_posedness(&self) -> Result<WellPosedness, CoreError> {
        let one_parameter = self.deltas.windows(2).all(|w| w[0].parameter == w[1].parameter);
        if one_parameter {
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
            if let Some(d) = self.deltas.first() {
                p[d.parameter] += self.range.half_width()[d.parameter] / worst;
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
        let mut smallest = f64::INFINITY;
        let mut sign = None;
        for p in self.range.grid(5) {
            let delta = self.delta_diagonal(&p);
            let gap = DMatrix::identity(self.delta_count(), self.delta_count())
                - &self.m.d11 * DMatrix::from_diagonal(&delta);
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

    /// `next` after `self`, both scheduled by the same p.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if the signals between them or the ranges differ.
    pub fn then(&self, next: &Self) -> Result<Self, CoreError> {
        dimension(
            "LFR series: inputs of the second system",
            self.outputs(),
            next.inputs(),
        )?;
        self.same_range(next)?;
        let (f, g) = (&self.m, &next.m);
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
            [self.deltas.as_slice(), &next.deltas].concat(),
            self.range.clone(),
            self.clock,
        )
    }

    /// Both systems on the same inputs and the same p, outputs added.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if inputs, outputs or ranges differ.
    pub fn plus(&self, other: &Self) -> Result<Self, CoreError> {
        dimension("LFR parallel: inputs", self.inputs(), other.inputs())?;
        dimension("LFR parallel: outputs", self.outputs(), other.outputs())?;
        self.same_range(other)?;
        let (f, g) = (&self.m, &other.m);
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
            [self.deltas.as_slice(), &other.deltas].concat(),
            self.range.clone(),
            self.clock,
        )
    }

    fn same_range(&self, other: &Self) -> Result<(), CoreError> {
        if self.range == other.range {
            return Ok(());
        }
        Err(CoreError::Dimension {
            what: "LFR interconnection: scheduling ranges differ; parameters",
            expected: self.range.parameters(),
            found: other.range.parameters(),
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

impl Lfr<Discrete> {
    /// Response to `inputs` (`n_u x N`) along `scheduling` (`n_p x N`), one column a sample, from `initial_state`.
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
        let m = &self.m;
        let mut outputs = &m.d22 * inputs;
        let mut x = initial_state.clone();
        let nd = self.delta_count();
        let identity = DMatrix::<f64>::identity(nd, nd);
        for k in 0..inputs.ncols() {
            let p = scheduling.column(k);
            self.range.check(p.as_slice())?;
            let delta = self.delta_diagonal(p.as_slice());
            let u = inputs.column(k);
            // z = (I - D11 Delta)^-1 (C1 x + D12 u), w = Delta z
            let mut w = &m.c1 * &x + &m.d12 * u;
            let gap = &identity - &m.d11 * DMatrix::from_diagonal(&delta);
            if nd > 0 && !gap.lu().solve_mut(&mut w) {
                return Err(CoreError::IllPosed {
                    p: p.as_slice().to_vec(),
                });
            }
            w.component_mul_assign(&delta);
            let mut y = outputs.column_mut(k);
            y.gemv(1.0, &m.c2, &x, 1.0);
            y.gemv(1.0, &m.d21, &w, 1.0);
            let mut next = &m.a * &x;
            next.gemv(1.0, &m.b1, &w, 1.0);
            next.gemv(1.0, &m.b2, &u, 1.0);
            x = next;
        }
        Ok(Trajectory {
            outputs,
            final_state: x,
        })
    }
}
