//! The window around a line, and what both methods return from it.

use super::data::LocalData;
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// Diagonal ratio of `R` from which regressors count as dependent.
const MAX_CONDITION: f64 = 1e10;

/// Result at one line: `dG = V G` as in [`lpv_core::FrfEstimate`].
pub(crate) struct LocalFit {
    /// `n_z x n_x`.
    pub(crate) response: DMatrix<C64>,
    /// `C_V`, `n_z x n_z`.
    pub(crate) covariance: DMatrix<C64>,
    /// `S`, `n_x x n_x`.
    pub(crate) factor: DMatrix<C64>,
    pub(crate) condition: f64,
}

/// Regressors and responses of one window. Rows: lines within records.
pub(crate) struct Window<'a> {
    pub(crate) data: &'a LocalData,
    /// Offset of each row from the line, in half widths.
    pub(crate) r: Vec<f64>,
    /// `A`, rows by unknowns: `x_j r^s` for all `s` of each `j`, then `r^s` for each record.
    pub(crate) a: DMatrix<C64>,
    /// `Z^T`, rows by responses.
    pub(crate) z: DMatrix<C64>,
    degree: usize,
}

impl<'a> Window<'a> {
    /// The window around line `k`, shifted inwards at either end of the band.
    pub(crate) fn new(data: &'a LocalData, k: usize, half_width: usize, degree: usize) -> Self {
        let width = 2 * half_width + 1;
        let start = k.saturating_sub(half_width).clamp(1, data.lines + 1 - width);
        let rows = width * data.records;
        let at = |row: usize| (row / width, start + row % width);
        let r: Vec<f64> = (0..rows)
            .map(|row| (at(row).1 as f64 - k as f64) / half_width as f64)
            .collect();
        let powers = degree + 1;
        let a = DMatrix::from_fn(rows, (data.regressors + data.records) * powers, |row, column| {
            let (e, line) = at(row);
            let (block, s) = (column / powers, column % powers);
            let power = r[row].powi(s as i32);
            if block < data.regressors {
                data.x(e, block, line) * power
            } else {
                C64::new(if block - data.regressors == e { power } else { 0.0 }, 0.0)
            }
        });
        let z = DMatrix::from_fn(rows, data.responses, |row, i| {
            let (e, line) = at(row);
            data.z(e, i, line)
        });
        Self {
            data,
            r,
            a,
            z,
            degree,
        }
    }

    /// Column of `A` that belongs to the response to regressor `j` at the line itself.
    pub(crate) fn response_column(&self, j: usize) -> usize {
        j * (self.degree + 1)
    }
}

/// `A = Q R diag(scale)` with columns scaled to unit length, rows weighted.
pub(crate) struct Factorised {
    q: DMatrix<C64>,
    r_inverse: DMatrix<C64>,
    scale: Vec<f64>,
    pub(crate) condition: f64,
}

impl Factorised {
    /// Factorises; the error is the diagonal ratio of `R` where that is too large.
    pub(crate) fn new(mut a: DMatrix<C64>) -> Result<Self, f64> {
        let mut scale = Vec::with_capacity(a.ncols());
        for mut column in a.column_iter_mut() {
            let norm = column.norm();
            if !(norm.is_finite() && norm > 0.0) {
                return Err(f64::INFINITY);
            }
            column /= C64::new(norm, 0.0);
            scale.push(norm);
        }
        let n = a.ncols();
        let (q, r) = a.qr().unpack();
        let diagonal: Vec<f64> = (0..n).map(|i| r[(i, i)].norm()).collect();
        let largest = diagonal.iter().copied().fold(0.0, f64::max);
        let smallest = diagonal.iter().copied().fold(f64::INFINITY, f64::min);
        let condition = largest / smallest;
        if condition.is_nan() || condition > MAX_CONDITION {
            return Err(condition);
        }
        let mut r_inverse = DMatrix::identity(n, n);
        if !r.solve_upper_triangular_mut(&mut r_inverse) {
            return Err(f64::INFINITY);
        }
        Ok(Self {
            q,
            r_inverse,
            scale,
            condition,
        })
    }

    /// `Q^H B`.
    pub(crate) fn project(&self, b: &DMatrix<C64>) -> DMatrix<C64> {
        self.q.ad_mul(b)
    }

    /// `B - Q Q^H B`, given `Q^H B`.
    pub(crate) fn remainder(&self, b: &DMatrix<C64>, projected: &DMatrix<C64>) -> DMatrix<C64> {
        b - &self.q * projected
    }

    /// Rows `unknowns` of `A^+ B`, given `Q^H B`.
    pub(crate) fn solve_rows(&self, unknowns: &[usize], projected: &DMatrix<C64>) -> DMatrix<C64> {
        self.rows(unknowns) * projected
    }

    /// The block of `(A^H A)^-1` that belongs to `unknowns`.
    pub(crate) fn inverse_block(&self, unknowns: &[usize]) -> DMatrix<C64> {
        let rows = self.rows(unknowns);
        &rows * rows.adjoint()
    }

    fn rows(&self, unknowns: &[usize]) -> DMatrix<C64> {
        DMatrix::from_fn(unknowns.len(), self.scale.len(), |i, j| {
            self.r_inverse[(unknowns[i], j)] / self.scale[unknowns[i]]
        })
    }
}
