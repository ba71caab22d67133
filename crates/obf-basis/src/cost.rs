//! What a pole set costs: the n-width and the fuzzy cost.

use crate::disc::{log_distance, log_kappa};
use crate::memberships::log_power_mean;
use crate::poles::check_inside;
use crate::{BasisError, PoleSet};
use num_complex::Complex;

/// `20 / ln 10`: from natural logarithms to decibels.
pub(crate) const DB_PER_NEPER: f64 = 8.685_889_638_065_037;

/// The n-width cost `20 log10 max_z prod_j kappa(z, l_j)` over the observed poles z, in dB (Toth, Heuberger,
/// Van den Hof 2009).
///
/// The product runs over every pole of `basis`, conjugates counted. Minus infinity if every observed pole is a basis
/// pole. Observed poles may be given with or without their conjugates: the cost is the same.
///
/// # Errors
/// [`BasisError::Empty`], [`BasisError::NotFinite`], [`BasisError::NotInside`] for the observed poles.
pub fn kolmogorov_cost_db(basis: &PoleSet, observed: &[Complex<f64>]) -> Result<f64, BasisError> {
    check_inside("observed poles", observed)?;
    let worst = observed
        .iter()
        .map(|&z| basis.as_slice().iter().map(|&l| log_kappa(z, l)).sum::<f64>())
        .fold(f64::NEG_INFINITY, f64::max);
    Ok(DB_PER_NEPER * worst)
}

/// The fuzzy cost of `basis` with its optimal memberships, normalised: `ln(n_c^(m-1) J)`.
///
/// `n_c^(m-1) J = max_k (1/n_c sum_i d_ik^(-1/(m-1)))^(-(m-1))` is a power mean of the distances; as m grows it
/// rises to the geometric mean, and `n_c` times its logarithm is the logarithm of the n-width cost. Here
/// `d_ik = kappa(z_k, v_i) kappa(z_k, conj v_i)` for a pair and `kappa(z_k, a_i)` for a real pole.
///
/// # Errors
/// As [`kolmogorov_cost_db`]; [`BasisError::Setting`] unless `fuzziness` is finite and above 1.
pub fn log_fuzzy_cost(basis: &PoleSet, observed: &[Complex<f64>], fuzziness: f64) -> Result<f64, BasisError> {
    check_inside("observed poles", observed)?;
    if !(fuzziness.is_finite() && fuzziness > 1.0) {
        return Err(BasisError::Setting {
            name: "fuzziness",
            value: fuzziness,
            range: "finite, above 1",
        });
    }
    let mut distances = Vec::with_capacity(basis.units().len());
    let mut worst = f64::NEG_INFINITY;
    for &z in observed {
        distances.clear();
        distances.extend(basis.units().iter().map(|&unit| log_distance(z, unit)));
        worst = worst.max(log_power_mean(&distances, fuzziness));
    }
    Ok(worst)
}
