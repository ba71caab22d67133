//! The real Schur form, what to do where the QR iteration stands still, and the eigenvalues on its diagonal.

use super::{finite, square};
use crate::CoreError;
use nalgebra::{DMatrix, DVector, Schur};
use num_complex::Complex;

/// Reflections that are tried.
const REFLECTIONS: usize = 2;

/// Sizes, in units of rounding, below which an entry beside its diagonal counts as zero. Where many eigenvalues are the same and not
/// defective, what a sweep rounds is no smaller than the entry that it should remove.
const NEGLIGIBLE: [f64; 3] = [1.0, 8.0, 64.0];

/// Times the rounding of the matrix that the form may be off.
const ROUNDING: f64 = 1e2 * f64::EPSILON;

/// `(Q, T)` with `A = Q T Q^T` of a square matrix, Q orthogonal, T triangular but for blocks of two on its diagonal.
///
/// The iteration takes double shifts and no others, and can go round in circles, on the matrix of a permutation for instance. A
/// reflection of the states that has nothing to do with it makes another matrix of it, with the same form. Whatever was tried, the form
/// is that of A to rounding.
///
/// # Errors
/// [`CoreError::Dimension`] if it is not square, [`CoreError::NotFinite`] if an entry is not finite, [`CoreError::NoConvergence`].
pub fn real_schur(a: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>), CoreError> {
    square("real Schur form: matrix", a)?;
    finite("real Schur form: matrix", a)?;
    let scale = power_of_two(a.amax());
    let scaled = a / scale;
    for tolerance in NEGLIGIBLE {
        for k in 0..=REFLECTIONS {
            if let Some((q, t)) = reflected(&scaled, k, tolerance * f64::EPSILON) {
                let t = t * scale;
                finite("real Schur form", &t)?;
                return Ok((q, t));
            }
        }
    }
    Err(CoreError::NoConvergence {
        operation: "the QR iteration for a real Schur form",
    })
}

/// A power of two near a size, by which to divide without rounding; 1 for zero.
fn power_of_two(size: f64) -> f64 {
    match size > 0.0 {
        true => size.log2().floor().clamp(-1000.0, 1000.0).exp2(),
        false => 1.0,
    }
}

/// The form by way of a matrix reflected at a plane, the `k`-th of some; of the matrix itself for the first.
fn reflected(a: &DMatrix<f64>, k: usize, tolerance: f64) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    if k == 0 {
        return form(a, tolerance);
    }
    // Numbers that follow no pattern.
    let normal = |i: usize| ((i + 1) as f64 * (k as f64 + 1.0).sqrt()).sin();
    let v = DVector::from_fn(a.nrows(), |i, _| normal(i)).normalize();
    let turn = DMatrix::identity(v.len(), v.len()) - 2.0 * &v * v.transpose();
    let (q, t) = form(&(&turn * a * &turn), tolerance)?;
    Some((turn * q, t))
}

/// What the iteration gives, if it is such a form.
fn form(a: &DMatrix<f64>, tolerance: f64) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let n = a.nrows();
    let (q, mut t) = Schur::try_new(a.clone(), tolerance, 30 * n.max(10))?.unpack();
    t.fill_lower_triangle(0.0, 2);
    let three = (2..n).any(|i| t[(i - 1, i - 2)] != 0.0 && t[(i, i - 1)] != 0.0);
    let off = (&q * &t * q.transpose() - a).norm();
    (!three && off <= ROUNDING * n as f64 * a.norm()).then_some((q, t))
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

/// Eigenvalues of two rows. Two real ones are as far from `a` as from `d`, and the product of what is near and what is far is `b c`.
fn of_two(rows: [[f64; 2]; 2]) -> [Complex<f64>; 2] {
    let scale = power_of_two(rows.as_flattened().iter().fold(0.0, |most, v| v.abs().max(most)));
    let [[a, b], [c, d]] = rows.map(|row| row.map(|v| v / scale));
    let half = 0.5 * (a - d);
    let discriminant = half * half + b * c;
    if discriminant < 0.0 {
        let (middle, imaginary) = (0.5 * (a + d), (-discriminant).sqrt());
        return [imaginary, -imaginary].map(|imaginary| Complex::new(middle, imaginary) * scale);
    }
    let far = half + discriminant.sqrt().copysign(half);
    let near = if far == 0.0 { 0.0 } else { b * c / far };
    [a + near, d - near].map(|real| Complex::new(real * scale, 0.0))
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
                reflected += usize::from(form(&a, f64::EPSILON).is_none());
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

    /// Reflections and estimators of integrators, whose eigenvalues are the same many times over, and sizes to the edges of the numbers.
    #[test]
    fn equal_eigenvalues_and_sizes_at_the_edges_have_a_form() {
        for n in [2, 16, 23, 40, 42] {
            let ones = DMatrix::from_element(n, n, 2.0 / n as f64);
            let observed = DMatrix::from_fn(n, 2, |i, j| ((5 * i + 3 * j + 1) as f64).sin());
            let gain = DMatrix::from_fn(2, n, |i, j| ((2 * i + 7 * j) as f64).cos());
            let eye = DMatrix::identity(n, n);
            for a in [&eye - ones, &eye - observed * gain / n as f64] {
                for size in [1.0, 1e-300, 1e-170, 1e200, 1e300] {
                    let (q, t) = real_schur(&(&a * size)).unwrap();
                    let off = (&q * (t / size) * q.transpose() - &a).norm();
                    assert!(off < 1e-13 * n as f64, "{n} {size} {off}");
                }
            }
        }
    }
}
