//! From LFR to LPV state space: exact where the dependence is polynomial, tabulated elsewhere.

use crate::function::BasisKind;
use crate::linalg::dimension;
use crate::{Clock, CoreError, FunctionBasis, Lfr, LpvStateSpace, MatrixFunction, StateSpace};
use nalgebra::DMatrix;

/// Relative difference up to which a polynomial counts as equal to the LFR.
const POLYNOMIAL_TOLERANCE: f64 = 1e-10;

impl<K: Clock> Lfr<K> {
    /// The exact LPV state space of an LFR of one parameter whose dependence on p is polynomial (D11 is nilpotent),
    /// or of any number of parameters if it is affine (D11 is zero).
    ///
    /// # Errors
    /// [`CoreError::NotPolynomial`] if the LFR is rational in p: use [`Lfr::tabulate`].
    pub fn to_state_space(&self) -> Result<LpvStateSpace<K>, CoreError> {
        let m = self.blocks();
        let nd = self.delta_count();
        // The nilpotency index: the smallest d with D11^d = 0 up to rounding, D11 scaled so that no power overflows.
        let mut unit = m.d11.clone();
        for norm in [DMatrix::amax, DMatrix::norm] {
            let size = norm(&unit);
            if size > 0.0 {
                unit /= size;
            }
        }
        let mut power = DMatrix::<f64>::identity(nd, nd);
        let mut degree = 0;
        while nd > 0 && degree <= nd && power.norm() > 1e-13 {
            power *= &unit;
            degree += 1;
        }
        let one_parameter = self.range().parameters() == 1;
        if degree > nd || (!one_parameter && degree > 1) {
            return Err(CoreError::NotPolynomial);
        }
        if !one_parameter {
            return self.affine();
        }
        let kind = BasisKind::Chebyshev {
            degree,
            range: self.range().clone(),
        };
        let basis = FunctionBasis::new(kind)?;
        let n = degree + 1;
        let (centre, half) = (self.range().centre()[0], self.range().half_width()[0]);
        let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / n as f64;
        let frozen = (0..n)
            .map(|j| self.frozen(&[centre + half * angle(j).cos()]))
            .collect::<Result<Vec<_>, _>>()?;
        let expand = |part: fn(&StateSpace<K>) -> &DMatrix<f64>| {
            let coefficients = (0..n)
                .map(|k| {
                    let weight = if k == 0 { 1.0 } else { 2.0 } / n as f64;
                    let (rows, columns) = part(&frozen[0]).shape();
                    frozen
                        .iter()
                        .enumerate()
                        .fold(DMatrix::zeros(rows, columns), |s, (j, f)| {
                            s + part(f) * (weight * (k as f64 * angle(j)).cos())
                        })
                })
                .collect();
            MatrixFunction::new(basis.clone(), coefficients)
        };
        let model = LpvStateSpace::new(
            expand(|f| f.a())?,
            expand(|f| f.b())?,
            expand(|f| f.c())?,
            expand(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )?;
        // A D11 that is far from normal can have small powers and yet poles in p: hold the polynomial against the
        // LFR between the points that it was made from.
        for j in 0..=n {
            let p = [centre + half * (std::f64::consts::PI * j as f64 / n as f64).cos()];
            let (found, truth) = (model.frozen(&p)?, self.frozen(&p)?);
            for part in [StateSpace::a, StateSpace::b, StateSpace::c, StateSpace::d] {
                if (part(&found) - part(&truth)).amax() > POLYNOMIAL_TOLERANCE * size_of(&truth) {
                    return Err(CoreError::NotPolynomial);
                }
            }
        }
        Ok(model)
    }

    fn affine(&self) -> Result<LpvStateSpace<K>, CoreError> {
        let np = self.range().parameters();
        let unit = |i: usize| (0..np).map(|j| u32::from(i == j)).collect::<Vec<_>>();
        let exponents = std::iter::once(vec![0; np]).chain((0..np).map(unit)).collect();
        let basis = FunctionBasis::new(BasisKind::Monomials { exponents })?;
        let (centre, half) = (self.range().centre(), self.range().half_width());
        let middle = self.frozen(&centre)?;
        let moved = (0..np)
            .map(|i| {
                let mut p = centre.clone();
                p[i] += half[i];
                self.frozen(&p)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let expand = |part: fn(&StateSpace<K>) -> &DMatrix<f64>| {
            let slopes: Vec<_> = moved
                .iter()
                .zip(&half)
                .map(|(f, h)| (part(f) - part(&middle)) / *h)
                .collect();
            let offset = slopes
                .iter()
                .zip(&centre)
                .fold(part(&middle).clone(), |s, (slope, c)| s - slope * *c);
            MatrixFunction::new(basis.clone(), std::iter::once(offset).chain(slopes).collect())
        };
        LpvStateSpace::new(
            expand(|f| f.a())?,
            expand(|f| f.b())?,
            expand(|f| f.c())?,
            expand(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )
    }

    /// The LPV state space that equals the LFR at `points` equidistant values of its one parameter and interpolates
    /// its matrices linearly between them.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] for several parameters, [`CoreError::IllPosed`].
    pub fn tabulate(&self, points: usize) -> Result<LpvStateSpace<K>, CoreError> {
        dimension("tabulation: parameters", 1, self.range().parameters())?;
        let knots: Vec<f64> = self.range().grid(points).into_iter().flatten().collect();
        let basis = FunctionBasis::new(BasisKind::Tabulated { knots: knots.clone() })?;
        let frozen = knots
            .iter()
            .map(|&p| self.frozen(&[p]))
            .collect::<Result<Vec<_>, _>>()?;
        let table = |part: fn(&StateSpace<K>) -> &DMatrix<f64>| {
            MatrixFunction::new(basis.clone(), frozen.iter().map(|f| part(f).clone()).collect())
        };
        LpvStateSpace::new(
            table(|f| f.a())?,
            table(|f| f.b())?,
            table(|f| f.c())?,
            table(|f| f.d())?,
            self.range().clone(),
            self.clock(),
        )
    }
}

/// The largest entry of the four matrices.
fn size_of<K: Clock>(s: &StateSpace<K>) -> f64 {
    [s.a(), s.b(), s.c(), s.d()]
        .map(DMatrix::amax)
        .into_iter()
        .fold(0.0, f64::max)
}
