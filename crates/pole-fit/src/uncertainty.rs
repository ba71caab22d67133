//! From normal matrices to the covariance of the poles, and what the cost should be if only noise is left.
//!
//! With circular noise of covariance `Sigma` a line, half of the real part goes into each real equation, so that
//! `cov(alpha) = R^-1 G R^-1 / 2` with `R = Re sum J^H K J` and `G = Re sum J^H K Sigma K J`; for maximum likelihood
//! `K = Sigma^-1` and `G = R`. A weight from an estimated covariance with `nu` degrees of freedom and `p` outputs
//! scatters: `E[W^-1] = 1/(nu-p)` and `E[W^-2] = nu / ((nu-p)((nu-p)^2-1))` of a complex Wishart matrix give the
//! factor `nu^2 / ((nu-p)^2 - 1)` on the covariance computed from the estimated weights.

use crate::basis::Recurrence;
use crate::columns::{Columns, add_product, blocks, product, real_product};
use crate::model::{Reduced, Setup};
use crate::search::{Found, tangent};
use crate::{PoleFitError, Weighting};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen};
use num_complex::Complex;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// Covariance of the denominator in its tangent directions.
pub(crate) struct DenominatorCovariance {
    pub(crate) tangent: DMatrix<f64>,
    pub(crate) covariance: DMatrix<f64>,
    /// Condition number of the reduced normal matrix, its diagonal scaled to one.
    pub(crate) condition: f64,
}

pub(crate) fn denominator_covariance(
    setup: &Setup<'_>,
    found: &Found,
    weighting: Weighting,
) -> Result<DenominatorCovariance, PoleFitError> {
    let failed = || PoleFitError::Eigenvalues {
        order: setup.order,
        what: "the covariance of the poles",
    };
    let q = tangent(&found.point.alpha);
    if q.ncols() == 0 {
        let covariance = DMatrix::zeros(0, 0);
        return Ok(DenominatorCovariance {
            tangent: q,
            covariance,
            condition: 1.0,
        });
    }
    let model = found.point.model(setup);
    let reduced = found
        .point
        .reduce(setup, &found.basis, &model)
        .ok_or_else(failed)?;
    let r = q.tr_mul(&reduced.m) * &q;
    let (inverse, condition) = scaled_inverse(&r).ok_or_else(failed)?;
    let covariance = match weighting {
        Weighting::Covariance => &inverse * 0.5,
        _ => {
            let g = sandwich(setup, found, &reduced, &q, &model.v);
            &inverse * g * &inverse * 0.5
        }
    };
    Ok(DenominatorCovariance {
        tangent: q,
        covariance: covariance * inflation(setup, weighting),
        condition,
    })
}

/// The inverse through the eigenvalues of the matrix scaled to unit diagonal. Directions that the data do not
/// determine get a huge variance instead of an infinite one.
fn scaled_inverse(r: &DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
    let n = r.nrows();
    let least = f64::MIN_POSITIVE + f64::EPSILON * r.diagonal().amax();
    let scale = DVector::from_fn(n, |i, _| 1.0 / r[(i, i)].max(least).sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| 0.5 * (r[(i, j)] + r[(j, i)]) * scale[i] * scale[j]);
    if !scaled.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(scaled, f64::EPSILON, 1000)?;
    let largest = eigen.eigenvalues.max();
    let floor = f64::EPSILON * largest;
    let mut inverse = DMatrix::zeros(n, n);
    for (i, &value) in eigen.eigenvalues.iter().enumerate() {
        let v = eigen.eigenvectors.column(i).component_mul(&scale);
        inverse.ger(1.0 / value.max(floor), &v, &v, 1.0);
    }
    let condition = largest / eigen.eigenvalues.min().max(floor);
    Some((inverse, condition))
}

/// `Re sum_k Z^H Sigma Z` with `Z = K J`, `K` diagonal, and `J` the Jacobian after the numerators are eliminated.
fn sandwich(
    setup: &Setup<'_>,
    found: &Found,
    reduced: &Reduced,
    q: &DMatrix<f64>,
    model: &Columns,
) -> DMatrix<f64> {
    let (lines, n_b) = (setup.lines, setup.n_b);
    let (n, n_c, n_f) = (lines.len(), lines.channels(), q.ncols());
    let elimination = &reduced.elimination * q;
    let (of_basis, point) = (&found.basis.q, &found.point);
    let (over_a, over_ta) = (point.over_a.column(0), point.over_ta.column(0));
    let (mut z, mut sigma_z) = (Columns::zeros(n, n_c * n_f), Columns::zeros(n, n_c * n_f));
    let (mut sum, mut direction, mut jacobian) =
        (Columns::zeros(n, 1), Columns::zeros(n, 1), Columns::zeros(n, 1));
    for d in 0..n_f {
        of_basis.combine(q.column(d).as_slice(), sum.whole_mut(0));
        product(sum.column(0), over_a, direction.column_mut(0));
        for c in 0..n_c {
            let column = elimination.column(d);
            of_basis.combine(&column.as_slice()[c * n_b..(c + 1) * n_b], sum.whole_mut(0));
            product(sum.column(0), over_ta, jacobian.column_mut(0));
            add_product(model.column(c), direction.column(0), jacobian.column_mut(0));
            let weight = &lines.diagonal()[c * n..(c + 1) * n];
            let ((re, im), (to_re, to_im)) = (jacobian.column(0), z.column_mut(d * n_c + c));
            real_product(weight, re, to_re);
            real_product(weight, im, to_im);
        }
    }
    // Sigma = S^T (x) C_V: first C_V along the outputs, then S along the inputs.
    let (n_y, n_u) = (lines.n_y, lines.n_u);
    for block in blocks(n) {
        let (mut c_v, mut s) = (
            Columns::zeros(block.len(), n_y * n_y),
            Columns::zeros(block.len(), n_u * n_u),
        );
        for (at, k) in block.clone().enumerate() {
            let (of_outputs, of_inputs) = lines.factors(k);
            of_outputs
                .iter()
                .enumerate()
                .for_each(|(c, v)| c_v.set(at, c, *v));
            of_inputs.iter().enumerate().for_each(|(c, v)| s.set(at, c, *v));
        }
        let mut half = Columns::zeros(block.len(), n_c);
        for d in 0..n_f {
            half.parts_mut().fill(0.0);
            for j in 0..n_u {
                for i in 0..n_y {
                    for r in 0..n_y {
                        let from = z.part(d * n_c + j * n_y + r, &block);
                        add_product(c_v.column(r * n_y + i), from, half.column_mut(j * n_y + i));
                    }
                }
            }
            for j in 0..n_u {
                for l in 0..n_u {
                    for i in 0..n_y {
                        let to = sigma_z.part_mut(d * n_c + j * n_y + i, &block);
                        add_product(s.column(j * n_u + l), half.column(l * n_y + i), to);
                    }
                }
            }
        }
    }
    let mut g = DMatrix::zeros(n_f, n_f);
    let tall = |of| MatRef::from_column_major_slice(of, 2 * n * n_c, n_f);
    let target = MatMut::from_column_major_slice_mut(g.as_mut_slice(), n_f, n_f);
    let (z, sigma_z) = (tall(z.parts()), tall(sigma_z.parts()));
    matmul(target, Accum::Replace, z.transpose(), sigma_z, 1.0, Par::Seq);
    g
}

fn inflation(setup: &Setup<'_>, weighting: Weighting) -> f64 {
    let nu = setup.lines.degrees_of_freedom;
    if nu.is_infinite() {
        return 1.0;
    }
    let p = match weighting {
        Weighting::Covariance => setup.lines.n_y as f64,
        Weighting::DiagonalCovariance => 1.0,
        Weighting::Relative | Weighting::Uniform => return 1.0,
    };
    nu * nu / ((nu - p).powi(2) - 1.0)
}

/// Covariance of `(Re, Im)` of each root of `sum_j alpha_j p_j`, by `d lambda = -p(lambda)^T d alpha / a'(lambda)`.
pub(crate) fn root_covariance(
    recurrence: &Recurrence,
    alpha: &DVector<f64>,
    denominator: &DenominatorCovariance,
    root: C64,
) -> Matrix2<f64> {
    let (_, slope) = recurrence.value_and_slope(alpha, root);
    let p = recurrence.values(root);
    let q = &denominator.tangent;
    let mut gradient = DMatrix::zeros(2, q.ncols());
    for d in 0..q.ncols() {
        let change: C64 = -p.iter().zip(q.column(d).iter()).map(|(p, q)| p * *q).sum::<C64>() / slope;
        gradient[(0, d)] = change.re;
        gradient[(1, d)] = change.im;
    }
    let covariance = &gradient * &denominator.covariance * gradient.transpose();
    Matrix2::new(
        covariance[(0, 0)],
        covariance[(0, 1)],
        covariance[(1, 0)],
        covariance[(1, 1)],
    )
}

/// Mean and standard deviation of the cost if the model is right and the covariance too.
pub(crate) fn expected_cost(setup: &Setup<'_>, weighting: Weighting) -> (f64, f64) {
    let lines = setup.lines;
    let (n, n_c) = (lines.len() as f64, lines.channels() as f64);
    // Each unknown takes half a complex equation out of the residual.
    let share = (1.0 - 0.5 * setup.unknowns() as f64 / (n * n_c)).max(0.0);
    let nu = lines.degrees_of_freedom;
    if weighting == Weighting::Covariance {
        if nu.is_infinite() {
            return (n * n_c * share, (n * n_c * share).sqrt());
        }
        // n_u tr A and n_u tr A^2 + n_u^2 tr(A)^2 of A = nu W^-1, from the moments of a complex inverse Wishart matrix.
        let (p, m) = (lines.n_y as f64, lines.n_u as f64);
        let gap = nu - p;
        let mean = nu * m * p / gap;
        let below = gap * (gap * gap - 1.0);
        let square = nu * nu * (m * nu * p + m * m * (p * p * gap + p)) / below;
        let variance = (square - mean * mean).max(0.0);
        return (n * mean * share, (n * variance * share).sqrt());
    }
    let size = lines.channels();
    let mut sigma = vec![ZERO; size * size];
    let (mut mean, mut variance) = (0.0, 0.0);
    for k in 0..lines.len() {
        lines.covariance(k, &mut sigma);
        for d in 0..size {
            mean += lines.weight(k, d) * sigma[d * size + d].re;
            for c in 0..size {
                variance += lines.weight(k, c) * lines.weight(k, d) * sigma[d * size + c].norm_sqr();
            }
        }
    }
    // The mean of 1 / (an estimated variance) exceeds 1 / (the variance).
    let factor = match weighting {
        Weighting::DiagonalCovariance if nu.is_finite() => nu / (nu - 1.0),
        _ => 1.0,
    };
    (
        mean * share * factor,
        variance.max(0.0).sqrt() * share.sqrt() * factor,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Basis;

    #[test]
    fn root_sensitivity_meets_finite_differences() {
        let z: Vec<C64> = (1..100)
            .map(|k| C64::from_polar(1.0, 0.012 * f64::from(k)))
            .collect();
        let basis = Basis::new(&z, &vec![1.0; z.len()], 4).unwrap();
        let pair = |r: f64, angle: f64, z: C64| z * z - z * (2.0 * r * angle.cos()) + r * r;
        let values: Vec<C64> = z
            .iter()
            .map(|&z| pair(0.98, 0.4, z) * pair(0.95, 0.9, z))
            .collect();
        let alpha = basis.project(5, &values).normalize();
        let q = tangent(&alpha);
        let roots = basis.recurrence.roots(&alpha).unwrap();
        for d in 0..4 {
            let moved = |h: f64| basis.recurrence.roots(&(&alpha + q.column(d) * h)).unwrap();
            let (plus, minus) = (moved(1e-6), moved(-1e-6));
            let mut covariance = DMatrix::zeros(4, 4);
            covariance[(d, d)] = 1.0;
            let denominator = DenominatorCovariance {
                tangent: q.clone(),
                covariance,
                condition: 1.0,
            };
            for i in 0..4 {
                let change = (plus[i] - minus[i]) / 2e-6;
                let c = root_covariance(&basis.recurrence, &alpha, &denominator, roots[i]);
                let expected = nalgebra::vector![change.re, change.im];
                let error = (c - expected * expected.transpose()).norm();
                assert!(error < 1e-6 * c.norm(), "direction {d} root {i}: {error:e}");
            }
        }
    }

    #[test]
    fn undetermined_directions_get_a_huge_variance() {
        let r = nalgebra::dmatrix![1.0, 1.0; 1.0, 1.0];
        let (inverse, condition) = scaled_inverse(&r).unwrap();
        assert!(condition > 1e15);
        assert!(inverse[(0, 0)] > 1e14);
    }
}
