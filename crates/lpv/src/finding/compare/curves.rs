//! What the other places say of a record: the curves through them, and whether a factor brings the record nearer.
//!
//! A lever arm or a mode shape changes size and sign along the stroke, and smoothly; a slip of sign or unit at one place does not.

use super::{C64, Voice};
use lpv_core::Position;
use lpv_core::linalg::svd;
use lpv_core::nalgebra::DMatrix;
use lpv_ident::monomials;
use lpv_numerics::statistics::median;

/// Highest order of the curves.
const ORDER: usize = 3;
/// Part of its distance to a prediction that a record keeps when its factor is taken out, if the factor is a slip and not the
/// machine's own.
const CLOSER: f64 = 0.5;
/// Smallest part of the largest singular value that counts.
const RANK: f64 = 1e-6;

/// Whether a record is clearly closer to a prediction, in the median over the lines, without its factor than with it: by the
/// distance where the factor is a sign alone, by the logarithm of the size where it is a unit.
pub(super) fn corrected(of: &[C64], factor: f64, predicted: &[C64]) -> bool {
    let distance = |factor: f64, sign_alone: bool| {
        let parts = of.iter().zip(predicted).map(|(a, b)| match sign_alone {
            true => (a / factor - b).norm() / a.norm(),
            false => ((a / factor).norm() / b.norm()).ln().abs(),
        });
        median(&parts.filter(|d| d.is_finite()).collect::<Vec<_>>())
    };
    let sign_alone = factor == -1.0;
    distance(factor, sign_alone) < CLOSER * distance(1.0, sign_alone)
}

/// Weights of the other records in the value, at the place of a record, of the polynomials through them: of order 0, 1 and so
/// on in the coordinates that change, fitted by least squares; from order 2 on to more places than there are coefficients, since an
/// exact curve beyond its ends may be anywhere.
pub(super) fn curves(others: &[&Voice], voice: &Voice) -> Vec<Vec<f64>> {
    let places = others
        .iter()
        .map(|v| v.position.as_ref())
        .collect::<Option<Vec<_>>>();
    let (Some(at), Some(places)) = (voice.position.as_ref(), places) else {
        return Vec::new();
    };
    if places.iter().any(|p| p.len() != at.len()) {
        return Vec::new();
    }
    let reach = |d: usize| places.iter().map(|p| (p[d] - at[d]).abs()).fold(0.0, f64::max);
    let changing: Vec<(usize, f64)> = (0..at.len())
        .map(|d| (d, reach(d)))
        .filter(|(_, r)| *r > 0.0)
        .collect();
    let of_order = |order: usize| {
        let exponents = monomials(changing.len(), order);
        let spare = usize::from(order > 1);
        if places.len() < exponents.len() + spare {
            return None;
        }
        let term = |p: &Position, e: &[u32]| -> f64 {
            let factors = changing.iter().zip(e);
            factors
                .map(|((d, reach), e)| ((p[*d] - at[*d]) / reach).powi(*e as i32))
                .product()
        };
        let rows: Vec<f64> = places
            .iter()
            .flat_map(|p| exponents.iter().map(|e| term(p, e)))
            .collect();
        let svd = svd(DMatrix::from_row_slice(places.len(), exponents.len(), &rows)).ok()?;
        if svd.rank(RANK * svd.singular_values.max()) < exponents.len() {
            return None;
        }
        // The coordinates are distances from the record's place, where only the constant counts.
        let inverse = svd.pseudo_inverse(0.0).ok()?;
        Some(inverse.row(0).iter().copied().collect())
    };
    (0..=ORDER).map_while(of_order).collect()
}
