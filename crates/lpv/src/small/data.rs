//! Responses as the data of a fit, and what their noise leaves of it.

use lfr_fit::{FitError, FrozenData};
use lpv_core::{Discrete, FrfEstimate};

/// Rms residuals that noise alone leaves, where its covariance is estimated with `nu` degrees of freedom: on single lines
/// `nu / (nu - n_y)`, the mean of the inverse of the estimate, and on lines that are merged from many
/// `nu^2 / ((nu - n_y)^2 - 1)`, since lines of an inverse that is too large weigh more than they should (moments of the complex
/// inverse Wishart distribution \[maiwald2000\]); the square roots of the medians.
pub(super) fn expected_residuals(estimates: &[FrfEstimate]) -> [f64; 2] {
    let median = |factor: fn(f64, f64) -> f64| {
        let factors = estimates.iter().map(|e| {
            let (nu, left) = (
                e.degrees_of_freedom(),
                e.degrees_of_freedom() - e.frf().outputs() as f64,
            );
            // Infinite where the covariance is known.
            if left > 0.0 && nu.is_finite() {
                factor(nu, left).sqrt()
            } else {
                1.0
            }
        });
        lpv_numerics::statistics::median(&factors.collect::<Vec<_>>())
    };
    let single = |nu: f64, left: f64| nu / left;
    let merged = |nu: f64, left: f64| {
        if left > 1.0 {
            nu * nu / (left * left - 1.0)
        } else {
            nu / left
        }
    };
    [median(single), median(merged)]
}

/// Weighted by the covariance, and by the part of the response that noise does not explain; by the size of the responses where they have no noise.
pub(super) fn frozen_data(
    estimates: &[FrfEstimate],
    positions: &[f64],
    clock: Discrete,
    relative_error: f64,
) -> Result<FrozenData, FitError> {
    let at = |i: usize| vec![positions[i]];
    let weighted: Vec<_> = estimates
        .iter()
        .enumerate()
        .map(|(i, e)| (at(i), e.clone()))
        .collect();
    match FrozenData::weighted(clock, &weighted, relative_error) {
        Err(FitError::Line { .. }) => {
            let plain: Vec<_> = estimates
                .iter()
                .enumerate()
                .map(|(i, e)| (at(i), e.frf().clone()))
                .collect();
            FrozenData::relative(clock, &plain)
        }
        other => other,
    }
}
