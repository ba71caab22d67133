//! The few matrix routines that the models need: eigenvalues with balancing, Gramians, finite checks.

use crate::CoreError;
use nalgebra::{DMatrix, DVector, Schur};
use num_complex::Complex;

/// Eigenvalues of a real square matrix, sorted by real part and then by imaginary part.
///
/// The matrix is balanced first: without it, badly scaled companion and mechanical matrices lose many digits.
///
/// Rows and columns that a permutation brings to triangular form are taken off before that, so that a nilpotent matrix
/// of that form has eigenvalues of exactly zero and not the `n`-th root of the rounding error.
///
/// # Errors
/// [`CoreError::Dimension`] if it is not square, [`CoreError::NotFinite`] if an entry is not finite,
/// [`CoreError::NoConvergence`].
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, CoreError> {
    square("eigenvalues: matrix", matrix)?;
    finite("eigenvalues: matrix", matrix)?;
    if matrix.is_empty() {
        return Ok(Vec::new());
    }
    let scale = matrix.amax();
    if scale == 0.0 {
        return Ok(vec![Complex::new(0.0, 0.0); matrix.nrows()]);
    }
    let (rest, mut values) = isolated(&(matrix / scale));
    if !rest.is_empty() {
        let iterations = 100 * rest.nrows().max(10);
        let schur =
            Schur::try_new(balanced(rest), f64::EPSILON, iterations).ok_or(CoreError::NoConvergence {
                operation: "the QR iteration for eigenvalues",
            })?;
        values.extend(schur.complex_eigenvalues().iter());
    }
    values.iter_mut().for_each(|l| *l *= scale);
    values.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    Ok(values)
}

/// The part of a matrix that no permutation makes triangular, and the eigenvalues of the rest, which are diagonal
/// entries: a row or a column without entries off the diagonal is taken off, and again.
fn isolated(m: &DMatrix<f64>) -> (DMatrix<f64>, Vec<Complex<f64>>) {
    let mut left: Vec<usize> = (0..m.nrows()).collect();
    let mut values = Vec::new();
    while let Some(at) = left.iter().position(|&i| {
        let others = || left.iter().filter(move |&&j| j != i);
        others().all(|&j| m[(i, j)] == 0.0) || others().all(|&j| m[(j, i)] == 0.0)
    }) {
        let i = left.remove(at);
        values.push(Complex::new(m[(i, i)], 0.0));
    }
    (m.select_rows(&left).select_columns(&left), values)
}

/// Similarity by powers of two that brings the norms of row and column `i` together (Parlett and Reinsch, 1969). The
/// sweeps are limited, since extreme entries underflow and would keep the loop going for ever.
fn balanced(mut m: DMatrix<f64>) -> DMatrix<f64> {
    let n = m.nrows();
    for _ in 0..100 {
        let mut changed = false;
        for i in 0..n {
            let sum = |v: &mut dyn Iterator<Item = f64>| v.map(f64::abs).sum::<f64>();
            let column = sum(&mut (0..n).filter(|&j| j != i).map(|j| m[(j, i)]));
            let row = sum(&mut (0..n).filter(|&j| j != i).map(|j| m[(i, j)]));
            if column < f64::MIN_POSITIVE || row < f64::MIN_POSITIVE {
                continue;
            }
            let f = (0.5 * (row / column).log2()).round().clamp(-300.0, 300.0).exp2();
            if column * f + row / f < 0.95 * (column + row) {
                m.column_mut(i).scale_mut(f);
                m.row_mut(i).unscale_mut(f);
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    m
}

/// Controllability Gramian `X = A X A^T + B B^T` of a stable discrete system, by Smith's doubling.
///
/// # Errors
/// [`CoreError::Unstable`] if an eigenvalue of `a` is on or outside the unit circle; [`CoreError::Dimension`];
/// [`CoreError::NotFinite`], also if the Gramian overflows.
pub fn discrete_gramian(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, CoreError> {
    square("gramian: A", a)?;
    dimension("gramian: rows of B", a.nrows(), b.nrows())?;
    finite("gramian: B", b)?;
    if let Some(pole) = eigenvalues(a)?.into_iter().find(|z| z.norm() >= 1.0) {
        return Err(CoreError::Unstable {
            operation: "a Gramian",
            pole: pole.to_string(),
        });
    }
    let mut x = b * b.transpose();
    let mut power = a.clone();
    for _ in 0..64 {
        let increment = &power * &x * power.transpose();
        let converged = increment.norm() <= f64::EPSILON * x.norm();
        x += increment;
        if converged {
            break;
        }
        power = &power * &power;
    }
    finite("gramian", &x)?;
    Ok(x)
}

pub(crate) fn finite(what: &'static str, matrix: &DMatrix<f64>) -> Result<(), CoreError> {
    match matrix.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(i) => Err(CoreError::NotFinite {
            what,
            row: i % matrix.nrows(),
            column: i / matrix.nrows(),
        }),
    }
}

pub(crate) fn finite_vector(what: &'static str, vector: &DVector<f64>) -> Result<(), CoreError> {
    match vector.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(row) => Err(CoreError::NotFinite { what, row, column: 0 }),
    }
}

/// Refuses a number that is not the expected one.
///
/// # Errors
/// [`CoreError::Dimension`].
pub fn dimension(what: &'static str, expected: usize, found: usize) -> Result<(), CoreError> {
    if expected == found {
        Ok(())
    } else {
        Err(CoreError::Dimension {
            what,
            expected,
            found,
        })
    }
}

pub(crate) fn square(what: &'static str, matrix: &DMatrix<f64>) -> Result<(), CoreError> {
    dimension(what, matrix.nrows(), matrix.ncols())
}

/// Orthonormal basis of the column space, up to a relative tolerance on the singular values.
pub(crate) fn column_space(matrix: &DMatrix<f64>, relative_tolerance: f64) -> DMatrix<f64> {
    if matrix.is_empty() || matrix.amax() == 0.0 {
        return DMatrix::zeros(matrix.nrows(), 0);
    }
    // Pivoted QR: its Q is orthonormal to rounding whatever the matrix, which the recurrences rely on.
    let qr = matrix.clone().col_piv_qr();
    let r = qr.r();
    let largest = r[(0, 0)].abs();
    let rank = (0..r.nrows().min(r.ncols()))
        .take_while(|&i| r[(i, i)].abs() > relative_tolerance * largest)
        .count();
    qr.q().columns(0, rank).into_owned()
}

/// The matrix with another placed at its lower right, zeros elsewhere.
pub(crate) fn block_diagonal(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(a.nrows() + b.nrows(), a.ncols() + b.ncols());
    m.view_mut((0, 0), a.shape()).copy_from(a);
    m.view_mut(a.shape(), b.shape()).copy_from(b);
    m
}

/// A matrix from a grid of blocks; the blocks of a row share their height and those of a column their width.
///
/// # Errors
/// [`CoreError::Dimension`] where they do not.
pub fn from_blocks(rows: &[&[&DMatrix<f64>]]) -> Result<DMatrix<f64>, CoreError> {
    let widths: Vec<usize> = rows
        .first()
        .map_or_else(Vec::new, |r| r.iter().map(|b| b.ncols()).collect());
    let height = rows.iter().map(|r| r.first().map_or(0, |b| b.nrows())).sum();
    let mut m = DMatrix::zeros(height, widths.iter().sum());
    let mut top = 0;
    for row in rows {
        dimension("blocks in a row", widths.len(), row.len())?;
        let row_height = row.first().map_or(0, |b| b.nrows());
        let mut left = 0;
        for (block, &width) in row.iter().zip(&widths) {
            dimension("height of a block", row_height, block.nrows())?;
            dimension("width of a block", width, block.ncols())?;
            m.view_mut((top, left), block.shape()).copy_from(block);
            left += width;
        }
        top += row_height;
    }
    Ok(m)
}
