//! Decompositions that end on any input. Those of nalgebra iterate without end on a number that is not finite.

use super::finite;
use crate::CoreError;
use nalgebra::allocator::Allocator;
use nalgebra::{ComplexField, DMatrix, DefaultAllocator, Dim, Dyn, OMatrix, SVD, SymmetricEigen};

/// Steps of the iteration for each row and column. It takes two or three.
const STEPS: usize = 100;

/// Units of rounding below which an entry beside the diagonal counts as zero.
const NEGLIGIBLE: f64 = 5.0 * f64::EPSILON;

/// `M = U S V^T`, the singular values in falling order, U and V with as many columns as the smaller side of M.
///
/// # Errors
/// [`CoreError::Dimension`] of a matrix without entries; [`CoreError::NotFinite`]; [`CoreError::NoConvergence`].
pub fn svd<T: ComplexField<RealField = f64>>(m: DMatrix<T>) -> Result<SVD<T, Dyn, Dyn>, CoreError> {
    let operation = "the singular value decomposition";
    has_entries(operation, m.len())?;
    finite("singular value decomposition: matrix", &m.map(|v| v.abs()))?;
    let steps = STEPS * (m.nrows() + m.ncols());
    SVD::try_new(m, true, true, NEGLIGIBLE, steps).ok_or(CoreError::NoConvergence { operation })
}

/// An empty matrix has neither.
fn has_entries(what: &'static str, entries: usize) -> Result<(), CoreError> {
    super::dimension(what, entries.max(1), entries)
}

/// The shortest X that makes `|rows X - right|` least, without the directions whose singular values are at most `cut`.
///
/// # Errors
/// [`CoreError::Dimension`]; [`CoreError::NotFinite`] of the rows or of the answer; [`CoreError::NoConvergence`].
pub fn least_squares<C: Dim>(
    rows: DMatrix<f64>,
    right: &OMatrix<f64, Dyn, C>,
    cut: f64,
) -> Result<OMatrix<f64, Dyn, C>, CoreError>
where
    DefaultAllocator: Allocator<Dyn, C>,
{
    super::dimension(
        "least squares: rows of the right side",
        rows.nrows(),
        right.nrows(),
    )?;
    let operation = "least squares";
    let found = svd(rows)?
        .solve(right, cut.max(0.0))
        .map_err(|_| CoreError::NoConvergence { operation })?;
    match found.iter().all(|v| v.is_finite()) {
        true => Ok(found),
        false => Err(CoreError::NoConvergence { operation }),
    }
}

/// The inverse of Moore and Penrose, without the directions whose singular values are at most `cut`.
///
/// # Errors
/// As [`svd`].
pub fn pseudo_inverse(m: DMatrix<f64>, cut: f64) -> Result<DMatrix<f64>, CoreError> {
    svd(m)?
        .pseudo_inverse(cut.max(0.0))
        .map_err(|_| CoreError::NoConvergence {
            operation: "the pseudo-inverse",
        })
}

/// `M = V diag(values) V^T` of a symmetric matrix, of which the lower triangle is read.
///
/// # Errors
/// [`CoreError::Dimension`] if it is not square or has no entries; [`CoreError::NotFinite`]; [`CoreError::NoConvergence`].
pub fn symmetric_eigen(m: DMatrix<f64>) -> Result<SymmetricEigen<f64, Dyn>, CoreError> {
    super::square("symmetric eigenvalues: matrix", &m)?;
    has_entries("symmetric eigenvalues: entries", m.len())?;
    finite("symmetric eigenvalues: matrix", &m)?;
    let steps = STEPS * m.nrows().max(1);
    SymmetricEigen::try_new(m, f64::EPSILON, steps).ok_or(CoreError::NoConvergence {
        operation: "the eigenvalues of a symmetric matrix",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Bad entries anywhere, in any shape: an answer that multiplies out, or a refusal, at once.
        #[test]
        fn every_matrix_ends(
            rows in 0_usize..7,
            columns in 0_usize..7,
            entries in prop::collection::vec(prop_oneof![6 => -1.0_f64..1.0, 1 => any::<f64>(), 1 => Just(f64::NAN)], 49),
        ) {
            let m = DMatrix::from_fn(rows, columns, |i, j| entries[7 * i + j]);
            let good = !m.is_empty() && m.iter().all(|v| v.is_finite());
            let found = svd(m.clone());
            prop_assert!(good || found.is_err());
            if let Ok(found) = found
                && m.amax() < 1e100
            {
                let again = found.recompose().unwrap();
                prop_assert!((again - &m).amax() <= 1e-12 * m.amax());
            }
            let _ = pseudo_inverse(m.clone(), 1e-12);
            let _ = least_squares(m.clone(), &m, 1e-12);
            let _ = symmetric_eigen(&m * m.transpose());
        }
    }
}
