//! The triangular factor of a tall matrix that arrives in blocks of rows.

use faer::Mat;
use nalgebra::DMatrix;

/// Rows that are gathered before each factorisation: large enough for blocked Householder steps, small enough for the
/// cache.
const BLOCK_ROWS: usize = 2048;

/// `R` of the QR factorisation of all rows pushed so far: orthogonal transformations only, since the weights span
/// decades and normal equations would square them.
pub(crate) struct Triangle {
    columns: usize,
    work: Mat<f64>,
    filled: usize,
    /// Factorisations made, the unit of work that tests count.
    pub(crate) factorisations: usize,
}

impl Triangle {
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns,
            work: Mat::zeros(columns + BLOCK_ROWS, columns),
            filled: columns,
            factorisations: 0,
        }
    }

    /// Reserves `rows` further rows, zeroed; the closure writes entry `(row, column)` of them.
    pub(crate) fn push(&mut self, rows: usize, write: impl FnOnce(&mut dyn FnMut(usize, usize, f64))) {
        if self.filled + rows > self.work.nrows() {
            self.reduce();
        }
        let (work, top) = (&mut self.work, self.filled);
        write(&mut |row, column, value| work[(top + row, column)] = value);
        self.filled += rows;
    }

    fn reduce(&mut self) {
        let r = self.work.subrows(0, self.filled).qr().thin_R().to_owned();
        self.factorisations += 1;
        self.work.fill(0.0);
        let columns = self.columns;
        self.work
            .subrows_mut(0, columns)
            .subcols_mut(0, columns)
            .copy_from(&r);
        self.filled = columns;
    }

    /// The triangular factor, `columns x columns`.
    pub(crate) fn finish(mut self) -> (DMatrix<f64>, usize) {
        self.reduce();
        let n = self.columns;
        let r = DMatrix::from_fn(n, n, |i, j| if i <= j { self.work[(i, j)] } else { 0.0 });
        (r, self.factorisations)
    }
}
