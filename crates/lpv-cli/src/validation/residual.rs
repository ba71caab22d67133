//! What is left in the residuals: whiteness, and correlation with the inputs.

use lpv_core::nalgebra::DMatrix;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Lags that are tested.
const LAGS: usize = 25;

/// Two-sided 99 % quantile of the normal distribution.
const QUANTILE_99: f64 = 2.575_829_303_548_900_4;

/// Autocorrelation of the one-step residual of one output (Ljung, System Identification, 2nd ed., sec. 16.6).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Whiteness {
    /// The output.
    pub output: String,
    /// Normalised autocorrelation at lags 1, 2, ...
    pub autocorrelation: Vec<f64>,
    /// A white residual stays within plus and minus this at each lag with 99 % probability.
    pub bound_99: f64,
    /// Part of the lags outside.
    pub outside: f64,
    /// Probability that a white residual has correlations as large in sum (Ljung and Box).
    pub p_value: f64,
}

/// Correlation of the one-step residual of one output with one input at lags 0, 1, ... (the input before the residual).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrossCorrelation {
    /// The output.
    pub output: String,
    /// The input.
    pub input: String,
    /// Normalised cross-correlation.
    pub correlation: Vec<f64>,
    /// Bound that all lags together keep with 99 % probability, with the colour of both signals taken into account (Bartlett).
    pub bound_99: f64,
    /// Part of the lags outside.
    pub outside: f64,
}

pub(super) fn whiteness(output: &str, residual: &[f64]) -> Whiteness {
    let n = residual.len() as f64;
    let autocorrelation = autocorrelation(residual, LAGS);
    let bound_99 = QUANTILE_99 / n.sqrt();
    let sum: f64 = autocorrelation
        .iter()
        .enumerate()
        .map(|(k, r)| r * r / (n - k as f64 - 1.0).max(1.0))
        .sum();
    let p_value = ChiSquared::new(autocorrelation.len().max(1) as f64)
        .map_or(f64::NAN, |chi| chi.sf(n * (n + 2.0) * sum));
    Whiteness {
        output: output.to_owned(),
        outside: outside(&autocorrelation, bound_99),
        autocorrelation,
        bound_99,
        p_value,
    }
}

pub(super) fn cross_correlation(output: &str, residual: &[f64], input: &str, u: &[f64]) -> CrossCorrelation {
    let n = residual.len().min(u.len());
    let lags = LAGS.min(n.saturating_sub(1));
    let (e, u) = (centred(&residual[..n]), centred(&u[..n]));
    let size = (power(&e) * power(&u)).sqrt();
    let correlation: Vec<f64> = (0..=lags)
        .map(|k| {
            let sum: f64 = e[k..].iter().zip(&u).map(|(e, u)| e * u).sum();
            if size > 0.0 { sum / size } else { 0.0 }
        })
        .collect();
    // Bartlett: the variance of the estimate is the sum over lags of the product of both autocorrelations, over N.
    let (re, ru) = (autocorrelation(&e, lags), autocorrelation(&u, lags));
    let spread = 1.0 + 2.0 * re.iter().zip(&ru).map(|(a, b)| a * b).sum::<f64>();
    // All lags together: each gets its share of the 1 %.
    let quantile = Normal::standard().inverse_cdf(1.0 - 0.005 / correlation.len().max(1) as f64);
    let bound_99 = quantile * (spread.max(0.1) / n.max(1) as f64).sqrt();
    CrossCorrelation {
        output: output.to_owned(),
        input: input.to_owned(),
        outside: outside(&correlation, bound_99),
        correlation,
        bound_99,
    }
}

/// Rows of a matrix as samples.
pub(super) fn rows(errors: &DMatrix<f64>) -> Vec<Vec<f64>> {
    errors.row_iter().map(|r| r.iter().copied().collect()).collect()
}

fn centred(x: &[f64]) -> Vec<f64> {
    let m = crate::signal::mean(x);
    x.iter().map(|v| v - m).collect()
}

fn power(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// Normalised autocorrelation at lags 1 to `lags`.
fn autocorrelation(x: &[f64], lags: usize) -> Vec<f64> {
    let x = centred(x);
    let zero = power(&x);
    (1..=lags.min(x.len().saturating_sub(1)))
        .map(|k| {
            let sum: f64 = x[k..].iter().zip(&x).map(|(a, b)| a * b).sum();
            if zero > 0.0 { sum / zero } else { 0.0 }
        })
        .collect()
}

fn outside(values: &[f64], bound: f64) -> f64 {
    values.iter().filter(|v| v.abs() > bound).count() as f64 / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal numbers from sums of a multiplicative generator, good enough for a test of levels.
    fn noise(n: usize, mut seed: u64) -> Vec<f64> {
        (0..n)
            .map(|_| {
                (0..12)
                    .map(|_| {
                        seed = seed
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        (seed >> 11) as f64 / (1u64 << 53) as f64
                    })
                    .sum::<f64>()
                    - 6.0
            })
            .collect()
    }

    #[test]
    fn white_noise_passes_at_its_level_and_colour_does_not() {
        let passes = (0..200)
            .filter(|s| whiteness("y", &noise(1000, s * 7919 + 1)).p_value > 0.01)
            .count();
        assert!((194..=200).contains(&passes), "{passes}");
        let e = noise(1000, 5);
        let coloured: Vec<f64> = (1..1000).map(|k| e[k] + 0.5 * e[k - 1]).collect();
        assert!(whiteness("y", &coloured).p_value < 1e-6);
    }

    #[test]
    fn an_input_that_still_shows_is_seen() {
        let (e, u) = (noise(2000, 3), noise(2000, 11));
        let clean = cross_correlation("y", &e, "u", &u);
        assert!(clean.outside < 0.1, "{clean:?}");
        let left: Vec<f64> = (0..2000)
            .map(|k| e[k] + if k >= 3 { 0.3 * u[k - 3] } else { 0.0 })
            .collect();
        let seen = cross_correlation("y", &left, "u", &u);
        assert!(seen.correlation[3] > 3.0 * seen.bound_99);
    }
}
