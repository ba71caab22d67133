//! Matrix functions of the scheduling variable: `M(p) = sum_j Theta_j f_j(p)`, equation (5) of the paper.

use crate::linalg::{dimension, finite};
use crate::spline::{CubicSpline, interval};
use crate::{CoreError, SchedulingRange};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Which functions `f_j(p)` span the dependence on p. Unchecked; [`FunctionBasis::new`] checks it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum BasisKind {
    /// `p_1^e1 p_2^e2 ...`, one list of exponents a function; a list may be shorter than p, so `[]` is the constant.
    Monomials {
        /// Exponents of each function.
        exponents: Vec<Vec<u32>>,
    },
    /// Chebyshev polynomials `T_0 ... T_degree` of one parameter, mapped from `range` to [-1, 1].
    Chebyshev {
        /// Highest degree.
        degree: usize,
        /// The one interval that is mapped.
        range: SchedulingRange,
    },
    /// Cardinal functions of the not-a-knot cubic spline of one parameter: coefficient `j` is the value at knot `j`.
    Spline {
        /// Strictly increasing, at least two.
        knots: Vec<f64>,
    },
    /// Cardinal functions of linear interpolation between tabulated values of one parameter.
    Tabulated {
        /// Strictly increasing, at least two.
        knots: Vec<f64>,
    },
    /// 1 and the Matern-5/2 kernels `k(p, knot_j)` of one parameter: the functions of a Gaussian-process mean.
    Matern {
        /// Strictly increasing, at least one.
        knots: Vec<f64>,
        /// Correlation length, in units of p.
        length_scale: f64,
    },
}

/// Most functions of p along one parameter. No interpolation of measured positions needs as many; below it no power
/// and no matrix that is built from a file's numbers grows out of hand.
const MOST_DEGREE: usize = 1_000;

/// Checked functions of p, ready to be evaluated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BasisKind", into = "BasisKind")]
pub struct FunctionBasis {
    kind: BasisKind,
    spline: Option<CubicSpline>,
}

impl FunctionBasis {
    /// Checks the description.
    ///
    /// # Errors
    /// [`CoreError::Knots`] for knots that do not increase or are too few; [`CoreError::Dimension`] for a Chebyshev
    /// range of more than one parameter, an empty list of functions, and degrees above 1000 (or as many spline knots);
    /// [`CoreError::NotFinite`].
    pub fn new(kind: BasisKind) -> Result<Self, CoreError> {
        let mut spline = None;
        match &kind {
            BasisKind::Monomials { exponents } => {
                if exponents.is_empty() {
                    return Err(CoreError::Dimension {
                        what: "monomials: functions",
                        expected: 1,
                        found: 0,
                    });
                }
                let degrees = exponents
                    .iter()
                    .map(|e| e.iter().map(|&k| u64::from(k)).sum::<u64>());
                at_most("monomials: degree (at most)", degrees.max().unwrap_or(0) as usize)?;
            }
            BasisKind::Chebyshev { range, degree } => {
                at_most("Chebyshev basis: degree (at most)", *degree)?;
                dimension("Chebyshev basis: parameters of the range", 1, range.parameters())?;
            }
            BasisKind::Spline { knots } => {
                check_knots(knots, 2)?;
                at_most("spline basis: knots (at most)", knots.len())?;
                spline = Some(CubicSpline::new(knots)?);
            }
            BasisKind::Tabulated { knots } => check_knots(knots, 2)?,
            BasisKind::Matern { knots, length_scale } => {
                check_knots(knots, 1)?;
                if !(length_scale.is_finite() && *length_scale > 0.0) {
                    return Err(CoreError::NotFinite {
                        what: "Matern basis: length scale",
                        row: 0,
                        column: 0,
                    });
                }
            }
        }
        Ok(Self { kind, spline })
    }

    /// The constant function, of any number of parameters.
    pub fn constant() -> Self {
        Self {
            kind: BasisKind::Monomials {
                exponents: vec![Vec::new()],
            },
            spline: None,
        }
    }

    /// `1, p, p^2 ... p^degree` of one parameter.
    pub fn powers(degree: u32) -> Self {
        let exponents = (0..=degree).map(|e| vec![e]).collect();
        Self {
            kind: BasisKind::Monomials { exponents },
            spline: None,
        }
    }

    /// The description.
    pub fn kind(&self) -> &BasisKind {
        &self.kind
    }

    /// A short name, for messages and reports.
    pub fn name(&self) -> &'static str {
        match self.kind {
            BasisKind::Monomials { .. } => "monomial",
            BasisKind::Chebyshev { .. } => "Chebyshev",
            BasisKind::Spline { .. } => "spline",
            BasisKind::Tabulated { .. } => "tabulated",
            BasisKind::Matern { .. } => "Matern",
        }
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        match &self.kind {
            BasisKind::Monomials { exponents } => exponents.len(),
            BasisKind::Chebyshev { degree, .. } => degree + 1,
            BasisKind::Spline { knots } | BasisKind::Tabulated { knots } => knots.len(),
            BasisKind::Matern { knots, .. } => knots.len() + 1,
        }
    }

    /// Never: a basis has at least one function.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Whether the functions depend on p at all.
    pub fn is_constant(&self) -> bool {
        matches!(&self.kind, BasisKind::Monomials { exponents } if exponents.iter().flatten().all(|&e| e == 0))
    }

    /// Fewest parameters that p must have.
    pub fn parameters(&self) -> usize {
        match &self.kind {
            BasisKind::Monomials { exponents } => exponents.iter().map(Vec::len).max().unwrap_or(0),
            _ => 1,
        }
    }

    /// Writes `f_0(p) ... f_{len-1}(p)` into `out`, replacing what was there. Missing parameters count as zero.
    pub fn evaluate_into(&self, p: &[f64], out: &mut Vec<f64>) {
        out.clear();
        let x = p.first().copied().unwrap_or(0.0);
        match &self.kind {
            BasisKind::Monomials { exponents } => out.extend(exponents.iter().map(|e| {
                e.iter()
                    .enumerate()
                    .map(|(i, &e)| p.get(i).copied().unwrap_or(0.0).powi(e as i32))
                    .product::<f64>()
            })),
            BasisKind::Chebyshev { degree, range } => {
                let t = range.normalise(&[x])[0];
                let (mut previous, mut current) = (1.0, t);
                for _ in 0..=*degree {
                    out.push(previous);
                    (previous, current) = (current, 2.0 * t * current - previous);
                }
            }
            BasisKind::Spline { .. } => {
                if let Some(spline) = &self.spline {
                    spline.cardinals_into(x, out);
                }
            }
            BasisKind::Tabulated { knots } => {
                let i = interval(knots, x);
                let t = (x - knots[i]) / (knots[i + 1] - knots[i]);
                out.resize(knots.len(), 0.0);
                out[i] = 1.0 - t;
                out[i + 1] = t;
            }
            BasisKind::Matern { knots, length_scale } => {
                out.push(1.0);
                out.extend(knots.iter().map(|k| matern52((x - k) / length_scale)));
            }
        }
    }

    /// `f_0(p) ... f_{len-1}(p)`.
    pub fn evaluate(&self, p: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.len());
        self.evaluate_into(p, &mut out);
        out
    }
}

/// The Matern-5/2 correlation at a distance in correlation lengths.
pub fn matern52(distance: f64) -> f64 {
    // Beyond 745 the exponential is zero, and the polynomial must not overflow to infinity times zero.
    let r = 5.0_f64.sqrt() * distance.abs();
    if r > 745.0 {
        return 0.0;
    }
    (1.0 + r + r * r / 3.0) * (-r).exp()
}

fn at_most(what: &'static str, found: usize) -> Result<(), CoreError> {
    if found > MOST_DEGREE {
        return Err(CoreError::Dimension {
            what,
            expected: MOST_DEGREE,
            found,
        });
    }
    Ok(())
}

fn check_knots(knots: &[f64], at_least: usize) -> Result<(), CoreError> {
    if knots.len() < at_least {
        return Err(CoreError::Knots {
            index: knots.len(),
            problem: "missing; too few knots for this basis",
        });
    }
    for (index, k) in knots.iter().enumerate() {
        if !k.is_finite() {
            return Err(CoreError::Knots {
                index,
                problem: "not a finite number",
            });
        }
        if index > 0 && knots[index - 1] >= *k {
            return Err(CoreError::Knots {
                index,
                problem: "not above the knot before it",
            });
        }
    }
    Ok(())
}

impl TryFrom<BasisKind> for FunctionBasis {
    type Error = CoreError;
    fn try_from(kind: BasisKind) -> Result<Self, CoreError> {
        Self::new(kind)
    }
}

impl From<FunctionBasis> for BasisKind {
    fn from(basis: FunctionBasis) -> Self {
        basis.kind
    }
}

/// A matrix that depends on p: `M(p) = sum_j Theta_j f_j(p)`.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixFunction {
    basis: FunctionBasis,
    coefficients: Vec<DMatrix<f64>>,
}

impl MatrixFunction {
    /// One coefficient matrix for each function of the basis, all of one shape.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn new(basis: FunctionBasis, coefficients: Vec<DMatrix<f64>>) -> Result<Self, CoreError> {
        dimension("matrix function: coefficients", basis.len(), coefficients.len())?;
        let shape = coefficients.first().map_or((0, 0), DMatrix::shape);
        for theta in &coefficients {
            dimension("matrix function: rows of a coefficient", shape.0, theta.nrows())?;
            dimension(
                "matrix function: columns of a coefficient",
                shape.1,
                theta.ncols(),
            )?;
            finite("matrix function: coefficient", theta)?;
        }
        Ok(Self { basis, coefficients })
    }

    /// A matrix that does not depend on p.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`].
    pub fn constant(matrix: DMatrix<f64>) -> Result<Self, CoreError> {
        Self::new(FunctionBasis::constant(), vec![matrix])
    }

    /// `M_0 + p M_1 + p^2 M_2 + ...` of one parameter.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] (also for an empty list), [`CoreError::NotFinite`].
    pub fn polynomial(coefficients: Vec<DMatrix<f64>>) -> Result<Self, CoreError> {
        at_most(
            "monomials: degree (at most)",
            coefficients.len().saturating_sub(1),
        )?;
        Self::new(
            FunctionBasis::powers(coefficients.len().saturating_sub(1) as u32),
            coefficients,
        )
    }

    /// The functions of p.
    pub fn basis(&self) -> &FunctionBasis {
        &self.basis
    }
    /// The coefficient of each function.
    pub fn coefficients(&self) -> &[DMatrix<f64>] {
        &self.coefficients
    }
    /// Rows and columns.
    pub fn shape(&self) -> (usize, usize) {
        self.coefficients.first().map_or((0, 0), DMatrix::shape)
    }

    /// The value at p.
    pub fn evaluate(&self, p: &[f64]) -> DMatrix<f64> {
        let (rows, columns) = self.shape();
        let mut value = DMatrix::zeros(rows, columns);
        self.evaluate_into(p, &mut Vec::with_capacity(self.basis.len()), &mut value);
        value
    }

    /// Writes the value at p into `out`, which has the shape of the function; `scratch` is overwritten.
    ///
    /// # Panics
    /// If `out` has another shape.
    pub fn evaluate_into(&self, p: &[f64], scratch: &mut Vec<f64>, out: &mut DMatrix<f64>) {
        self.basis.evaluate_into(p, scratch);
        out.fill(0.0);
        for (theta, &f) in self.coefficients.iter().zip(scratch.iter()) {
            if f != 0.0 {
                out.zip_apply(theta, |o, t| *o += f * t);
            }
        }
    }

    /// The function after a linear map of its coefficients: `left M(p) right`.
    ///
    /// # Errors
    /// [`CoreError::Dimension`].
    pub fn multiplied(&self, left: &DMatrix<f64>, right: &DMatrix<f64>) -> Result<Self, CoreError> {
        dimension(
            "matrix function: columns of the left factor",
            self.shape().0,
            left.ncols(),
        )?;
        dimension(
            "matrix function: rows of the right factor",
            self.shape().1,
            right.nrows(),
        )?;
        Self::new(
            self.basis.clone(),
            self.coefficients.iter().map(|t| left * t * right).collect(),
        )
    }
}
