//! The few matrix routines that the models need: Schur form, eigenvalues with balancing, Gramians, finite checks.

mod balance;
mod decompositions;
mod order;
mod schur;

use crate::CoreError;
pub use balance::balanced;
pub use decompositions::{least_squares, pseudo_inverse, svd, symmetric_eigen};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
pub(crate) use order::Order;
use order::components;
use schur::on_the_diagonal;
pub use schur::real_schur;
use std::ops::Range;

/// Eigenvalues of a real square matrix, sorted by real part and then by imaginary part.
///
/// States are ordered first so that the matrix is as triangular as a permutation makes it, and those that reach each other both ways are
/// taken by themselves: a nilpotent matrix of that form has eigenvalues of exactly zero and not the `n`-th root of the rounding error.
/// Each such block is balanced: without it, badly scaled companion and mechanical matrices lose many digits.
///
/// # Errors
/// [`CoreError::Dimension`] if it is not square, [`CoreError::NotFinite`] if an entry or an eigenvalue is not finite,
/// [`CoreError::NoConvergence`].
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, CoreError> {
    square("eigenvalues: matrix", matrix)?;
    finite("eigenvalues: matrix", matrix)?;
    if matrix.is_empty() {
        return Ok(Vec::new());
    }
    let mut values = Vec::with_capacity(matrix.nrows());
    for block in components(matrix) {
        let mut own = match block.len() == matrix.nrows() {
            true => matrix.clone(),
            false => matrix.select_rows(&block).select_columns(&block),
        };
        balance(&mut own, &(0..block.len()), |_, _| ());
        // One state, or two, are in Schur form.
        if block.len() > 2 {
            own = real_schur(&own)?.1;
        }
        values.extend(on_the_diagonal(&own));
        if !values.iter().all(|l| l.is_finite()) {
            let (row, column) = (block[0], block[0]);
            return Err(CoreError::NotFinite {
                what: "eigenvalues",
                row,
                column,
            });
        }
    }
    values.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    Ok(values)
}

/// Scales states that reach each other by powers of two, so that nothing is rounded, until their rows and columns have like norms among
/// themselves \[parlett1969\]; `also` scales what else belongs to a state: columns by the factor, rows by one over it.
///
/// The sweeps are limited, since extreme entries underflow and would keep the loop going for ever.
pub(crate) fn balance(a: &mut DMatrix<f64>, block: &Range<usize>, mut also: impl FnMut(usize, f64)) {
    let others = |i: usize| block.clone().filter(move |j| *j != i);
    for _ in 0..100 {
        let mut changed = false;
        for i in block.clone() {
            let row: f64 = others(i).map(|j| a[(i, j)].abs()).sum();
            let column: f64 = others(i).map(|j| a[(j, i)].abs()).sum();
            if row < f64::MIN_POSITIVE || column < f64::MIN_POSITIVE {
                continue;
            }
            let factor = (0.5 * (row / column).log2()).round().clamp(-300.0, 300.0).exp2();
            if column * factor + row / factor < 0.95 * (column + row) {
                a.column_mut(i).scale_mut(factor);
                a.row_mut(i).unscale_mut(factor);
                also(i, factor);
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
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
pub fn column_space(matrix: &DMatrix<f64>, relative_tolerance: f64) -> DMatrix<f64> {
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
pub fn block_diagonal(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
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
