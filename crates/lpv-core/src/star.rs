//! The Redheffer star product of partitioned matrices.

use crate::CoreError;
use crate::linalg::{dimension, finite};
use nalgebra::DMatrix;

/// A matrix in two by two blocks: `[z; y] = [m11 m12; m21 m22] [w; u]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Partitioned {
    /// From w to z.
    pub m11: DMatrix<f64>,
    /// From u to z.
    pub m12: DMatrix<f64>,
    /// From w to y.
    pub m21: DMatrix<f64>,
    /// From u to y.
    pub m22: DMatrix<f64>,
}

impl Partitioned {
    /// `self * lower`: the lower channel of `self` (output y, input u) is closed with the upper channel of `lower`
    /// (Zhou, Doyle, Glover, Robust and Optimal Control, 10.4).
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`]; [`CoreError::Singular`] if the loop is not well-posed.
    pub fn star(&self, lower: &Self) -> Result<Self, CoreError> {
        for (what, m) in [
            ("star product: m11", &self.m11),
            ("star product: m12", &self.m12),
            ("star product: m21", &self.m21),
            ("star product: m22", &self.m22),
            ("star product: lower m11", &lower.m11),
            ("star product: lower m12", &lower.m12),
            ("star product: lower m21", &lower.m21),
            ("star product: lower m22", &lower.m22),
        ] {
            finite(what, m)?;
        }
        dimension("star product: rows of m12", self.m11.nrows(), self.m12.nrows())?;
        dimension("star product: columns of m21", self.m11.ncols(), self.m21.ncols())?;
        dimension("star product: rows of m22", self.m21.nrows(), self.m22.nrows())?;
        dimension("star product: columns of m22", self.m12.ncols(), self.m22.ncols())?;
        dimension(
            "star product: inputs of the lower matrix",
            self.m22.nrows(),
            lower.m11.ncols(),
        )?;
        dimension(
            "star product: outputs of the lower matrix",
            self.m22.ncols(),
            lower.m11.nrows(),
        )?;
        dimension(
            "star product: rows of the lower m12",
            lower.m11.nrows(),
            lower.m12.nrows(),
        )?;
        dimension(
            "star product: columns of the lower m21",
            lower.m11.ncols(),
            lower.m21.ncols(),
        )?;
        dimension(
            "star product: rows of the lower m22",
            lower.m21.nrows(),
            lower.m22.nrows(),
        )?;
        dimension(
            "star product: columns of the lower m22",
            lower.m12.ncols(),
            lower.m22.ncols(),
        )?;
        let (p, q) = (self, lower);
        let k = p.m22.nrows();
        let singular = CoreError::Singular {
            operation: "the star product",
        };
        let loop_gap = DMatrix::identity(k, k) - &p.m22 * &q.m11;
        let inverse = loop_gap.try_inverse().ok_or(singular)?;
        // v = inverse (P21 w + P22 Q12 u2): the signal that enters the lower matrix.
        let v_w = &inverse * &p.m21;
        let v_u = &inverse * &p.m22 * &q.m12;
        Ok(Self {
            m11: &p.m11 + &p.m12 * &q.m11 * &v_w,
            m12: &p.m12 * (&q.m12 + &q.m11 * &v_u),
            m21: &q.m21 * v_w,
            m22: &q.m22 + &q.m21 * v_u,
        })
    }
}
