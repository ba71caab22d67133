//! Confidence regions of an FRF entry.

use lpv_core::FrfEstimate;

/// Radius of the disc around entry `(output, input)` of line `line` that holds the true value with `probability`.
///
/// The error is circular complex normal with variance `C_V[ii] S[jj]`, and `C_V` is estimated with `nu` complex degrees
/// of freedom (`chi^2_{2 nu} / (2 nu)`), so `|dF_ij|^2 / (C_V[ii] S[jj])` is distributed as `F(2, 2 nu)`. See
/// [`f_quantile_2`]. The result is infinite where `nu` is zero, and NaN where the entry does not exist or the
/// probability is not within `[0, 1)`: a region that nobody can mistake for a small one.
pub fn confidence_radius(
    estimate: &FrfEstimate,
    line: usize,
    output: usize,
    input: usize,
    probability: f64,
) -> f64 {
    let frf = estimate.frf();
    let exists = line < frf.len() && output < frf.outputs() && input < frf.inputs();
    if !exists || !(0.0..1.0).contains(&probability) {
        return f64::NAN;
    }
    let variance = estimate.variance(line, output, input).max(0.0);
    let quantile = f_quantile_2(probability, estimate.degrees_of_freedom());
    if quantile.is_infinite() {
        return f64::INFINITY;
    }
    (variance * quantile).sqrt()
}

/// Quantile of the F distribution with 2 and `2 nu` degrees of freedom, which has a closed form:
/// `p = 1 - (1 + x / nu)^(-nu)`, hence `x = nu ((1 - p)^(-1/nu) - 1)`, and `-ln(1 - p)` for infinite `nu`.
///
/// NaN unless `0 <= p < 1` and `nu >= 0`; infinite for `nu = 0`.
pub fn f_quantile_2(probability: f64, nu: f64) -> f64 {
    if !(0.0..1.0).contains(&probability) || nu.is_nan() || nu < 0.0 {
        return f64::NAN;
    }
    // expm1 and ln_1p keep the digits for large nu, where the power is close to one.
    let log_tail = (-probability).ln_1p();
    if nu == 0.0 {
        f64::INFINITY
    } else if nu.is_infinite() {
        -log_tail
    } else {
        nu * (-log_tail / nu).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_tables() {
        // F(2, 10; 0.95) = 4.1028, F(2, 60; 0.95) = 3.1504, chi^2(2; 0.95) / 2 = 2.9957.
        assert!((f_quantile_2(0.95, 5.0) - 4.1028).abs() < 5e-5);
        assert!((f_quantile_2(0.95, 30.0) - 3.1504).abs() < 5e-5);
        assert!((f_quantile_2(0.95, f64::INFINITY) - 2.9957).abs() < 5e-5);
        assert!((f_quantile_2(0.95, 1e12) - 2.9957).abs() < 5e-5);
        assert_eq!(f_quantile_2(0.0, 3.0), 0.0);
        assert!(f_quantile_2(1.0, 3.0).is_nan());
    }
}
