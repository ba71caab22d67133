//! Linear equations, least squares and instruments, with the colour of the residual in the covariance.

use super::Estimator;
use crate::LtiIdentError;
use nalgebra::{DMatrix, DVector};

/// Parts of the rows whose scores are kept apart.
const PARTS: usize = 20;

/// `force = regressors * theta`.
pub(super) struct Rows {
    pub(super) regressors: DMatrix<f64>,
    pub(super) force: DVector<f64>,
}

#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub(super) theta: DVector<f64>,
    pub(super) deviations: DVector<f64>,
    pub(super) condition_number: f64,
    pub(super) relative_error_percent: f64,
    pub(super) effective_rows: f64,
}

/// `theta = (Z'W)^-1 Z'u` with instruments Z, which are the regressors W for least squares, and covariance `(Z'W)^-1 V (W'Z)^-1`, where V is that of the scores `Z'e`, summed over parts
/// of the data: sums over parts that are longer than the memory of the residual are independent.
pub(super) fn solve(rows: &Rows, instruments: &DMatrix<f64>) -> Result<Solution, LtiIdentError> {
    let (w, z) = (&rows.regressors, instruments);
    let (equations, unknowns) = w.shape();
    if equations < unknowns + PARTS {
        let what = "inverse dynamics";
        return Err(LtiIdentError::TooFewSamples {
            what,
            equations,
            unknowns: unknowns + PARTS,
        });
    }
    let singular = || LtiIdentError::Singular {
        what: "inverse dynamics",
    };
    // Columns of norm one: units differ by orders.
    let scale = DVector::from_fn(unknowns, |j, _| w.column(j).norm());
    let unit = DVector::from_fn(unknowns, |j, _| z.column(j).norm());
    if scale.iter().chain(unit.iter()).any(|s| !s.is_normal()) {
        return Err(singular());
    }
    let scaled =
        |m: &DMatrix<f64>, by: &DVector<f64>| DMatrix::from_fn(equations, unknowns, |i, j| m[(i, j)] / by[j]);
    let (w, z) = (scaled(w, &scale), scaled(z, &unit));
    let values = w.singular_values();
    let condition_number = values.max() / values.min();
    if condition_number.is_nan() || condition_number > 1e10 {
        return Err(singular());
    }
    let inverse = z.tr_mul(&w).try_inverse().ok_or_else(singular)?;
    let theta = &inverse * z.tr_mul(&rows.force);
    let residual = &rows.force - &w * &theta;
    let scores = DMatrix::from_columns(&part_sums(&z, &residual));
    let parts = scores.ncols() as f64;
    let covariance =
        &inverse * (&scores * scores.transpose()) * inverse.transpose() * (parts / (parts - unknowns as f64));
    let white = residual.norm_squared() / (equations - unknowns) as f64
        * &inverse
        * z.tr_mul(&z)
        * inverse.transpose();
    Ok(Solution {
        deviations: covariance.diagonal().map(f64::sqrt).component_div(&scale),
        theta: theta.component_div(&scale),
        condition_number,
        relative_error_percent: 100.0 * residual.norm() / rows.force.norm(),
        effective_rows: equations as f64 * white.trace() / covariance.trace().max(f64::MIN_POSITIVE),
    })
}

fn part_sums(z: &DMatrix<f64>, residual: &DVector<f64>) -> Vec<DVector<f64>> {
    let rows = z.nrows();
    let cut = |part: usize| rows * part / PARTS;
    let sum = |part: usize| {
        let (from, to) = (cut(part), cut(part + 1));
        z.rows(from, to - from).tr_mul(&residual.rows(from, to - from))
    };
    (0..PARTS).map(sum).collect()
}

/// Instruments win where they were asked for, or where they do not lose much: references that do not move the axis say
/// little about it.
pub(super) fn solution(
    rows: &Rows,
    instruments: Option<DMatrix<f64>>,
    asked: Estimator,
) -> Result<(Estimator, Solution), LtiIdentError> {
    const LARGEST_LOSS: f64 = 3.0;
    let by_instruments = instruments.map(|z| solve(rows, &z));
    if let (Some(result), Estimator::ReferenceInstruments) = (&by_instruments, asked) {
        return Ok((asked, result.clone()?));
    }
    let plain = solve(rows, &rows.regressors)?;
    match by_instruments {
        Some(Ok(found))
            if found.deviations[0] <= LARGEST_LOSS * plain.deviations[0]
                && (found.relative_error_percent < 100.0 || plain.relative_error_percent >= 100.0) =>
        {
            Ok((Estimator::ReferenceInstruments, found))
        }
        _ => Ok((Estimator::LeastSquares, plain)),
    }
}

/// The columns of all segments, one below the other.
pub(super) fn stacked(segments: &[Vec<Vec<f64>>]) -> DMatrix<f64> {
    let rows = segments.iter().map(|s| s[0].len()).sum();
    let columns = segments.first().map_or(0, Vec::len);
    let values = (0..columns).flat_map(|j| segments.iter().flat_map(move |s| s[j].iter().copied()));
    DMatrix::from_iterator(rows, columns, values)
}
