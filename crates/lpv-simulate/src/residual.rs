//! What is left in the residuals: whiteness, and correlation with the inputs.

use lpv_numerics::statistics::chi_squared_p_value;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

/// Lags that are tested.
const LAGS: usize = 25;

/// Two-sided 99 % quantile of the normal distribution.
const QUANTILE_99: f64 = 2.575_829_303_548_900_4;

/// Autocorrelation of the one-step residual of one output (Ljung, System Identification, 2nd ed., sec. 16.6), and its size: in a
/// long record the smallest colour is significant, and of no consequence.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// Part of the residual's power that its own past predicts (an autoregression over the lags, less what chance gives), 0 to 1.
    pub predictable: f64,
    /// Part of the residual's power that the inputs explain linearly (a finite impulse response over the lags, less what chance
    /// gives), 0 to 1.
    pub by_inputs: f64,
}

/// What is left is small where no more than this part of its power follows its own past ...
pub const SMALL_COLOUR: f64 = 0.1;

/// ... and no more than this part the inputs.
pub const SMALL_INPUT_SHARE: f64 = 0.05;

impl Whiteness {
    /// Whether significance or size says that the model leaves nothing to find.
    pub fn is_white(&self) -> bool {
        self.p_value > 0.01 || self.predictable <= SMALL_COLOUR
    }
}

/// Correlation of the one-step residual of one output with one input at lags 0, 1, ... (the input before the residual).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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

/// Tests the one-step residual of an output, and says how much of it the inputs and its own past explain.
pub fn whiteness(output: &str, residual: &[f64], inputs: &[&[f64]]) -> Whiteness {
    let n = residual.len() as f64;
    let autocorrelation = autocorrelation(residual, LAGS);
    let bound_99 = QUANTILE_99 / n.sqrt();
    let sum: f64 = autocorrelation
        .iter()
        .enumerate()
        .map(|(k, r)| r * r / (n - k as f64 - 1.0).max(1.0))
        .sum();
    let p_value = chi_squared_p_value(n * (n + 2.0) * sum, autocorrelation.len().max(1));
    Whiteness {
        output: output.to_owned(),
        outside: outside(&autocorrelation, bound_99),
        predictable: predictable(&autocorrelation, residual.len()),
        by_inputs: share_of_inputs(residual, inputs),
        autocorrelation,
        bound_99,
        p_value,
    }
}

/// The part of the power of a signal that its own past predicts.
pub fn predictable_share(signal: &[f64]) -> f64 {
    predictable(&autocorrelation(signal, LAGS), signal.len())
}

/// The part of the power that an autoregression over the given lags predicts (Levinson's recursion), adjusted for its parameters.
fn predictable(autocorrelation: &[f64], samples: usize) -> f64 {
    let mut left = 1.0;
    let mut predictor: Vec<f64> = Vec::new();
    for (k, r) in autocorrelation.iter().enumerate() {
        let known: f64 = predictor
            .iter()
            .zip(autocorrelation[..k].iter().rev())
            .map(|(a, r)| a * r)
            .sum();
        let reflection = (r - known) / left;
        let turned: Vec<f64> = predictor.iter().rev().map(|a| reflection * a).collect();
        predictor.iter_mut().zip(&turned).for_each(|(a, t)| *a -= t);
        predictor.push(reflection);
        left *= 1.0 - reflection * reflection;
        if left.is_nan() || left <= f64::EPSILON {
            return 1.0;
        }
    }
    adjusted(1.0 - left, autocorrelation.len(), samples)
}

/// The part of the power of a signal that finite impulse responses of the inputs over the lags explain, adjusted for their number;
/// over the last samples of a long record.
pub fn share_of_inputs(signal: &[f64], inputs: &[&[f64]]) -> f64 {
    /// Samples that tell a few percent.
    const ENOUGH: usize = 20_000;
    let all = inputs
        .iter()
        .map(|u| u.len())
        .min()
        .unwrap_or(0)
        .min(signal.len());
    let moving: Vec<Vec<f64>> = inputs
        .iter()
        .map(|u| centred(&u[..all]))
        .filter(|u| power(u) > 0.0)
        .collect();
    let lags = LAGS.min(all / 8);
    let (from, parameters) = (all.saturating_sub(ENOUGH).max(lags), moving.len() * (lags + 1));
    if parameters == 0 || all < from + 4 * parameters {
        return 0.0;
    }
    let e = centred(&signal[from..all]);
    let shifted =
        |u: &Vec<f64>, lag: usize| DVector::from_column_slice(&u[from - lag..all - lag]).normalize();
    let columns: Vec<DVector<f64>> = moving
        .iter()
        .flat_map(|u| (0..=lags).map(move |lag| shifted(u, lag)))
        .collect();
    let regressors = DMatrix::from_columns(&columns);
    let e = DVector::from_vec(e);
    let mut normal = regressors.tr_mul(&regressors);
    // Neighbouring lags of a smooth input are nearly dependent; what rounding decides explains nothing.
    const RIDGE: f64 = 1e-9;
    (0..parameters).for_each(|i| normal[(i, i)] += RIDGE);
    let right = regressors.tr_mul(&e);
    let Some(solution) = normal.cholesky().map(|c| c.solve(&right)) else {
        return 0.0;
    };
    let left = (&e - &regressors * solution).norm_squared() / e.norm_squared();
    if left.is_finite() {
        adjusted(1.0 - left, parameters, e.len())
    } else {
        0.0
    }
}

/// A share of power less what so many parameters explain by chance.
fn adjusted(share: f64, parameters: usize, samples: usize) -> f64 {
    let (n, p) = (samples as f64, parameters as f64);
    (1.0 - (1.0 - share) * (n - 1.0) / (n - p - 1.0).max(1.0)).clamp(0.0, 1.0)
}

/// Tests the one-step residual of an output against an input.
pub fn cross_correlation(output: &str, residual: &[f64], input: &str, u: &[f64]) -> CrossCorrelation {
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
pub fn rows(errors: &DMatrix<f64>) -> Vec<Vec<f64>> {
    errors.row_iter().map(|r| r.iter().copied().collect()).collect()
}

fn centred(x: &[f64]) -> Vec<f64> {
    let m = lpv_numerics::statistics::mean(x);
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
            .filter(|s| whiteness("y", &noise(1000, s * 7919 + 1), &[]).p_value > 0.01)
            .count();
        assert!((194..=200).contains(&passes), "{passes}");
        let e = noise(1000, 5);
        let coloured: Vec<f64> = (1..1000).map(|k| e[k] + 0.5 * e[k - 1]).collect();
        let found = whiteness("y", &coloured, &[]);
        assert!(found.p_value < 1e-6 && !found.is_white());
        // An innovation of variance 1 in a moving average of variance 1.25.
        assert!((found.predictable - 0.2).abs() < 0.05, "{}", found.predictable);
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
        let share = share_of_inputs(&left, &[&u]);
        assert!((share - 0.09 / 1.09).abs() < 0.03, "{share}");
        assert!(share_of_inputs(&e, &[&u]) < 0.01);
    }

    #[test]
    fn colour_without_size_is_white_enough() {
        let e = noise(100_000, 9);
        let coloured: Vec<f64> = (1..e.len()).map(|k| e[k] + 0.05 * e[k - 1]).collect();
        let found = whiteness("y", &coloured, &[]);
        assert!(
            found.p_value < 1e-6 && found.predictable < 0.01 && found.is_white(),
            "{found:?}"
        );
    }
}
