//! The covariance of an FRF that a truncated basis is to fit: noise, and what the basis cannot represent.

use lpv_core::{CoreError, FrfEstimate};
use num_complex::Complex;
use std::borrow::Cow;

/// The estimate with `(relative ||F_i||)^2` added to the variance of each row i of F, spread over its channels as
/// the noise is: `C_ii` grows by that over `tr(S)`.
pub(crate) fn with_model_error(
    estimate: &FrfEstimate,
    relative: f64,
) -> Result<Cow<'_, FrfEstimate>, CoreError> {
    if relative == 0.0 {
        return Ok(Cow::Borrowed(estimate));
    }
    let frf = estimate.frf();
    let (ny, nu) = (frf.outputs(), frf.inputs());
    let mut covariance: Vec<Complex<f64>> = Vec::with_capacity(frf.len() * ny * ny);
    let mut factor: Vec<Complex<f64>> = Vec::with_capacity(frf.len() * nu * nu);
    for k in 0..frf.len() {
        let s = estimate.input_factor(k);
        let trace = s.trace().re;
        let first = covariance.len();
        covariance.extend(estimate.output_covariance(k).iter());
        for (i, row) in frf.line(k).row_iter().enumerate() {
            covariance[first + i * (ny + 1)] += relative.powi(2) * row.norm_squared() / trace;
        }
        factor.extend(s.iter());
    }
    let dof = estimate.degrees_of_freedom();
    FrfEstimate::new(frf.clone(), covariance, factor, dof, estimate.position()).map(Cow::Owned)
}
