//! The real Schur form, what to do where the QR iteration stands still, and the eigenvalues on its diagonal.

use super::{finite, square};
use crate::CoreError;
use nalgebra::{DMatrix, DVector, Schur};
use num_complex::Complex;

/// Reflections that are tried.
const REFLECTIONS: usize = 4;

/// Times the rounding of the matrix that the form may be off.
const ROUNDING: f64 = 1e2 * f64::EPSILON;

/// `(Q, T)` with `A = Q T Q^T` of a square matrix, Q orthogonal, T triangular but for blocks of two on its diagonal.
///
/// The iteration takes double shifts and no others, and can go round in circles, on the matrix of a permutation for instance. A
/// reflection of the states that has nothing to do with it makes another matrix of it, with the same form.
///
/// # Errors
/// [`CoreError::Dimension`] if it is not square, [`CoreError::NotFinite`] if an entry is not finite, [`CoreError::NoConvergence`].
pub fn real_schur(a: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>), CoreError> {
    square("real Schur form: matrix", a)?;
    finite("real Schur form: matrix", a)?;
    let reflected = |k: usize| {
        // Numbers that follow no pattern.
        let normal = |i: usize| ((i + 1) as f64 * (k as f64 + 1.0).sqrt()).sin();
        let v = DVector::from_fn(a.nrows(), |i, _| normal(i)).normalize();
        let turn = DMatrix::identity(v.len(), v.len()) - 2.0 * &v * v.transpose();
        let (q, t) = form(&(&turn * a * &turn))?;
        Some((turn * q, t))
    };
    let found = form(a).or_else(|| (1..=REFLECTIONS).find_map(reflected));
    found.ok_or(CoreError::NoConvergence {
        operation: "the QR iteration for a real Schur form",
    })
}

/// Eigenvalues of a matrix in real Schur form, a pair with a positive imaginary part first.
pub(super) fn on_the_diagonal(t: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let n = t.nrows();
    let mut values = Vec::with_capacity(n);
    while values.len() < n {
        let i = values.len();
        if i + 1 < n && t[(i + 1, i)] != 0.0 {
            values.extend(of_two([
                [t[(i, i)], t[(i, i + 1)]],
                [t[(i + 1, i)], t[(i + 1, i + 1)]],
            ]));
        } else {
            values.push(Complex::new(t[(i, i)], 0.0));
        }
    }
    values
}

/// Eigenvalues of two rows: of two real ones, the nearer to `d` by the product of both distances, so that no difference is taken.
fn of_two([[a, b], [c, d]]: [[f64; 2]; 2]) -> [Complex<f64>; 2] {
    let half = 0.5 * (a - d);
    let discriminant = half * half + b * c;
    if discriminant < 0.0 {
        let (middle, imaginary) = (0.5 * (a + d), (-discriminant).sqrt());
        return [Complex::new(middle, imaginary), Complex::new(middle, -imaginary)];
    }
    let far = half + discriminant.sqrt().copysign(half);
    let near = if far == 0.0 { 0.0 } else { b * c / far };
    [Complex::new(d + far, 0.0), Complex::new(d - near, 0.0)]
}

/// What the iteration gives, if it is such a form.
fn form(a: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let n = a.nrows();
    let (q, mut t) = Schur::try_new(a.clone(), f64::EPSILON, 100 * n.max(10))?.unpack();
    t.fill_lower_triangle(0.0, 2);
    let three = (2..n).any(|i| t[(i - 1, i - 2)] != 0.0 && t[(i, i - 1)] != 0.0);
    let off = (&q * &t * q.transpose() - a).norm();
    (!three && off <= ROUNDING * n as f64 * a.norm()).then_some((q, t))
}

#[cfg(test)]
mod tests {
    use super::{form, of_two, real_schur};
    use nalgebra::DMatrix;

    /// Shifts of registers, round and open, and a full matrix.
    #[test]
    fn permutations_and_chains_have_a_form() {
        let mut reflected = 0;
        for n in [3, 4, 5, 8, 9, 16, 24] {
            let round = DMatrix::from_fn(n, n, |i, j| f64::from(i == (j + 1) % n));
            let open = DMatrix::from_fn(n, n, |i, j| f64::from(i == j + 1));
            let full = DMatrix::from_fn(n, n, |i, j| ((3 * i + 5 * j) as f64).sin());
            for a in [round.transpose(), round, open.transpose(), open, full] {
                let (q, t) = real_schur(&a).unwrap();
                reflected += usize::from(form(&a).is_none());
                assert!(
                    (&q * &t * q.transpose() - &a).norm() < 1e-13 * a.norm() * n as f64,
                    "{n}"
                );
                assert!((q.transpose() * &q - DMatrix::identity(n, n)).norm() < 1e-13 * n as f64);
                let below = (0..n).flat_map(|j| (j + 2..n).map(move |i| (i, j)));
                assert!(below.clone().all(|at| t[at] == 0.0));
                assert!((2..n).all(|i| t[(i - 1, i - 2)] == 0.0 || t[(i, i - 1)] == 0.0));
            }
        }
        assert!(reflected > 0, "the iteration needs no help any more");
    }

    #[test]
    fn two_rows_keep_the_digits_of_a_small_eigenvalue() {
        // Products and sums are those of (x - 1e-9)(x - 1), (x - 3)(x + 2), x^2 + 2 x + 5.
        for (rows, [first, second]) in [
            (
                [[1.0 - 1e-9, 1e-9], [1.0 - 2e-9, 2e-9]],
                [[1.0, 0.0], [1e-9, 0.0]],
            ),
            ([[1.0, 3.0], [2.0, 0.0]], [[3.0, 0.0], [-2.0, 0.0]]),
            ([[-1.0, 2.0], [-2.0, -1.0]], [[-1.0, 2.0], [-1.0, -2.0]]),
            ([[2.0, 0.0], [1.0, 2.0]], [[2.0, 0.0], [2.0, 0.0]]),
        ] {
            let [x, y] = of_two(rows);
            for (found, wanted) in [(x, first), (y, second)] {
                let wanted = num_complex::Complex::new(wanted[0], wanted[1]);
                assert!(
                    (found - wanted).norm() <= 1e-15 * wanted.norm(),
                    "{found} {wanted}"
                );
            }
        }
    }
}
