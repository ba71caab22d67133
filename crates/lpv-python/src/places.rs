//! Frequency responses with the covariance of their errors, as arrays and back.

use crate::arrays::{C64, blocks, response};
use crate::error::core_error;
use lpv::lpv_core::{Frf, FrfEstimate, Position};
use numpy::{PyArray1, PyArray3, PyReadonlyArray1, PyReadonlyArray3};
use pyo3::prelude::*;

/// Position, frequencies, response, covariance of the outputs, factor of the inputs, degrees of freedom.
pub(crate) type PlaceTuple<'py> = (
    Option<Vec<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray3<C64>>,
    Bound<'py, PyArray3<C64>>,
    Bound<'py, PyArray3<C64>>,
    f64,
);

/// The same as it comes from Python.
pub(crate) type PlaceArguments<'py> = (
    Option<Vec<f64>>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray3<'py, C64>,
    PyReadonlyArray3<'py, C64>,
    PyReadonlyArray3<'py, C64>,
    f64,
);

/// The response at one place.
pub(crate) fn places<'py>(py: Python<'py>, e: &FrfEstimate) -> PyResult<PlaceTuple<'py>> {
    let frf = e.frf();
    let (lines, outputs, inputs) = (frf.len(), frf.outputs(), frf.inputs());
    Ok((
        e.position().map(|p| p.to_vec()),
        PyArray1::from_slice(py, frf.frequencies_hz()),
        response(py, frf)?,
        blocks(py, e.output_covariances(), [lines, outputs, outputs])?,
        blocks(py, e.input_factors(), [lines, inputs, inputs])?,
        e.degrees_of_freedom(),
    ))
}

/// The response at one place from its arrays.
pub(crate) fn to_estimate(py: Python<'_>, place: &PlaceArguments<'_>) -> PyResult<FrfEstimate> {
    let (position, frequencies, response, outputs, inputs, freedom) = place;
    let [_, ny, nu] = shape(response);
    let frequencies: Vec<f64> = frequencies.as_array().iter().copied().collect();
    let position = position.clone().map(Position::from);
    Frf::new(frequencies, ny, nu, by_columns(response))
        .and_then(|frf| FrfEstimate::new(frf, by_columns(outputs), by_columns(inputs), *freedom, position))
        .map_err(|e| core_error(py, e))
}

fn shape(array: &PyReadonlyArray3<'_, C64>) -> [usize; 3] {
    let (a, b, c) = array.as_array().dim();
    [a, b, c]
}

/// Lines x rows x columns in the order of lpv-core: line after line, column by column.
fn by_columns(array: &PyReadonlyArray3<'_, C64>) -> Vec<C64> {
    let [lines, rows, columns] = shape(array);
    let view = array.as_array();
    (0..lines)
        .flat_map(|k| (0..columns).flat_map(move |j| (0..rows).map(move |i| view[[k, i, j]])))
        .collect()
}
