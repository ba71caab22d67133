//! What the positions say of B and C between them.
//!
//! In weighted entries, whose noise has variance one, B and C at the positions are values of a smooth random function with an unknown
//! mean, covariance `v exp(-(d - d')^2 / 2 l^2)`. The values themselves tell the length l (one for each row of B, or column of C) and
//! the variance v of each entry, by maximum likelihood of their contrasts; the variance of the best linear prediction midway between
//! two positions is then known (universal kriging).

use super::sides::Weights;
use super::{Place, ShapesAt};
use crate::{FitError, FrozenData};
use lpv_core::linalg::symmetric_eigen;
use nalgebra::{DMatrix, DVector};

/// Lengths that are tried, in halves of the range of p.
const LENGTHS: [f64; 9] = [0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0];

/// Decades of the variance of an entry that are tried, and steps a decade.
const DECADES: std::ops::RangeInclusive<i32> = -2..=14;
const STEPS: i32 = 3;

/// Neighbouring positions, by index, with the rms residual to be expected midway between them: one where nothing but noise is.
pub(super) fn expected_between(
    weights: &Weights,
    deltas: &[f64],
    places: &[Place],
    few: &FrozenData,
    shapes: ShapesAt,
) -> Result<Vec<([usize; 2], f64)>, FitError> {
    let mut order: Vec<usize> = (0..deltas.len()).collect();
    order.sort_by(|a, b| deltas[*a].total_cmp(&deltas[*b]));
    let midways: Vec<f64> = order
        .windows(2)
        .map(|w| 0.5 * (deltas[w[0]] + deltas[w[1]]))
        .collect();
    let lengths = LENGTHS
        .iter()
        .map(|length| Length::new(deltas, &midways, *length))
        .collect::<Result<Vec<_>, _>>()?;
    let mut sums = vec![0.0; midways.len()];
    for entries in weights.rows(places, shapes)? {
        // The variance of each entry at its best for each length; the length at its best for all of them.
        let by_length = lengths.iter().map(|length| {
            let best: Vec<(f64, f64)> = entries.iter().map(|values| length.variance(values)).collect();
            let likelihood: f64 = best.iter().map(|b| b.1).sum();
            (length, best, likelihood)
        });
        let Some((length, best, _)) = by_length.max_by(|a, b| a.2.total_cmp(&b.2)) else {
            continue;
        };
        for (sum, midway) in sums.iter_mut().zip(0..) {
            *sum += best
                .iter()
                .map(|(variance, _)| length.left(*variance, midway))
                .sum::<f64>();
        }
    }
    let counts = (0..few.len())
        .map(|i| few.at(i))
        .map(|lines| lines.rms_count(lines.equations()));
    let count = counts.sum::<f64>() / few.len() as f64;
    let rms = |sum: f64| (1.0 + sum / count).sqrt();
    Ok(order
        .windows(2)
        .map(|w| [w[0], w[1]])
        .zip(sums.into_iter().map(rms))
        .collect())
}

/// The covariance of one length: of the contrasts of the positions for the likelihood, of the positions for the prediction.
struct Length {
    contrasts: DMatrix<f64>,
    contrast_values: DVector<f64>,
    vectors: DMatrix<f64>,
    values: DVector<f64>,
    /// Covariances with the midways, in the eigenvectors, over the variance; a column each.
    with: DMatrix<f64>,
}

impl Length {
    fn new(deltas: &[f64], midways: &[f64], length: f64) -> Result<Self, FitError> {
        let count = deltas.len();
        let covariance = |a: f64, b: f64| (-0.5 * ((a - b) / length).powi(2)).exp();
        let k = DMatrix::from_fn(count, count, |i, j| covariance(deltas[i], deltas[j]));
        // Orthonormal contrasts (Helmert): the mean of all is in none of them.
        let helmert = DMatrix::from_fn(count - 1, count, |i, j| {
            let size = ((i + 1) * (i + 2)) as f64;
            match j.cmp(&(i + 1)) {
                std::cmp::Ordering::Less => size.sqrt().recip(),
                std::cmp::Ordering::Equal => -((i + 1) as f64) / size.sqrt(),
                std::cmp::Ordering::Greater => 0.0,
            }
        });
        let of_contrasts = symmetric_eigen(&helmert * &k * helmert.transpose())?;
        let of_all = symmetric_eigen(k)?;
        let with = DMatrix::from_fn(count, midways.len(), |i, q| covariance(deltas[i], midways[q]));
        let positive = |v: DVector<f64>| v.map(|v| v.max(0.0));
        Ok(Self {
            contrasts: of_contrasts.eigenvectors.transpose() * helmert,
            contrast_values: positive(of_contrasts.eigenvalues),
            with: of_all.eigenvectors.transpose() * with,
            values: positive(of_all.eigenvalues),
            vectors: of_all.eigenvectors,
        })
    }

    /// The likeliest variance of an entry with these values, and its log-likelihood.
    fn variance(&self, values: &DVector<f64>) -> (f64, f64) {
        let squares = (&self.contrasts * values).map(|v| v * v);
        let likelihood = |variance: f64| -> f64 {
            let terms = squares.iter().zip(&self.contrast_values);
            terms
                .map(|(square, value)| {
                    let total = variance * value + 1.0;
                    -0.5 * (total.ln() + square / total)
                })
                .sum()
        };
        let tried = (STEPS * DECADES.start()..=STEPS * DECADES.end())
            .map(|k| 10f64.powf(f64::from(k) / f64::from(STEPS)));
        std::iter::once(0.0)
            .chain(tried)
            .map(|variance| (variance, likelihood(variance)))
            .fold(
                (0.0, f64::NEG_INFINITY),
                |best, now| if now.1 > best.1 { now } else { best },
            )
    }

    /// Variance of the prediction at a midway, of an entry of this variance with noise of variance one and an unknown mean.
    fn left(&self, variance: f64, midway: usize) -> f64 {
        let ones = self.vectors.row_sum_tr();
        let with = self.with.column(midway);
        let weighted = |a: &dyn Fn(usize) -> f64, b: &dyn Fn(usize) -> f64| -> f64 {
            (0..self.values.len())
                .map(|k| a(k) * b(k) / (variance * self.values[k] + 1.0))
                .sum()
        };
        let (one, own) = (|k: usize| ones[k], |k: usize| variance * with[k]);
        let explained = weighted(&own, &own);
        let mean = (1.0 - weighted(&one, &own)).powi(2) / weighted(&one, &one);
        (variance - explained).max(0.0) + mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cosines of several wavelengths through few positions, noise of one: the deviation midway is that of the true error.
    #[test]
    fn the_expected_error_midway_is_that_of_smooth_functions() {
        for (positions, wavenumber) in [(5, 0.3), (5, 1.0), (5, 2.0), (9, 1.0), (9, 3.0)] {
            let deltas: Vec<f64> = (0..positions)
                .map(|i| 2.0 * f64::from(i) / f64::from(positions - 1) - 1.0)
                .collect();
            let midways: Vec<f64> = deltas.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
            let lengths: Vec<Length> = LENGTHS
                .iter()
                .map(|l| Length::new(&deltas, &midways, *l).unwrap())
                .collect();
            let (mut squares, mut expected) = (0.0, 0.0);
            for seed in 0..20 {
                let phase = 0.3 * f64::from(seed);
                let f = |d: f64| 1e3 * (phase + wavenumber * d).cos();
                let values = DVector::from_iterator(deltas.len(), deltas.iter().map(|d| f(*d)));
                let best = lengths.iter().map(|l| (l, l.variance(&values)));
                let (length, (variance, _)) = best.max_by(|a, b| a.1.1.total_cmp(&b.1.1)).unwrap();
                for (q, midway) in midways.iter().enumerate() {
                    // The prediction itself.
                    let total = length.values.map(|v| (variance * v + 1.0).recip());
                    let ones = length.vectors.row_sum_tr();
                    let y = length.vectors.tr_mul(&values);
                    let mean = ones.component_mul(&total).dot(&y) / ones.component_mul(&total).dot(&ones);
                    let kriged = mean
                        + variance
                            * length
                                .with
                                .column(q)
                                .component_mul(&total)
                                .dot(&(y - mean * ones));
                    squares += (kriged - f(*midway)).powi(2);
                    expected += length.left(variance, q);
                }
            }
            let ratio = (squares / expected).sqrt();
            println!(
                "{positions} positions, wavenumber {wavenumber}: error over its expectation {ratio:.3}, rms {:.3}",
                (squares / 20.0 / midways.len() as f64).sqrt()
            );
            assert!(ratio < 3.0, "{ratio}");
        }
    }
}
