//! Small facts about signals.

use lpv_core::Signals;
use lpv_numerics::statistics::standard_deviation;

/// `100 (1 - |y - yh| / |y - mean y|)`, the fit percent of system identification.
pub(crate) fn fit_percent(measured: &[f64], error: &[f64]) -> f64 {
    let size = standard_deviation(measured) * (measured.len() as f64).sqrt();
    finite(100.0 * (1.0 - error.iter().map(|e| e * e).sum::<f64>().sqrt() / size))
}

/// A figure that a file can hold: within a thousand million either way; no number counts as the worst fit.
pub(crate) fn finite(x: f64) -> f64 {
    const MOST: f64 = 1e9;
    if x.is_nan() { -MOST } else { x.clamp(-MOST, MOST) }
}

/// Whether any of some signals is no constant.
pub(crate) fn moves(signals: &Signals) -> bool {
    signals.columns.iter().any(|c| c.iter().any(|v| *v != c[0]))
}
