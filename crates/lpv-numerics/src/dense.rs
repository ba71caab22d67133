//! Dense factorisations, all sequential: the number of threads must not change the last bits.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::householder::{
    apply_block_householder_sequence_on_the_left_in_place_scratch as apply_scratch,
    apply_block_householder_sequence_on_the_left_in_place_with_conj as apply,
};
use faer::linalg::qr::{col_pivoting, no_pivoting};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::linalg::triangular_inverse::invert_upper_triangular;
use faer::{Conj, Mat, MatMut, MatRef, Par, Spec};
use lpv_core::CoreError;
use nalgebra::{DMatrix, DMatrixViewMut, DVector, Dyn, U1};
use num_complex::Complex;

/// Columns of one blocked Householder step.
const PANEL: usize = 16;

/// Up to so many columns one reflector after the other is faster than blocks of them.
const NARROW: usize = 100;

/// The triangular factor of a tall matrix that arrives in blocks of rows: orthogonal transformations only, since the
/// weights span decades and normal equations would square them. Memory is that of one block.
pub struct Triangle {
    columns: usize,
    /// Rows of the storage: those of R, then those of one block.
    stride: usize,
    /// Column-major, `stride x columns`. Below the diagonal of R stand zeros between blocks.
    work: Vec<f64>,
    coefficients: Mat<f64>,
    scratch: MemBuffer,
    factorisations: usize,
}

impl Triangle {
    /// For blocks of up to so many rows.
    pub fn new(columns: usize, block_rows: usize) -> Self {
        let stride = columns + block_rows;
        let panel = if columns > NARROW { PANEL } else { 1 };
        let scratch = no_pivoting::factor::qr_in_place_scratch::<f64>(
            stride,
            columns,
            panel,
            Par::Seq,
            Spec::default(),
        );
        Self {
            columns,
            stride,
            work: vec![0.0; stride * columns],
            coefficients: Mat::zeros(panel, columns),
            scratch: MemBuffer::new(scratch),
            factorisations: 0,
        }
    }

    /// Factorisations so far.
    pub fn factorisations(&self) -> usize {
        self.factorisations
    }

    /// Rows that a block may have.
    pub fn block_rows(&self) -> usize {
        self.stride - self.columns
    }

    /// Column `j` of the next block, to be written from its first row on.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.work[j * self.stride + self.columns..(j + 1) * self.stride]
    }

    /// Complex values as column `j` of the next block: their real parts, then their imaginary parts.
    pub fn set_complex(&mut self, j: usize, values: impl ExactSizeIterator<Item = Complex<f64>>) {
        let count = values.len();
        let column = self.column_mut(j);
        for (k, value) in values.enumerate() {
            (column[k], column[count + k]) = (value.re, value.im);
        }
    }

    /// The first columns of the next block.
    pub fn block_mut(&mut self, rows: usize, columns: usize) -> DMatrixViewMut<'_, f64, U1, Dyn> {
        let from = &mut self.work[self.columns..];
        DMatrixViewMut::from_slice_with_strides_generic(from, Dyn(rows), Dyn(columns), U1, Dyn(self.stride))
    }

    /// Takes the first `rows` rows of the block into R.
    pub fn absorb(&mut self, rows: usize) {
        let (n, stride) = (self.columns, self.stride);
        no_pivoting::factor::qr_in_place(
            MatMut::from_column_major_slice_with_stride_mut(&mut self.work, n + rows, n, stride),
            self.coefficients.as_mut(),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        );
        self.factorisations += 1;
        // The reflectors stand below the diagonal.
        for j in 0..n {
            self.work[j * stride + j + 1..j * stride + n].fill(0.0);
        }
    }

    /// Column `j` of R; zero below the diagonal.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.work[j * self.stride..j * self.stride + self.columns]
    }

    /// R, square and upper triangular.
    pub fn factor(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.columns, self.columns, |i, j| self.work[j * self.stride + i])
    }
}

/// The triangular factor of blocks that stand on top of each other, all with the same number of columns.
pub fn triangle_of<'a>(
    columns: usize,
    blocks: impl Iterator<Item = &'a DMatrix<f64>> + Clone,
) -> DMatrix<f64> {
    let rows = blocks.clone().map(|b| b.nrows()).sum();
    let mut triangle = Triangle::new(columns, rows);
    for j in 0..columns {
        let column = triangle.column_mut(j);
        let mut at = 0;
        for block in blocks.clone() {
            column[at..at + block.nrows()].copy_from_slice(block.column(j).as_slice());
            at += block.nrows();
        }
    }
    triangle.absorb(rows);
    triangle.factor()
}

/// The triangular factor of `[M r]`: that of M, what r has in its range, and the length of the rest.
pub fn triangle_beside(matrix: &DMatrix<f64>, right: &DVector<f64>) -> DMatrix<f64> {
    let size = matrix.ncols();
    let mut both = DMatrix::zeros(matrix.nrows(), size + 1);
    both.columns_mut(0, size).copy_from(matrix);
    both.column_mut(size).copy_from(right);
    triangle_of(size + 1, std::iter::once(&both))
}

/// Orthonormal basis of the orthogonal complement of the columns, up to a relative tolerance on the pivots.
pub fn complement(columns: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let (m, n) = columns.shape();
    let size = m.min(n);
    if size == 0 || columns.amax() == 0.0 {
        return DMatrix::identity(m, m);
    }
    let mut qr = Mat::from_fn(m, n, |i, j| columns[(i, j)]);
    let panel = PANEL.min(size);
    let mut coefficients = Mat::zeros(panel, size);
    let (mut forward, mut backward) = (vec![0_usize; n], vec![0_usize; n]);
    let scratch =
        col_pivoting::factor::qr_in_place_scratch::<usize, f64>(m, n, panel, Par::Seq, Spec::default());
    col_pivoting::factor::qr_in_place(
        qr.as_mut(),
        coefficients.as_mut(),
        &mut forward,
        &mut backward,
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Spec::default(),
    );
    let largest = qr[(0, 0)].abs();
    let rank = (0..size)
        .take_while(|&i| qr[(i, i)].abs() > tolerance * largest)
        .count();
    // Q times the last columns of the identity. All reflectors take part, so that Q is orthogonal whatever the rank.
    let mut basis = DMatrix::zeros(m, m - rank);
    for j in 0..m - rank {
        basis[(rank + j, j)] = 1.0;
    }
    let scratch = apply_scratch::<f64>(m, panel, m - rank);
    apply(
        qr.as_ref().subcols(0, size),
        coefficients.as_ref(),
        Conj::No,
        MatMut::from_column_major_slice_mut(basis.as_mut_slice(), m, m - rank),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
    );
    basis
}

/// Singular values, decreasing, and right singular vectors (columns) of a matrix with at least as many rows as columns.
///
/// # Errors
/// [`CoreError::NoConvergence`].
pub fn right_singular(m: &DMatrix<f64>) -> Result<(DVector<f64>, DMatrix<f64>), CoreError> {
    let (rows, columns) = m.shape();
    let size = rows.min(columns);
    let mut values = faer::diag::Diag::<f64>::zeros(size);
    let mut vectors = DMatrix::zeros(columns, columns);
    if columns == 0 {
        return Ok((DVector::zeros(0), vectors));
    }
    let (no, full) = (ComputeSvdVectors::No, ComputeSvdVectors::Full);
    let scratch = svd_scratch::<f64>(rows, columns, no, full, Par::Seq, Spec::default());
    svd(
        MatRef::from_column_major_slice(m.as_slice(), rows, columns),
        values.as_mut(),
        None,
        Some(MatMut::from_column_major_slice_mut(
            vectors.as_mut_slice(),
            columns,
            columns,
        )),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Spec::default(),
    )
    .map_err(|_| CoreError::NoConvergence {
        operation: "a singular value decomposition",
    })?;
    // Rows that are missing have singular values of zero.
    let all = DVector::from_fn(columns, |i, _| if i < size { values[i] } else { 0.0 });
    Ok((all, vectors))
}

/// Back-substitution; `None` where the diagonal has a zero.
pub fn solve_upper(r: &DMatrix<f64>, rhs: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if r.is_empty() {
        return Some(DMatrix::zeros(r.ncols(), rhs.ncols()));
    }
    r.solve_upper_triangular(rhs)
}

/// `R^-1`; `None` where the diagonal has a zero.
pub fn invert_upper(r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = r.nrows();
    if r.diagonal().iter().any(|d| *d == 0.0) {
        return None;
    }
    let mut inverse = DMatrix::zeros(n, n);
    let out = MatMut::from_column_major_slice_mut(inverse.as_mut_slice(), n, n);
    let r = MatRef::from_column_major_slice(r.as_slice(), n, n);
    invert_upper_triangular(out, r, Par::Seq);
    Some(inverse)
}

#[cfg(test)]
mod tests;
