//! Small Hermitian matrices in slices (column-major): one line of an FRF at a time, without allocation.

use num_complex::Complex;

type C64 = Complex<f64>;

/// Lower Cholesky factor in place; the strict upper triangle is left as it was. False if a pivot is not positive.
pub(crate) fn cholesky(n: usize, a: &mut [C64]) -> bool {
    for j in 0..n {
        let mut pivot = a[j * n + j].re;
        for k in 0..j {
            pivot -= a[k * n + j].norm_sqr();
        }
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let root = pivot.sqrt();
        a[j * n + j] = C64::new(root, 0.0);
        for i in j + 1..n {
            let mut sum = a[j * n + i];
            for k in 0..j {
                sum -= a[k * n + i] * a[k * n + j].conj();
            }
            a[j * n + i] = sum / root;
        }
    }
    true
}

/// `(L L^H)^-1` from the lower factor `L`.
pub(crate) fn inverse_from_factor(n: usize, l: &[C64], scratch: &mut [C64], inverse: &mut [C64]) {
    // scratch = L^-1, lower triangular.
    for j in 0..n {
        for i in 0..j {
            scratch[j * n + i] = C64::new(0.0, 0.0);
        }
        scratch[j * n + j] = l[j * n + j].inv();
        for i in j + 1..n {
            let mut sum = C64::new(0.0, 0.0);
            for k in j..i {
                sum -= l[k * n + i] * scratch[j * n + k];
            }
            scratch[j * n + i] = sum / l[i * n + i];
        }
    }
    for j in 0..n {
        for i in 0..n {
            let mut sum = C64::new(0.0, 0.0);
            for k in i.max(j)..n {
                sum += scratch[i * n + k].conj() * scratch[j * n + k];
            }
            inverse[j * n + i] = sum;
        }
    }
}

/// Inverse of a Hermitian matrix with positive diagonal; where it is not positive definite, the inverse of its
/// diagonal. The flag says whether the whole matrix was used. `work` holds at least two such matrices.
pub(crate) fn inverse_or_diagonal(n: usize, a: &[C64], work: &mut [C64], inverse: &mut [C64]) -> bool {
    let (factor, scratch) = work[..2 * n * n].split_at_mut(n * n);
    factor.copy_from_slice(a);
    if cholesky(n, factor) {
        inverse_from_factor(n, factor, scratch, inverse);
        if inverse.iter().all(|v| v.re.is_finite() && v.im.is_finite()) {
            return true;
        }
    }
    inverse.fill(C64::new(0.0, 0.0));
    for i in 0..n {
        inverse[i * n + i] = C64::new(1.0 / a[i * n + i].re, 0.0);
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn inverse_of_two_by_two_by_hand() {
        // [[2, j], [-j, 2]] has determinant 3 and inverse [[2, -j], [j, 2]] / 3.
        let c = C64::new;
        let a = [c(2.0, 0.0), c(0.0, -1.0), c(0.0, 1.0), c(2.0, 0.0)];
        let mut inverse = [c(0.0, 0.0); 4];
        assert!(inverse_or_diagonal(2, &a, &mut [c(0.0, 0.0); 8], &mut inverse));
        let expected = [c(2.0, 0.0), c(0.0, 1.0), c(0.0, -1.0), c(2.0, 0.0)];
        for (x, e) in inverse.iter().zip(expected) {
            assert!((x - e / 3.0).norm() < 1e-15);
        }
    }

    #[test]
    fn indefinite_matrix_gives_the_inverse_of_its_diagonal() {
        let c = C64::new;
        let a = [c(1.0, 0.0), c(2.0, 0.0), c(2.0, 0.0), c(1.0, 0.0)];
        let mut inverse = [c(0.0, 0.0); 4];
        assert!(!inverse_or_diagonal(2, &a, &mut [c(0.0, 0.0); 8], &mut inverse));
        assert_eq!(inverse[1], c(0.0, 0.0));
        assert_eq!(inverse[3], c(1.0, 0.0));
    }

    proptest! {
        #[test]
        fn product_with_the_inverse_is_the_identity(n in 1usize..5, x in prop::collection::vec(-1.0..1.0f64, 50)) {
            let m = nalgebra::DMatrix::from_fn(n, n, |i, j| C64::new(x[2 * (i + 5 * j)], x[2 * (i + 5 * j) + 1]));
            let a = &m * m.adjoint() + nalgebra::DMatrix::identity(n, n).scale(0.1);
            let mut work = vec![C64::new(0.0, 0.0); 2 * n * n];
            let mut inverse = vec![C64::new(0.0, 0.0); n * n];
            prop_assert!(inverse_or_diagonal(n, a.as_slice(), &mut work, &mut inverse));
            let product = a * nalgebra::DMatrix::from_vec(n, n, inverse);
            let error = (product - nalgebra::DMatrix::identity(n, n)).norm();
            prop_assert!(error < 1e-11, "error {error:e}");
        }
    }
}
