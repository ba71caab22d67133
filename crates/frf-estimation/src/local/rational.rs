//! The local rational method at one line.

use super::LocalSettings;
use super::fit::{Factorised, LocalFit, Window};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Singular values of the denominator's regressors below this part of their length before the projection are rounding: the
/// data do not show the denominator, as with a response that is a polynomial, and the smallest one serves.
const RANK_TOLERANCE: f64 = 1e-11;

/// Variable projection: numerator and transient are eliminated for each output by the same `Q`, the denominator `d` is
/// solved from what remains of all outputs, each divided by its residual deviation.
pub(crate) fn fit(window: &Window<'_>, settings: &LocalSettings) -> Result<LocalFit, f64> {
    let (rows, outputs) = window.z.shape();
    let terms = settings.denominator_degree;
    let unknowns: Vec<usize> = (0..window.data.regressors)
        .map(|j| window.response_column(j))
        .collect();
    let degrees = (rows - window.a.ncols()) as f64 - terms as f64 / outputs as f64;
    let mut weight = vec![C64::new(1.0, 0.0); rows];
    let mut deviation: Option<Vec<f64>> = None;
    let mut last = None;
    for _ in 0..=settings.iterations {
        let weighted = |m: &DMatrix<C64>| DMatrix::from_fn(rows, m.ncols(), |i, j| m[(i, j)] * weight[i]);
        let factorised = Factorised::new(weighted(&window.a))?;
        let z = weighted(&window.z);
        let projected = factorised.project(&z);
        let remainder = factorised.remainder(&z, &projected);
        let sigma = deviation
            .take()
            .unwrap_or_else(|| deviations(&remainder, &z, degrees));
        // Phi_i = r^s z_i, s = 1..terms, for each output: what the denominator adds to the left-hand side.
        let phi: Vec<DMatrix<C64>> = (0..outputs)
            .map(|i| {
                DMatrix::from_fn(rows, terms, |row, s| {
                    z[(row, i)] * window.r[row].powi(s as i32 + 1)
                })
            })
            .collect();
        let phi_projected: Vec<_> = phi.iter().map(|p| factorised.project(p)).collect();
        let mut stacked = DMatrix::zeros(rows * outputs, terms);
        let mut right = DVector::zeros(rows * outputs);
        let mut size = 0.0;
        for i in 0..outputs {
            let scale = C64::new(1.0 / sigma[i], 0.0);
            let left = factorised.remainder(&phi[i], &phi_projected[i]) * scale;
            size += (phi[i].norm() / sigma[i]).powi(2);
            stacked.rows_mut(i * rows, rows).copy_from(&left);
            right
                .rows_mut(i * rows, rows)
                .copy_from(&(remainder.column(i) * -scale));
        }
        let (d, d_covariance) = denominator(stacked.clone(), &right, RANK_TOLERANCE * size.sqrt())?;
        let residual = &stacked * &d - right;
        let v = DMatrix::from_fn(rows, outputs, |row, i| residual[i * rows + row] * sigma[i]);
        let mut response = DMatrix::zeros(outputs, unknowns.len());
        let mut factor = factorised.inverse_block(&unknowns);
        for i in 0..outputs {
            // theta_i = A^+ (z_i + Phi_i d); its error gets that of d through L = A^+ Phi_i.
            let l = factorised.solve_rows(&unknowns, &phi_projected[i]);
            let base = factorised.solve_rows(&unknowns, &projected.columns(i, 1).clone_owned());
            let theta = base + &l * &d;
            response.row_mut(i).copy_from(&theta.transpose());
            let l = l / C64::new(sigma[i], 0.0);
            factor += &l * &d_covariance * l.adjoint() / C64::new(outputs as f64, 0.0);
        }
        for (row, w) in weight.iter_mut().enumerate() {
            let value = (0..terms).fold(C64::new(1.0, 0.0), |sum, s| {
                sum + d[s] * window.r[row].powi(s as i32 + 1)
            });
            // A zero of the denominator on a line would make this line the only one that counts.
            let inverse = value.inv();
            *w = if inverse.norm() < 1e6 {
                inverse
            } else {
                C64::new(1.0, 0.0)
            };
        }
        deviation = Some(deviations(&v, &z, degrees));
        last = Some(LocalFit {
            response,
            covariance: (v.adjoint() * &v).transpose() / C64::new(degrees, 0.0),
            factor: factor.conjugate(),
            condition: factorised.condition,
        });
    }
    // The range above is never empty.
    last.ok_or(f64::INFINITY)
}

/// Residual deviation by output, kept above rounding.
fn deviations(v: &DMatrix<C64>, z: &DMatrix<C64>, degrees: f64) -> Vec<f64> {
    let pairs = v.column_iter().zip(z.column_iter());
    let deviation = pairs.map(|(v, z)| (v.norm() / degrees.sqrt()).max(1e-13 * z.norm()));
    deviation.map(|s| if s > 0.0 { s } else { 1.0 }).collect()
}

/// Least squares for `d` by the singular value decomposition, and its covariance for residuals of unit variance.
fn denominator(
    stacked: DMatrix<C64>,
    right: &DVector<C64>,
    tolerance: f64,
) -> Result<(DVector<C64>, DMatrix<C64>), f64> {
    let terms = stacked.ncols();
    let mut d = DVector::zeros(terms);
    let mut covariance = DMatrix::zeros(terms, terms);
    if terms == 0 {
        return Ok((d, covariance));
    }
    if !stacked.iter().all(|v| v.re.is_finite() && v.im.is_finite()) {
        return Err(f64::INFINITY);
    }
    let svd = stacked
        .try_svd(true, true, f64::EPSILON, 1000)
        .ok_or(f64::INFINITY)?;
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Err(f64::INFINITY);
    };
    for (i, &value) in svd.singular_values.iter().enumerate() {
        if value > tolerance {
            let v = v_t.row(i).adjoint();
            d += &v * (u.column(i).dotc(right) / value);
            covariance += &v * v.adjoint() / C64::new(value * value, 0.0);
        }
    }
    Ok((d, covariance))
}
