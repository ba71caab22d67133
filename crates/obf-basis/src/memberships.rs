//! Fuzzy memberships and the power mean behind the fuzzy cost, in logarithms.

/// `ln mu_i` with `mu_i = 1 / sum_j (d_i / d_j)^(1/(m-1))` from `ln d_i`, in place.
///
/// A point that coincides with one or more centres belongs to them alone, in equal shares: the limit of the formula.
pub(crate) fn log_memberships(log_distances: &mut [f64], m: f64) {
    let hits = log_distances.iter().filter(|&&l| l == f64::NEG_INFINITY).count();
    if hits > 0 {
        let share = -(hits as f64).ln();
        for l in log_distances.iter_mut() {
            *l = if *l == f64::NEG_INFINITY {
                share
            } else {
                f64::NEG_INFINITY
            };
        }
        return;
    }
    for l in log_distances.iter_mut() {
        *l /= -(m - 1.0);
    }
    let total = log_sum_exp(log_distances);
    for l in log_distances.iter_mut() {
        *l -= total;
    }
}

/// `ln (1/n sum_i d_i^(-1/(m-1)))^(-(m-1))`: the power mean of order `-1/(m-1)`.
pub(crate) fn log_power_mean(log_distances: &[f64], m: f64) -> f64 {
    let n = log_distances.len() as f64;
    let least = log_distances.iter().copied().fold(f64::INFINITY, f64::min);
    if least == f64::NEG_INFINITY {
        return least;
    }
    // Means of differences keep the digits that ln(n) would cost when m is large.
    let excess: f64 = log_distances
        .iter()
        .map(|l| (-(l - least) / (m - 1.0)).exp_m1())
        .sum();
    least - (m - 1.0) * (excess / n).ln_1p()
}

pub(crate) fn log_sum_exp(values: &[f64]) -> f64 {
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return top;
    }
    top + values.iter().map(|v| (v - top).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_centres_by_hand() {
        // m = 2: mu_1 = 1 / (1 + d_1/d_2) with d = (0.2, 0.6): 3/4 and 1/4.
        let mut l = [0.2f64.ln(), 0.6f64.ln()];
        log_memberships(&mut l, 2.0);
        assert!((l[0].exp() - 0.75).abs() < 1e-14 && (l[1].exp() - 0.25).abs() < 1e-14);
    }

    #[test]
    fn a_hit_takes_all() {
        let mut l = [f64::NEG_INFINITY, -1.0];
        log_memberships(&mut l, 35.0);
        assert_eq!(l, [0.0, f64::NEG_INFINITY]);
        assert_eq!(
            log_power_mean(&[f64::NEG_INFINITY, -1.0], 35.0),
            f64::NEG_INFINITY
        );
    }

    proptest! {
        #[test]
        fn the_fuzzy_cost_is_the_power_mean_and_tends_to_the_geometric_mean(
            l in prop::collection::vec(-4.0..0.0f64, 1..9), m in 1.5..60.0f64,
        ) {
            let n = l.len() as f64;
            let mut mu = l.clone();
            log_memberships(&mut mu, m);
            prop_assert!((mu.iter().map(|v| v.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
            let terms: Vec<f64> = mu.iter().zip(&l).map(|(u, d)| m * u + d).collect();
            let normalised = (m - 1.0) * n.ln() + log_sum_exp(&terms);
            prop_assert!((normalised - log_power_mean(&l, m)).abs() < 1e-9);
            let geometric = l.iter().sum::<f64>() / n;
            prop_assert!((log_power_mean(&l, 1e7) - geometric).abs() < 1e-5);
            prop_assert!(log_power_mean(&l, m) <= geometric + 1e-12);
        }
    }
}
