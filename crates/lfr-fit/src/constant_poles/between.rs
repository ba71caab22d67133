//! What the positions say of B and C between them.
//!
//! In weighted entries, whose noise has variance one, B and C at the positions are values of a random function `sum_k c_k T_k(delta)`
//! of Chebyshev polynomials: nothing is known of the coefficients up to a degree d, and above it they have the variances
//! `v r^(2 (k - d - 1))`, or, for an even or odd function that lacks every other one, `v, v, v r^4, v r^4, ...`. The values tell d and
//! the decay r, for each row of B and column of C, and v, for each entry, by maximum likelihood; the variance of the best linear
//! prediction midway between two positions is then known (universal kriging).

use super::sides::Weights;
use super::{Place, ShapesAt};
use crate::{FitError, FrozenData};
use lpv_core::linalg::symmetric_eigen;
use nalgebra::{DMatrix, DVector};

/// Decays that are tried.
const DECAYS: [f64; 8] = [0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02];

/// Coefficients above the degree.
const TERMS: usize = 24;

/// Square of a coefficient, over the product of its neighbours, below which it is missing.
const GAP: f64 = 0.1;

/// Difference of log-likelihoods that tells two kinds of functions hardly apart.
const ALIKE: f64 = 2.0;

/// Decades of the variance of an entry that are tried, and steps a decade.
const DECADES: std::ops::RangeInclusive<i32> = -2..=14;
const STEPS: i32 = 3;

/// What is to be expected midway between two neighbouring positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// Their indices.
    pub positions: [usize; 2],
    /// Rms residual, one where nothing but noise is.
    pub over_noise: f64,
    /// What is beside the noise as a part of the response there, both whitened and as an rms.
    pub part: f64,
}

/// The same of all neighbours.
pub(super) fn expected_between(
    weights: &Weights,
    deltas: &[f64],
    places: &[Place],
    few: &FrozenData,
    shapes: ShapesAt,
) -> Result<Vec<Between>, FitError> {
    let mut order: Vec<usize> = (0..deltas.len()).collect();
    order.sort_by(|a, b| deltas[*a].total_cmp(&deltas[*b]));
    let midways: Vec<f64> = order
        .windows(2)
        .map(|w| 0.5 * (deltas[w[0]] + deltas[w[1]]))
        .collect();
    let families = Families::new(deltas, &midways)?;
    let mut sums = DVector::zeros(midways.len());
    for entries in weights.rows(places, shapes)? {
        if let Some((kind, variances)) = families.likeliest(&entries)? {
            sums += kind.left_of(&variances)?;
        }
    }
    let counts = (0..few.len())
        .map(|i| few.at(i))
        .map(|lines| lines.rms_count(lines.equations()));
    let count = counts.sum::<f64>() / few.len() as f64;
    let energy = |i: usize| few.positions()[i].energy();
    let of = |(w, sum): (&[usize], &f64)| Between {
        positions: [w[0], w[1]],
        over_noise: (1.0 + sum / count).sqrt(),
        part: (sum / (0.5 * (energy(w[0]) + energy(w[1])))).sqrt(),
    };
    Ok(order.windows(2).zip(&sums).map(of).collect())
}

/// The kinds of functions that are tried.
struct Families {
    /// Rows: orthonormal polynomials on the positions, the constant first.
    polynomials: DMatrix<f64>,
    /// Coefficients that decay one by one.
    single: Vec<Kind>,
    /// Coefficients that decay two by two.
    paired: Vec<Kind>,
}

impl Families {
    fn new(deltas: &[f64], midways: &[f64]) -> Result<Self, FitError> {
        let count = deltas.len();
        let kinds = |paired: bool| {
            // Of pairs the positions tell whole ones above the degree.
            let degrees =
                (0..count.saturating_sub(2)).filter(|d| !paired || (count - 1 - d).is_multiple_of(2));
            let all = degrees.flat_map(|degree| DECAYS.iter().map(move |decay| (degree, *decay)));
            all.map(|(degree, decay)| Kind::new(deltas, midways, degree, (decay, paired)))
                .collect::<Result<Vec<_>, _>>()
        };
        Ok(Self {
            polynomials: chebyshev(deltas, 0..count).qr().q().transpose(),
            single: kinds(false)?,
            paired: kinds(true)?,
        })
    }

    /// The kind of function that these entries are together most likely of, and the variance of each. Where every other coefficient is
    /// missing, the last one tells nothing of what comes above it: then of kinds that are nearly as likely the one that leaves most.
    fn likeliest(&self, entries: &[DVector<f64>]) -> Result<Option<(&Kind, Vec<f64>)>, FitError> {
        let size = |k: usize| -> f64 {
            let row = self.polynomials.row(k);
            entries.iter().map(|values| (row * values)[0].powi(2)).sum()
        };
        let sizes: Vec<f64> = (1..self.polynomials.nrows()).map(size).collect();
        let gaps = sizes.windows(3).any(|s| s[1] < GAP * (s[0] * s[2]).sqrt());
        let (kinds, alike) = match gaps {
            true => (&self.paired, ALIKE),
            false => (&self.single, 0.0),
        };
        let found: Vec<(&Kind, Vec<f64>, f64)> = kinds
            .iter()
            .map(|kind| {
                let each: Vec<(f64, f64)> = entries.iter().map(|values| kind.variance(values)).collect();
                let likelihood = each.iter().map(|f| f.1).sum();
                (kind, each.into_iter().map(|f| f.0).collect(), likelihood)
            })
            .collect();
        let most = found.iter().map(|f| f.2).fold(f64::NEG_INFINITY, f64::max);
        let mut worst: Option<(f64, (&Kind, Vec<f64>))> = None;
        for (kind, variances, _) in found.into_iter().filter(|f| f.2 >= most - alike) {
            let left = kind.left_of(&variances)?.sum();
            if worst.as_ref().is_none_or(|(most, _)| left > *most) {
                worst = Some((left, (kind, variances)));
            }
        }
        Ok(worst.map(|(_, found)| found))
    }
}

/// Chebyshev polynomials of these degrees, a column each.
fn chebyshev(at: &[f64], degrees: std::ops::Range<usize>) -> DMatrix<f64> {
    DMatrix::from_fn(at.len(), degrees.len(), |i, k| {
        ((degrees.start + k) as f64 * at[i].clamp(-1.0, 1.0).acos()).cos()
    })
}

/// Functions of one degree and decay.
struct Kind {
    /// Rows: orthonormal directions of the values that a polynomial of the degree moves, the constant left out.
    known: DMatrix<f64>,
    /// Rows: directions that it does not move, in which the covariance of the rest is diagonal.
    rest: DMatrix<f64>,
    rest_values: DVector<f64>,
    /// Covariance of the positions over the variance, between positions and midways, and at the midways.
    covariance: DMatrix<f64>,
    with: DMatrix<f64>,
    own: Vec<f64>,
    /// Polynomials up to the degree at the positions (rows) and the midways.
    powers: DMatrix<f64>,
    powers_midway: DMatrix<f64>,
}

impl Kind {
    fn new(
        deltas: &[f64],
        midways: &[f64],
        degree: usize,
        (decay, paired): (f64, bool),
    ) -> Result<Self, FitError> {
        let count = deltas.len();
        let power = |k: i32| if paired { 2 * (k / 2) } else { k };
        let above = degree + 1..degree + 1 + TERMS;
        let scale = DMatrix::from_diagonal(&DVector::from_fn(TERMS, |k, _| decay.powi(power(k as i32))));
        let features = chebyshev(deltas, above.clone()) * &scale;
        let features_midway = chebyshev(midways, above) * scale;
        let powers = chebyshev(deltas, 0..degree + 1);
        // Beside the polynomials the identity gives the directions that they do not move.
        let mut beside = DMatrix::zeros(count, count + degree + 1);
        beside.columns_mut(0, degree + 1).copy_from(&powers);
        beside
            .columns_mut(degree + 1, count)
            .copy_from(&DMatrix::identity(count, count));
        let q = beside.qr().q();
        let others = q.columns(degree + 1, count - degree - 1).transpose();
        let covariance = &features * features.transpose();
        let eigen = symmetric_eigen(&others * &covariance * others.transpose())?;
        Ok(Self {
            known: q.columns(1, degree).transpose(),
            rest: eigen.eigenvectors.transpose() * others,
            rest_values: eigen.eigenvalues.map(|v| v.max(0.0)),
            with: &features * features_midway.transpose(),
            own: features_midway.row_iter().map(|r| r.norm_squared()).collect(),
            covariance,
            powers,
            powers_midway: chebyshev(midways, 0..degree + 1),
        })
    }

    /// The likeliest variance of an entry with these values, and its log-likelihood. A coefficient of which nothing is known has its own
    /// variance, at the price of one unknown (Akaike).
    fn variance(&self, values: &DVector<f64>) -> (f64, f64) {
        let known: f64 = (&self.known * values)
            .iter()
            .map(|q| -0.5 * ((q * q + 1.0).ln() + 1.0) - 1.0)
            .sum();
        let squares = (&self.rest * values).map(|v| v * v);
        let likelihood = |variance: f64| -> f64 {
            let terms = squares.iter().zip(&self.rest_values);
            terms
                .map(|(square, value)| {
                    let total = variance * value + 1.0;
                    -0.5 * (total.ln() + square / total)
                })
                .sum()
        };
        let tried = (STEPS * DECADES.start()..=STEPS * DECADES.end())
            .map(|k| 10f64.powf(f64::from(k) / f64::from(STEPS)));
        let best = std::iter::once(0.0)
            .chain(tried)
            .map(|variance| (variance, likelihood(variance)))
            .fold(
                (0.0, f64::NEG_INFINITY),
                |best, now| {
                    if now.1 > best.1 { now } else { best }
                },
            );
        (best.0, best.1 + known)
    }

    /// Weights of the values at the positions in the best linear predictions at the midways, a column each, for an entry of this
    /// variance.
    fn weights(&self, variance: f64) -> Result<DMatrix<f64>, FitError> {
        let count = self.covariance.nrows();
        let failed = FitError::NoConvergence {
            operation: "the prediction between the positions",
        };
        let total = &self.covariance * variance + DMatrix::identity(count, count);
        let Some(factor) = total.cholesky() else {
            return Err(failed);
        };
        let (by_rest, by_powers) = (factor.solve(&(&self.with * variance)), factor.solve(&self.powers));
        let gap = self.powers_midway.transpose() - self.powers.tr_mul(&by_rest);
        let Some(multipliers) = self.powers.tr_mul(&by_powers).cholesky().map(|f| f.solve(&gap)) else {
            return Err(failed);
        };
        Ok(by_rest + by_powers * multipliers)
    }

    /// Variance of the errors of these predictions, the sum over entries of these variances.
    fn left_of(&self, variances: &[f64]) -> Result<DVector<f64>, FitError> {
        let mut sum = DVector::zeros(self.own.len());
        for variance in variances {
            for (midway, w) in self.weights(*variance)?.column_iter().enumerate() {
                let rest = self.own[midway] - 2.0 * w.dot(&self.with.column(midway))
                    + w.dot(&(&self.covariance * w));
                sum[midway] += variance * rest.max(0.0) + w.norm_squared();
            }
        }
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Few values with noise of one, of cosines of several wavelengths and of polynomials: the deviation that is expected midway is that
    /// of the true error, within a factor.
    #[test]
    fn the_error_that_is_expected_midway_is_the_true_one() {
        type Function = fn(f64, f64) -> f64;
        let functions: [(&str, Function); 6] = [
            ("slow cosine", |phase, d| (phase + 0.3 * d).cos()),
            ("cosine", |phase, d| (phase + d).cos()),
            ("fast cosine", |phase, d| (phase + 2.0 * d).cos()),
            ("parabola", |phase, d| 1.0 + phase * d + 0.3 * d * d),
            ("odd", |phase, d| ((1.0 + phase) * d).sin()),
            ("constant", |_, _| 1.0),
        ];
        for positions in [4_u32, 5, 7, 9] {
            let deltas: Vec<f64> = (0..positions)
                .map(|i| 2.0 * f64::from(i) / f64::from(positions - 1) - 1.0)
                .collect();
            let midways: Vec<f64> = deltas.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
            let families = Families::new(&deltas, &midways).unwrap();
            for (name, f) in functions {
                for size in [3e1, 1e3, 1e5] {
                    let (mut squares, mut expected) = (0.0, 0.0);
                    for seed in 0..12_u32 {
                        // Rows of three entries, as of three channels.
                        let phase = |j: u32| 0.1 * f64::from(seed) + 0.4 * f64::from(j);
                        let noise = |i: u32, j: u32| {
                            (1.7 * f64::from(i * 31 + j * 17 + seed * 7)).sin() * 2f64.sqrt()
                        };
                        let entries: Vec<DVector<f64>> = (0..3)
                            .map(|j| {
                                let values = deltas
                                    .iter()
                                    .zip(0..)
                                    .map(|(d, i)| size * f(phase(j), *d) + noise(i, j));
                                DVector::from_iterator(deltas.len(), values)
                            })
                            .collect();
                        let (kind, variances) = families.likeliest(&entries).unwrap().unwrap();
                        for (j, variance) in variances.into_iter().enumerate() {
                            let predicted = kind.weights(variance).unwrap().tr_mul(&entries[j]);
                            for (value, midway) in predicted.iter().zip(&midways) {
                                squares += (value - size * f(phase(j as u32), *midway)).powi(2);
                            }
                            expected += kind.left_of(&[variance]).unwrap().sum();
                        }
                    }
                    let each = 36.0 * midways.len() as f64;
                    let (error, told) = ((squares / each).sqrt(), (expected / each).sqrt());
                    println!("{positions} positions, {name} of {size}: error {error:.2}, expected {told:.2}");
                    assert!(
                        error < 4.0 * told,
                        "{positions}, {name}, {size}: {error} against {told}"
                    );
                    if matches!(name, "parabola" | "constant") && positions > 4 {
                        assert!(told < 3.0, "{positions}, {name}, {size}: {told}");
                    }
                }
            }
        }
    }
}
