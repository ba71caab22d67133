//! Series expansions (4)-(6) and (13): fixed filters with coefficients that depend on p.

use crate::clock::same_clock;
use crate::linalg::{block_diagonal, dimension, from_blocks};
use crate::{CoreError, Discrete, LpvStateSpace, MatrixFunction, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// `y = R(q) u + W_0(p) u + sum_i W_i(p) phi_i(q) u`.
///
/// `phi` is one filter bank with a single input and `n_g` outputs, used for every input channel; with the pulse basis
/// `q^-1 ... q^-n` this is the LPV FIR model (4). `R` does not depend on p: the rigid body of (13), or nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesExpansion {
    rigid_body: StateSpace<Discrete>,
    basis: StateSpace<Discrete>,
    direct: MatrixFunction,
    weights: MatrixFunction,
    range: SchedulingRange,
}

impl SeriesExpansion {
    /// `rigid_body`: `n_y x n_u`. `basis`: one input, `n_g` outputs. `direct`: `W_0(p)`, `n_y x n_u`. `weights`:
    /// `[W_1(p) ... W_ng(p)]`, `n_y x n_g n_u`.
    ///
    /// # Errors
    /// [`CoreError::Dimension`]; [`CoreError::DifferentClocks`] if the two filters tick differently.
    pub fn new(
        rigid_body: StateSpace<Discrete>,
        basis: StateSpace<Discrete>,
        direct: MatrixFunction,
        weights: MatrixFunction,
        range: SchedulingRange,
    ) -> Result<Self, CoreError> {
        let (ny, nu) = (rigid_body.outputs(), rigid_body.inputs());
        dimension("series expansion: inputs of the basis", 1, basis.inputs())?;
        dimension("series expansion: rows of W_0", ny, direct.shape().0)?;
        dimension("series expansion: columns of W_0", nu, direct.shape().1)?;
        dimension("series expansion: rows of W", ny, weights.shape().0)?;
        dimension(
            "series expansion: columns of W",
            nu * basis.outputs(),
            weights.shape().1,
        )?;
        for f in [&direct, &weights] {
            if f.basis().parameters() > range.parameters() {
                dimension(
                    "series expansion: parameters",
                    f.basis().parameters(),
                    range.parameters(),
                )?;
            }
        }
        same_clock(rigid_body.clock(), basis.clock())?;
        Ok(Self {
            rigid_body,
            basis,
            direct,
            weights,
            range,
        })
    }

    /// The part that does not depend on p.
    pub fn rigid_body(&self) -> &StateSpace<Discrete> {
        &self.rigid_body
    }
    /// The filter bank, one input and `n_g` outputs.
    pub fn basis(&self) -> &StateSpace<Discrete> {
        &self.basis
    }
    /// `W_0(p)`.
    pub fn direct(&self) -> &MatrixFunction {
        &self.direct
    }
    /// `[W_1(p) ... W_ng(p)]`.
    pub fn weights(&self) -> &MatrixFunction {
        &self.weights
    }
    /// The scheduling box.
    pub fn range(&self) -> &SchedulingRange {
        &self.range
    }
    /// Number of basis functions `n_g`.
    pub fn functions(&self) -> usize {
        self.basis.outputs()
    }

    /// The state space of the expansion: the rigid body's states, then a copy of the filter bank for each input;
    /// p enters only at the output.
    ///
    /// # Errors
    /// [`CoreError::DifferentFunctions`] if basis functions with a feed-through make `W_0` and `W_i` add up at the output
    /// and the two depend on p through different functions.
    pub fn to_state_space(&self) -> Result<LpvStateSpace<Discrete>, CoreError> {
        let (rigid, basis) = (&self.rigid_body, &self.basis);
        let (ny, nu, ng) = (rigid.outputs(), rigid.inputs(), basis.outputs());
        let mut a = rigid.a().clone();
        let mut b = rigid.b().clone();
        for input in 0..nu {
            a = block_diagonal(&a, basis.a());
            let mut own = DMatrix::zeros(basis.states(), nu);
            own.set_column(input, &basis.b().column(0));
            b = from_blocks(&[&[&b], &[&own]])?;
        }
        // Column (i, j) of W, function i and input j, goes to the states of input j.
        let mut select = DMatrix::zeros(ng * nu, rigid.states() + nu * basis.states());
        let mut feedthrough = DMatrix::zeros(ng * nu, nu);
        for input in 0..nu {
            for i in 0..ng {
                let left = rigid.states() + input * basis.states();
                select
                    .view_mut((i * nu + input, left), (1, basis.states()))
                    .copy_from(&basis.c().row(i));
                feedthrough[(i * nu + input, input)] = basis.d()[(i, 0)];
            }
        }
        let mut rigid_c = DMatrix::zeros(ny, a.nrows());
        rigid_c.columns_mut(0, rigid.states()).copy_from(rigid.c());
        let c = with_constant(
            &self.weights.multiplied(&DMatrix::identity(ny, ny), &select)?,
            &rigid_c,
        )?;
        let d_weights = self
            .weights
            .multiplied(&DMatrix::identity(ny, ny), &feedthrough)?;
        let zero_d = d_weights.coefficients().iter().all(|t| t.amax() == 0.0);
        let d = match (zero_d, self.direct.basis().is_constant()) {
            (true, _) => with_constant(&self.direct, rigid.d())?,
            (false, true) => with_constant(
                &d_weights,
                &(rigid.d() + self.direct.evaluate(&self.range.centre())),
            )?,
            (false, false) if d_weights.basis().is_constant() => with_constant(
                &self.direct,
                &(rigid.d() + d_weights.evaluate(&self.range.centre())),
            )?,
            (false, false) => {
                if d_weights.basis() != self.direct.basis() {
                    return Err(CoreError::DifferentFunctions {
                        what: "series expansion: W_0 and W",
                        first: self.direct.basis().name(),
                        second: d_weights.basis().name(),
                    });
                }
                let sum = d_weights
                    .coefficients()
                    .iter()
                    .zip(self.direct.coefficients())
                    .map(|(x, y)| x + y);
                with_constant(
                    &MatrixFunction::new(d_weights.basis().clone(), sum.collect())?,
                    rigid.d(),
                )?
            }
        };
        LpvStateSpace::new(
            MatrixFunction::constant(a)?,
            MatrixFunction::constant(b)?,
            c,
            d,
            self.range.clone(),
            basis.clock(),
        )
    }
}

/// `f(p) + constant`, in the basis of `f`, all of which reproduce constants.
fn with_constant(f: &MatrixFunction, constant: &DMatrix<f64>) -> Result<MatrixFunction, CoreError> {
    use crate::function::BasisKind;
    let mut coefficients = f.coefficients().to_vec();
    match f.basis().kind() {
        BasisKind::Spline { .. } | BasisKind::Tabulated { .. } => {
            coefficients.iter_mut().for_each(|t| *t += constant);
        }
        BasisKind::Chebyshev { .. } | BasisKind::Matern { .. } => {
            if let Some(first) = coefficients.first_mut() {
                *first += constant;
            }
        }
        BasisKind::Monomials { exponents } => {
            match exponents.iter().position(|e| e.iter().all(|&k| k == 0)) {
                Some(i) => coefficients[i] += constant,
                None => {
                    let mut exponents = exponents.clone();
                    exponents.push(Vec::new());
                    coefficients.push(constant.clone());
                    let basis = crate::FunctionBasis::new(BasisKind::Monomials { exponents })?;
                    return MatrixFunction::new(basis, coefficients);
                }
            }
        }
    }
    MatrixFunction::new(f.basis().clone(), coefficients)
}
