//! The flexible poles of the default positioning machine, frozen at a carriage position.
#![allow(dead_code, reason = "the example and the tests use different parts")]

use lpv_core::linalg::eigenvalues;
use lpv_core::nalgebra::DMatrix;
use num_complex::Complex;

const STIFFNESS: [f64; 2] = [622.525_297_598_711_2, 32.671_793_879_468_22];
const DAMPING: [f64; 2] = [2.049_889_206_467_34, 0.077_998_162_433_953_48];

/// `N(p) = E(p)^T M^-1 E(p)`: with the deflections `e` across the two spring-damper pairs the rigid motion drops out,
/// `e'' + N(p) (D e' + K e) = 0`.
fn compliance_of_inertia(p: f64) -> [[f64; 2]; 2] {
    let (m1, m2, j1, j2) = (12.0, 20.0, 0.25, 1.2);
    [
        [1.0 / m1 + 1.0 / m2 + p * p / j2, p / j2],
        [p / j2, 1.0 / j1 + 1.0 / j2],
    ]
}

/// Continuous poles at position `p` (length units of the machine), radians per unit of time.
pub(crate) fn continuous_poles(p: f64) -> Vec<Complex<f64>> {
    let n = compliance_of_inertia(p);
    let a = DMatrix::from_fn(4, 4, |i, j| match (i, j) {
        (0, 2) | (1, 3) => 1.0,
        (0 | 1, _) => 0.0,
        (_, 0 | 1) => -n[i - 2][j] * STIFFNESS[j],
        _ => -n[i - 2][j - 2] * DAMPING[j - 2],
    });
    eigenvalues(&a).unwrap_or_default()
}

/// `det(s^2 I + N(p) (D s + K))`, zero at the poles.
pub(crate) fn characteristic(p: f64, s: Complex<f64>) -> Complex<f64> {
    let n = compliance_of_inertia(p);
    let entry =
        |i: usize, j: usize| n[i][j] * (DAMPING[j] * s + STIFFNESS[j]) + if i == j { s * s } else { s * 0.0 };
    entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0)
}

/// Poles sampled at rate 20 at `count` equidistant positions of [-0.3, 0.3], conjugates included.
pub(crate) fn sampled_poles(count: usize) -> Vec<Complex<f64>> {
    (0..count)
        .flat_map(|k| continuous_poles(-0.3 + 0.6 * k as f64 / (count - 1) as f64))
        .map(|s| (s / 20.0).exp())
        .collect()
}
