//! The weights of a regression as whitening factors.

use crate::{IdentError, RegressionSettings, Weighting};
use lpv_core::{FrfEstimate, Position};
use lpv_numerics::whiten::Whitening;
use std::ops::Range;

/// Computes the factors of a block of lines as the settings want them.
pub(crate) fn set(
    whitening: &mut Whitening,
    estimate: &FrfEstimate,
    lines: Range<usize>,
    settings: &RegressionSettings,
    position: &Position,
) -> Result<(), IdentError> {
    let frf = estimate.frf();
    match settings.weighting {
        Weighting::Uniform => Ok(()),
        Weighting::Relative => {
            for (row, line) in lines.enumerate() {
                let weight = 1.0 / frf.line(line).norm_squared();
                if !weight.is_finite() {
                    return Err(IdentError::NoResponse {
                        position: position.clone(),
                        line,
                        frequency_hz: frf.frequencies_hz()[line],
                    });
                }
                whitening.set_weight(row, weight);
            }
            Ok(())
        }
        Weighting::Covariance => whitening
            .set_covariance(estimate, lines, settings.model_error)
            .map_err(|line| IdentError::Covariance {
                position: position.clone(),
                line,
                frequency_hz: frf.frequencies_hz()[line],
            }),
    }
}
