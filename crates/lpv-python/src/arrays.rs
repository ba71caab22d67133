//! Matrices, signals and responses as numpy arrays, and back.

use lpv::lpv_core::nalgebra::DMatrix;
use lpv::lpv_core::num_complex::Complex;
use lpv::lpv_core::{Frf, Signals};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

/// A complex number of numpy.
pub(crate) type C64 = Complex<f64>;

/// A matrix, rows first.
pub(crate) fn matrix<'py, T: Element + Copy>(
    py: Python<'py>,
    m: &DMatrix<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let rows: Vec<T> = (0..m.nrows())
        .flat_map(|i| (0..m.ncols()).map(move |j| m[(i, j)]))
        .collect();
    PyArray1::from_vec(py, rows).reshape([m.nrows(), m.ncols()])
}

/// The transpose of a matrix: one row a sample of what has one column a sample. The numbers lie in that order already.
pub(crate) fn samples<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, m.as_slice()).reshape([m.ncols(), m.nrows()])
}

/// Signals, samples x channels.
pub(crate) fn signals<'py>(py: Python<'py>, s: &Signals) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows: Vec<f64> = (0..s.len())
        .flat_map(|k| s.columns.iter().map(move |c| c[k]))
        .collect();
    PyArray1::from_vec(py, rows).reshape([s.len(), s.channels()])
}

/// Signals from samples x channels, with names of a letter and a number.
pub(crate) fn to_signals(letter: &str, array: &PyReadonlyArray2<'_, f64>) -> Signals {
    let columns: Vec<Vec<f64>> = array
        .as_array()
        .columns()
        .into_iter()
        .map(|c| c.iter().copied().collect())
        .collect();
    Signals {
        names: (1..=columns.len()).map(|i| format!("{letter}{i}")).collect(),
        units: Vec::new(),
        columns,
    }
}

/// A response, lines x outputs x inputs.
pub(crate) fn response<'py>(py: Python<'py>, frf: &Frf) -> PyResult<Bound<'py, PyArray3<C64>>> {
    blocks(py, frf.values(), [frf.len(), frf.outputs(), frf.inputs()])
}

/// Matrices that lie column by column, line after line, as lines x rows x columns.
pub(crate) fn blocks<'py>(
    py: Python<'py>,
    values: &[C64],
    [lines, rows, columns]: [usize; 3],
) -> PyResult<Bound<'py, PyArray3<C64>>> {
    let ordered: Vec<C64> = (0..lines)
        .flat_map(|k| {
            let line = &values[k * rows * columns..(k + 1) * rows * columns];
            (0..rows).flat_map(move |i| (0..columns).map(move |j| line[j * rows + i]))
        })
        .collect();
    PyArray1::from_vec(py, ordered).reshape([lines, rows, columns])
}
