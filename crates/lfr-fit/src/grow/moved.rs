//! A frozen model whose poles are moved to known ones, its coordinates kept.

use crate::sampling::Sampling;
use lpv_core::linalg::eigenvalues;
use lpv_core::{CoreError, Discrete};
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// The state matrix with the same eigenvectors, its complex pairs of eigenvalues moved to `sampled` poles: as many as there are of
/// both, in the order of their frequencies, so that the squares of the distances have the least sum. As it was where eigenvalues
/// are too near each other to be told apart.
///
/// A lightly damped resonance that moves by more than its width from one position to the next is out of sight for a search that
/// starts at the neighbour: the gradient sees a foot of either resonance only.
pub(super) fn moved<K: Sampling>(
    clock: K,
    a: &DMatrix<f64>,
    sampled: &[C64],
    data: Discrete,
) -> Result<DMatrix<f64>, CoreError> {
    let own = eigenvalues(a)?;
    let upper = by_frequency(own.iter().copied());
    let wanted = by_frequency(
        sampled
            .iter()
            .filter(|z| z.im > 0.0)
            .map(|&z| clock.pole_of_sampled(z, data)),
    );
    let pairs = if upper.len() <= wanted.len() {
        aligned(&upper, &wanted)
    } else {
        let swapped = aligned(&wanted, &upper).into_iter();
        swapped.map(|(to, from)| (from, to)).collect()
    };
    let mut sum = a.map(C64::from);
    for (from, to) in pairs {
        let Some(projector) = projector(a, &own, from) else {
            return Ok(a.clone());
        };
        // With that of the twin: twice the real part.
        sum += (projector * (to - from)).map(|v| C64::from(2.0 * v.re));
    }
    Ok(sum.map(|v| v.re))
}

/// Those above the real axis, by imaginary part.
fn by_frequency(poles: impl Iterator<Item = C64>) -> Vec<C64> {
    let mut upper: Vec<C64> = poles.filter(|s| s.im > 0.0).collect();
    upper.sort_by(|x, y| x.im.total_cmp(&y.im));
    upper
}

/// Each of `few` with one of `many`, in their order, so that the squares of the distances have the least sum.
fn aligned(few: &[C64], many: &[C64]) -> Vec<(C64, C64)> {
    let spare = many.len() - few.len();
    // The least sums for the first of `few`, the last of them with `many[i + skipped]` or one before it, and which one.
    let mut sums = vec![0.0; spare + 1];
    let mut chosen: Vec<Vec<usize>> = Vec::with_capacity(few.len());
    for (i, pole) in few.iter().enumerate() {
        let (mut least, mut at) = (f64::INFINITY, 0);
        let mut row = Vec::with_capacity(spare + 1);
        for (skipped, sum) in sums.iter_mut().enumerate() {
            let here = *sum + (pole - many[i + skipped]).norm_sqr();
            if here < least {
                (least, at) = (here, skipped);
            }
            *sum = least;
            row.push(at);
        }
        chosen.push(row);
    }
    let mut skipped = spare;
    let mut pairs: Vec<(C64, C64)> = (0..few.len())
        .rev()
        .map(|i| {
            skipped = chosen[i][skipped];
            (few[i], many[i + skipped])
        })
        .collect();
    pairs.reverse();
    pairs
}

/// The spectral projector `P = prod_j (A - l_j I) / (l - l_j)` over all eigenvalues but `l`; none where another one is too near.
fn projector(a: &DMatrix<f64>, own: &[C64], eigenvalue: C64) -> Option<DMatrix<C64>> {
    const APART: f64 = 1e-4;
    let n = a.nrows();
    let whole = a.map(C64::from);
    let mut others = own.to_vec();
    others.swap_remove(others.iter().position(|l| *l == eigenvalue)?);
    others
        .into_iter()
        .try_fold(DMatrix::identity(n, n), |product, other| {
            let gap = eigenvalue - other;
            let factor = &whole - DMatrix::from_diagonal_element(n, n, other);
            (gap.norm() > APART * eigenvalue.norm()).then(|| product * factor / gap)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::Continuous;

    #[test]
    fn modes_that_move_together_keep_their_order() {
        let pole = |im: f64| C64::new(-0.1, im);
        let pairs = aligned(&[pole(10.0), pole(12.0)], &[pole(11.5), pole(13.5), pole(40.0)]);
        assert_eq!(pairs, [(pole(10.0), pole(11.5)), (pole(12.0), pole(13.5))]);
        let pairs = aligned(
            &[pole(10.0), pole(12.0)],
            &[pole(3.0), pole(10.5), pole(11.0), pole(12.5)],
        );
        assert_eq!(pairs, [(pole(10.0), pole(10.5)), (pole(12.0), pole(12.5))]);
        assert!(aligned(&[], &[pole(1.0)]).is_empty());
    }

    #[test]
    fn poles_go_where_they_are_wanted_and_vectors_stay() {
        // Two modes in mixed coordinates, wanted ones given in another order, with one that is not needed.
        let modal = DMatrix::from_row_slice(
            4,
            4,
            &[
                -0.1, 2.0, 0.0, 0.0, -2.0, -0.1, 0.0, 0.0, 0.0, 0.0, -0.2, 3.0, 0.0, 0.0, -3.0, -0.2,
            ],
        );
        let t = DMatrix::from_fn(4, 4, |i, j| {
            if i == j {
                2.0
            } else {
                0.3 * (i as f64 - 0.5 * j as f64)
            }
        });
        let a = &t * &modal * t.clone().try_inverse().unwrap();
        let clock = Discrete::new(0.1).unwrap();
        let wanted = [C64::new(-0.3, 3.4), C64::new(-0.05, 9.0), C64::new(-0.12, 2.2)];
        let sampled: Vec<C64> = wanted.iter().map(|s| (s * 0.1).exp()).collect();
        let found = moved(Continuous, &a, &sampled, clock).unwrap();
        let mut poles: Vec<C64> = eigenvalues(&found).unwrap();
        poles.retain(|z| z.im > 0.0);
        poles.sort_by(|x, y| x.im.total_cmp(&y.im));
        assert!((poles[0] - wanted[2]).norm() < 1e-12 && (poles[1] - wanted[0]).norm() < 1e-12);
        // The same eigenvectors: the two matrices commute.
        assert!((&found * &a - &a * &found).amax() < 1e-12);
        assert_eq!(moved(Continuous, &a, &[], clock).unwrap(), a);
        // Fewer than there are.
        let one = moved(Continuous, &a, &sampled[..1], clock).unwrap();
        let poles = eigenvalues(&one).unwrap();
        assert!(
            [wanted[0], C64::new(-0.1, 2.0)]
                .iter()
                .all(|w| poles.iter().any(|z| (z - w).norm() < 1e-12))
        );
        // Two modes that cannot be told apart, and no states.
        let twins =
            DMatrix::from_row_slice(2, 2, &[-0.1, 2.0, -2.0, -0.1]).kronecker(&DMatrix::identity(2, 2));
        assert_eq!(moved(Continuous, &twins, &sampled, clock).unwrap(), twins);
        let none = DMatrix::zeros(0, 0);
        assert_eq!(moved(clock, &none, &sampled, clock).unwrap(), none);
    }
}
