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

/// Steps of a counter that starts again from zero where it is full, as if it went on; `turn` is a further number at which it is.
pub(crate) fn steps_of_counter(counts: &[f64], turn: Option<f64>) -> Vec<f64> {
    /// Of 8, 16, 24 and 32 bits, the last also in seconds or milliseconds of a counter of microseconds.
    const FULL: [f64; 6] = [
        256.0,
        65_536.0,
        16_777_216.0,
        4_294_967_296.0,
        4_294_967.296,
        4_294.967_296,
    ];
    /// Part of a step by which one over the end may differ from the usual one.
    const NEAR: f64 = 0.3;
    let mut steps: Vec<f64> = counts.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.is_empty() {
        return steps;
    }
    let usual = lpv_numerics::statistics::median(&steps);
    for full in FULL.into_iter().chain(turn) {
        let is_over = |d: f64| d < 0.0 && (d + full - usual).abs() <= NEAR * usual.abs();
        steps.iter_mut().filter(|d| is_over(**d)).for_each(|d| *d += full);
    }
    steps
}

/// Whether any of some signals is no constant.
pub(crate) fn moves(signals: &Signals) -> bool {
    signals.columns.iter().any(|c| c.iter().any(|v| *v != c[0]))
}
