//! The local polynomial method at one line.

use super::LocalSettings;
use super::fit::{Factorised, LocalFit, Window};
use num_complex::Complex;

/// Least squares `Z^T = A Theta^T + V^T`; `C_V = V V^H / (rows - unknowns)`.
pub(crate) fn fit(window: &Window<'_>, _: &LocalSettings) -> Result<LocalFit, f64> {
    let factorised = Factorised::new(window.a.clone())?;
    let unknowns: Vec<usize> = (0..window.data.regressors)
        .map(|j| window.response_column(j))
        .collect();
    let projected = factorised.project(&window.z);
    let v = factorised.remainder(&window.z, &projected);
    let degrees = (window.a.nrows() - window.a.ncols()) as f64;
    Ok(LocalFit {
        response: factorised.solve_rows(&unknowns, &projected).transpose(),
        // The columns of v are outputs: (V V^H)[i, k] = sum v_i conj(v_k).
        covariance: (v.adjoint() * &v).transpose() / Complex::new(degrees, 0.0),
        factor: factorised.inverse_block(&unknowns).conjugate(),
        condition: factorised.condition,
    })
}
