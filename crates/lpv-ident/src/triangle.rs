//! The triangular factor of a tall matrix that arrives in blocks of rows.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch};
use faer::linalg::triangular_inverse::invert_upper_triangular;
use faer::{Mat, MatMut, MatRef, Par, Spec};
use nalgebra::DMatrix;

/// Columns of one blocked Householder step.
const PANEL: usize = 16;

/// `R` of the QR factorisation of all blocks so far: orthogonal transformations only, for regressors that are so
/// nearly dependent that normal equations would lose them. Memory is that of one block, and nothing is allocated between blocks.
pub(crate) struct Triangle {
    columns: usize,
    /// Rows of the storage: those of `R`, then those of one block.
    stride: usize,
    /// Column-major, `stride x columns`. Below the diagonal of `R` stand zeros between blocks.
    work: Vec<f64>,
    coefficients: Mat<f64>,
    scratch: MemBuffer,
    factorisations: usize,
}

impl Triangle {
    pub(crate) fn new(columns: usize, block_rows: usize) -> Self {
        let stride = columns + block_rows;
        let panel = PANEL.min(columns).max(1);
        let scratch = qr_in_place_scratch::<f64>(stride, columns, panel, Par::Seq, Spec::default());
        Self {
            columns,
            stride,
            work: vec![0.0; stride * columns],
            coefficients: Mat::zeros(panel, columns),
            scratch: MemBuffer::new(scratch),
            factorisations: 0,
        }
    }

    /// How many there were.
    pub(crate) fn factorisations(&self) -> usize {
        self.factorisations
    }

    /// Rows that a block may have.
    pub(crate) fn block_rows(&self) -> usize {
        self.stride - self.columns
    }

    /// Column `j` of the next block, to be written from its first row on.
    pub(crate) fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.work[j * self.stride + self.columns..(j + 1) * self.stride]
    }

    /// Takes the first `rows` rows of the block into `R`.
    pub(crate) fn absorb(&mut self, rows: usize) {
        let (n, stride) = (self.columns, self.stride);
        let filled = MatMut::from_column_major_slice_with_stride_mut(&mut self.work, n + rows, n, stride);
        // Sequential, whatever is set globally: the number of threads must not change the last bits.
        qr_in_place(
            filled,
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

    /// Column `j` of `R`; zero below the diagonal.
    pub(crate) fn column(&self, j: usize) -> &[f64] {
        &self.work[j * self.stride..j * self.stride + self.columns]
    }
}

/// Back-substitution; `None` where the diagonal has a zero.
pub(crate) fn solve_upper(r: &DMatrix<f64>, rhs: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if r.is_empty() {
        return Some(DMatrix::zeros(r.ncols(), rhs.ncols()));
    }
    r.solve_upper_triangular(rhs)
}

/// `R^-1`; `None` where the diagonal has a zero.
pub(crate) fn invert_upper(r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
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
