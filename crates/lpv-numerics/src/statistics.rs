//! Figures of samples, p-values, decibels.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Smallest and largest value; (inf, -inf) for none.
pub fn range(x: &[f64]) -> (f64, f64) {
    x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| {
        (l.min(v), h.max(v))
    })
}

/// Mean; zero for none.
pub fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// Root mean square about the mean.
pub fn standard_deviation(x: &[f64]) -> f64 {
    let m = mean(x);
    (x.iter().map(|v| (v - m).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// The value below which the part `q` of the values lies, one of them; NaN for none.
pub fn quantile(x: &[f64], q: f64) -> f64 {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted
        .get((q * last as f64).round() as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

/// The middle value; NaN for none.
pub fn median(x: &[f64]) -> f64 {
    quantile(x, 0.5)
}

/// Probability that a chi-squared variable with so many degrees of freedom is at least as large; no less than the least number above
/// zero. A fall of twice the negative logarithm of the likelihood by so many parameters is one.
pub fn chi_squared_p_value(value: f64, degrees_of_freedom: usize) -> f64 {
    ChiSquared::new(degrees_of_freedom as f64).map_or(1.0, |d| d.sf(value.max(0.0)).max(f64::MIN_POSITIVE))
}

/// Decibels of a ratio of amplitudes, `20 log10`.
pub fn amplitude_db(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// Decibels of a ratio of powers, `10 log10`.
pub fn power_db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let x = [3.0, 1.0, 2.0, 10.0, 4.0];
        assert_eq!((range(&x), mean(&x), median(&x)), ((1.0, 10.0), 4.0, 3.0));
        assert_eq!(standard_deviation(&x), 10.0_f64.sqrt());
        assert_eq!((quantile(&x, 0.0), quantile(&x, 1.0)), (1.0, 10.0));
        assert!(median(&[]).is_nan());
        assert_eq!((amplitude_db(10.0), power_db(10.0)), (20.0, 10.0));
    }

    #[test]
    fn p_values_of_the_tables() {
        for (value, degrees, p) in [(3.841, 1, 0.05), (9.210, 2, 0.01), (18.307, 10, 0.05)] {
            assert!((chi_squared_p_value(value, degrees) - p).abs() < 1e-4);
        }
        assert_eq!(chi_squared_p_value(-3.0, 2), 1.0);
        assert!(chi_squared_p_value(1e6, 2) > 0.0);
    }
}
