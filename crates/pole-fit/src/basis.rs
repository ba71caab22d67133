//! Real polynomials that are orthonormal on the lines, by Arnoldi iteration.
//!
//! With the inner product `<p, q> = sum_k mu_k Re(conj(p(z_k)) q(z_k))` the polynomials `p_0, p_1, ...` follow from
//! orthogonalising `z p_j` against `p_0 ... p_j`: `z p_j = sum_{i <= j+1} h_ij p_i` with a real Hessenberg matrix
//! `H`. Neither values, nor roots, nor realisations ever pass through powers of `z` (Brubeck, Nakatsukasa,
//! Trefethen, SIAM Review 63(2), 2021; for frequency responses Bultheel, Van Barel, 1995).

use crate::PoleFitError;
use crate::columns::{
    BLOCK, Columns, NOTHING, add_correlations, add_dot, add_multiples, correlate, dot, scale, totals, wide,
};
use lpv_core::linalg::eigenvalues;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// The polynomials without the lines: the constant `p_0` and `H`, `(n+1) x n`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recurrence {
    pub(crate) constant: f64,
    pub(crate) h: DMatrix<f64>,
}

impl Recurrence {
    /// `p_0 ... p_n` at a point.
    pub(crate) fn values(&self, point: C64) -> Vec<C64> {
        let mut p = Vec::with_capacity(self.h.nrows());
        self.set_values(point, &mut p);
        p
    }

    /// The same in place of what `p` held.
    pub(crate) fn set_values(&self, point: C64, p: &mut Vec<C64>) {
        p.clear();
        p.push(C64::new(self.constant, 0.0));
        for (j, column) in self.h.column_iter().enumerate() {
            let mut next = point * p[j];
            for (value, h) in p.iter().zip(column.iter()) {
                next -= value * *h;
            }
            p.push(next / column[j + 1]);
        }
    }

    /// `a(z)` and `a'(z)` of the polynomial with coefficients `alpha`.
    pub(crate) fn value_and_slope(&self, alpha: &DVector<f64>, point: C64) -> (C64, C64) {
        let p = self.values(point);
        let mut d = vec![ZERO; p.len()];
        for j in 0..p.len() - 1 {
            let mut next = p[j] + point * d[j];
            for i in 0..=j {
                next -= d[i] * self.h[(i, j)];
            }
            d[j + 1] = next / self.h[(j + 1, j)];
        }
        let sum = |v: &[C64]| alpha.iter().zip(v).map(|(a, x)| x * *a).sum::<C64>();
        (sum(&p), sum(&d))
    }

    /// Roots of `sum_j alpha_j p_j`: eigenvalues of the comrade matrix, then Newton steps. Real roots stay real and
    /// the others come in exact conjugate pairs, lowest natural frequency first.
    pub(crate) fn roots(&self, alpha: &DVector<f64>) -> Result<Vec<C64>, PoleFitError> {
        let degree = alpha.len().saturating_sub(1);
        if degree == 0 {
            return Ok(Vec::new());
        }
        let a = self.comrade(alpha);
        let failed = PoleFitError::Eigenvalues {
            order: degree,
            what: "the roots of the denominator, whose leading coefficient vanishes,",
        };
        if !a.iter().all(|v| v.abs() < 1e100) {
            return Err(failed);
        }
        let start = eigenvalues(&a)?;
        let mut roots: Vec<C64> = Vec::with_capacity(degree);
        for (i, &first) in start.iter().enumerate() {
            if first.im < 0.0 {
                continue;
            }
            let gap = start
                .iter()
                .enumerate()
                .filter(|&(j, _)| j != i)
                .map(|(_, other)| (other - first).norm())
                .fold(f64::INFINITY, f64::min);
            let mut root = first;
            for _ in 0..3 {
                let (value, slope) = self.value_and_slope(alpha, root);
                let step = value / slope;
                // A step towards a neighbour is no refinement: clusters keep their eigenvalues.
                if step.norm() > 1e-3 * gap.min(1.0) || !step.is_finite() {
                    break;
                }
                root -= step;
            }
            roots.push(root);
            if first.im > 0.0 {
                roots.push(root.conj());
            }
        }
        if roots.len() != degree {
            return Err(failed);
        }
        let key = |z: &C64| z.ln().norm();
        roots.sort_by(|x, y| key(x).total_cmp(&key(y)).then(y.im.total_cmp(&x.im)));
        Ok(roots)
    }

    /// The matrix whose left eigenvectors are `(p_0 ... p_{n-1})` at the roots.
    pub(crate) fn comrade(&self, alpha: &DVector<f64>) -> DMatrix<f64> {
        let n = alpha.len() - 1;
        let mut a = self.h.view((0, 0), (n, n)).into_owned();
        let factor = self.h[(n, n - 1)] / alpha[n];
        for j in 0..n {
            a[(j, n - 1)] -= factor * alpha[j];
        }
        a
    }

    /// Coefficients of `(z - 1) q` from those of `q`.
    pub(crate) fn times_integrator(&self, q: &DVector<f64>) -> DVector<f64> {
        let n = q.len();
        let mut product = self.h.view((0, 0), (n + 1, n)) * q;
        for i in 0..n {
            product[i] -= q[i];
        }
        product
    }
}

wide! {
    /// Takes columns of `q`, as many as there are factors, off `x`: what is left of it times the same columns.
    fn orthogonalise(q: &'a [f64], factors: &'a [f64], x: &'a mut [f64]) -> Vec<f64> {
        let length = x.len();
        let mut sums = vec![NOTHING; factors.len()];
        for (start, x) in (0..).step_by(BLOCK).zip(x.chunks_mut(BLOCK)) {
            add_multiples(q, length, start, factors, -1.0, x);
            add_correlations(q, length, start, x, &mut sums);
        }
        totals(&sums)
    }
}

wide! {
    /// Takes columns of `q` off `x` and makes what is left the next column, not of length one yet; then `x` becomes its product
    /// with `z`. The squared length of that column, and so many columns times the product.
    fn advance(
        q: &'a mut [f64],
        z: &'a [C64],
        factors: &'a [f64],
        x: &'a mut [f64],
        products: usize
    ) -> (f64, Vec<f64>) {
        let (length, lines) = (x.len(), z.len());
        let (mut square, mut sums) = (NOTHING, vec![NOTHING; products]);
        let (re, im) = x.split_at_mut(lines);
        let blocks = re.chunks_mut(BLOCK).zip(im.chunks_mut(BLOCK)).zip(z.chunks(BLOCK));
        for (start, ((re, im), z)) in (0..).step_by(BLOCK).zip(blocks) {
            for (start, part) in [(start, &mut *re), (lines + start, &mut *im)] {
                add_multiples(q, length, start, factors, -1.0, part);
                add_dot(part, part, &mut square);
                q[factors.len() * length + start..][..part.len()].copy_from_slice(part);
            }
            for ((re, im), z) in re.iter_mut().zip(im.iter_mut()).zip(z) {
                (*re, *im) = (*re * z.re - *im * z.im, *re * z.im + *im * z.re);
            }
            add_correlations(q, length, start, re, &mut sums);
            add_correlations(q, length, lines + start, im, &mut sums);
        }
        (square.iter().sum(), totals(&sums))
    }
}

/// The polynomials on the lines: column `j` holds `q_j = sqrt(mu) p_j`.
#[derive(Debug, Clone)]
pub(crate) struct Basis {
    pub(crate) recurrence: Recurrence,
    pub(crate) root_mu: Vec<f64>,
    pub(crate) q: Columns,
}

impl Basis {
    /// Orthonormal polynomials up to `degree` with weights `mu` (positive; only their ratios matter).
    pub(crate) fn new(z: &[C64], mu: &[f64], degree: usize) -> Result<Self, PoleFitError> {
        let lines = z.len();
        let total: f64 = mu.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return Err(PoleFitError::Basis { degree: 0, lines });
        }
        let root_mu: Vec<f64> = mu.iter().map(|m| (m / total).sqrt()).collect();
        let mut q = vec![0.0; 2 * lines * (degree + 1)];
        let mut next = root_mu.clone();
        next.resize(2 * lines, 0.0);
        let mut h = DMatrix::zeros(degree + 1, degree);
        // Classical Gram-Schmidt; twice is enough (Giraud, Langou, Rozloznik, Computers Math. Appl. 50(7), 2005).
        let mut second = Vec::new();
        let mut before = 0.0;
        for j in 0..=degree {
            // What the second round leaves is the next column, with which the first round of the one after it begins.
            let products = if j < degree { j + 1 } else { 0 };
            let (square, mut first) = advance(&mut q, z, &second, &mut next, products);
            if j > 0 {
                let norm = square.sqrt();
                if norm <= 1e-12 * before || !norm.is_finite() {
                    return Err(PoleFitError::Basis { degree: j, lines });
                }
                for (h, second) in h.column_mut(j - 1).iter_mut().zip(&second) {
                    *h += second;
                }
                h[(j, j - 1)] = norm;
                scale(1.0 / norm, &mut q[j * 2 * lines..(j + 1) * 2 * lines]);
                scale(1.0 / norm, &mut next);
                scale(1.0 / norm, &mut first);
                // Of the column with z times itself both are to be scaled.
                if let Some(own) = first.last_mut() {
                    *own /= norm;
                }
            }
            if j < degree {
                before = dot(&next, &next).sqrt();
                second = orthogonalise(&q, &first, &mut next);
                for (h, first) in h.column_mut(j).iter_mut().zip(&first) {
                    *h = *first;
                }
            }
        }
        Ok(Self {
            recurrence: Recurrence { constant: 1.0, h },
            root_mu,
            q: Columns::from_parts(lines, q),
        })
    }

    /// `sum_j c_j p_j` on the lines.
    pub(crate) fn combine(&self, coefficients: &[f64]) -> Vec<C64> {
        let mut sum = vec![0.0; 2 * self.root_mu.len()];
        self.q.combine(coefficients, &mut sum);
        let (re, im) = sum.split_at(self.root_mu.len());
        let lines = re.iter().zip(im).zip(&self.root_mu);
        lines.map(|((re, im), root)| C64::new(*re, *im) / *root).collect()
    }

    /// `Re sum_k conj(q_j) x_k` for `j` below `count`; of several columns `x`, one after the other.
    pub(crate) fn correlate(&self, count: usize, x: &Columns) -> DVector<f64> {
        DVector::from_vec(correlate(self.q.parts(), 2 * x.lines(), count, x.parts()))
    }

    /// Coefficients of a polynomial of degree below `count` from its values on the lines.
    pub(crate) fn project(&self, count: usize, values: &[C64]) -> DVector<f64> {
        let weighted: Vec<C64> = values.iter().zip(&self.root_mu).map(|(v, r)| v * r).collect();
        self.correlate(count, &Columns::single(&weighted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn arc(lines: usize, first: f64, last: f64) -> Vec<C64> {
        (0..lines)
            .map(|k| C64::from_polar(1.0, first + (last - first) * k as f64 / (lines - 1) as f64))
            .collect()
    }

    #[test]
    fn first_polynomials_by_hand() {
        // On z = j and z = -1 with weights 1 and 1: p_0 = 1, mean of Re z = -1/2, p_1 = (z + 1/2) / sqrt(3/4).
        let basis = Basis::new(&[C64::i(), C64::new(-1.0, 0.0)], &[1.0, 1.0], 1).unwrap();
        let p = basis.recurrence.values(C64::new(2.0, 0.0));
        assert_eq!(p[0], C64::new(1.0, 0.0));
        assert!((p[1].re - 2.5 / 0.75f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn roots_of_a_product_of_known_factors_on_a_narrow_arc() {
        let roots = [
            C64::new(0.9, 0.0),
            C64::from_polar(0.99, 0.5),
            C64::from_polar(0.99, -0.5),
            C64::from_polar(0.995, 0.65),
            C64::from_polar(0.995, -0.65),
        ];
        let z = arc(200, 0.15, 1.2);
        let basis = Basis::new(&z, &vec![1.0; 200], 5).unwrap();
        let values: Vec<C64> = z.iter().map(|z| roots.iter().map(|r| z - r).product()).collect();
        let alpha = basis.project(6, &values);
        let found = basis.recurrence.roots(&alpha).unwrap();
        for root in roots {
            let error = found
                .iter()
                .map(|f| (f - root).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(error < 1e-12, "{root}: {error:e}");
        }
        // Slope against the product rule at a point off the lines.
        let x = C64::new(0.3, 0.4);
        let expected: C64 = (0..5)
            .map(|i| (0..5).filter(|&j| j != i).map(|j| x - roots[j]).product::<C64>())
            .sum();
        let (_, slope) = basis.recurrence.value_and_slope(&alpha, x);
        assert!((slope - expected).norm() < 1e-11 * expected.norm());
    }

    #[test]
    fn multiplication_by_an_integrator() {
        let z = arc(50, 0.1, 2.0);
        let basis = Basis::new(&z, &vec![1.0; 50], 4).unwrap();
        let q = DVector::from_vec(vec![0.3, -1.0, 2.0]);
        let product = basis.recurrence.times_integrator(&q);
        let (left, right) = (basis.combine(product.as_slice()), basis.combine(q.as_slice()));
        for k in 0..50 {
            assert!((left[k] - right[k] * (z[k] - 1.0)).norm() < 1e-13);
        }
    }

    #[test]
    fn too_few_lines_are_refused() {
        let z = arc(2, 0.1, 0.2);
        assert!(Basis::new(&z, &[1.0, 1.0], 3).is_ok());
        let refusal = Basis::new(&z, &[1.0, 1.0], 4).unwrap_err();
        assert_eq!(refusal, PoleFitError::Basis { degree: 4, lines: 2 });
    }

    proptest! {
        #[test]
        fn polynomials_are_orthonormal(
            lines in 30usize..200,
            first in 0.0..1.0f64,
            width in 0.05..2.0f64,
            slope in -6.0..6.0f64,
            degree in 1usize..14,
        ) {
            let z = arc(lines, first, first + width);
            let mu: Vec<f64> = (0..lines).map(|k| (slope * k as f64 / lines as f64).exp()).collect();
            let basis = Basis::new(&z, &mu, degree).unwrap();
            for j in 0..=degree {
                let mut unit = vec![0.0; j + 1];
                unit[j] = 1.0;
                let coefficients = basis.project(degree + 1, &basis.combine(&unit));
                for i in 0..=degree {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    prop_assert!((coefficients[i] - expected).abs() < 1e-12);
                }
            }
        }
    }
}
