//! Small figures of one signal.

use lpv_core::Record;

/// Smallest and largest value; (inf, -inf) for none.
pub(crate) fn range(x: &[f64]) -> (f64, f64) {
    x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| {
        (l.min(v), h.max(v))
    })
}

/// Cuts a record after so many samples.
pub(crate) fn keep_first(record: &mut Record, samples: usize) {
    let groups = [
        &mut record.outputs,
        &mut record.inputs,
        &mut record.references,
        &mut record.scheduling,
        &mut record.auxiliary,
        &mut record.injection,
    ];
    let columns = groups.into_iter().flat_map(|group| &mut group.columns);
    columns.for_each(|column| column.truncate(samples));
}

/// Mean.
pub(crate) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// Root mean square about the mean.
pub(crate) fn deviation(x: &[f64]) -> f64 {
    let m = mean(x);
    (x.iter().map(|v| (v - m).powi(2)).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

/// The value below which the part `q` of the values lies; NaN for none.
pub(crate) fn quantile(x: &[f64], q: f64) -> f64 {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted
        .get((q * last as f64).round() as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

/// The middle value; NaN for none.
pub(crate) fn median(x: &[f64]) -> f64 {
    quantile(x, 0.5)
}

/// `100 (1 - |y - yh| / |y - mean y|)`, the fit percent of system identification.
pub(crate) fn fit_percent(measured: &[f64], error: &[f64]) -> f64 {
    let size = deviation(measured) * (measured.len() as f64).sqrt();
    finite(100.0 * (1.0 - error.iter().map(|e| e * e).sum::<f64>().sqrt() / size))
}

/// A figure that a file can hold: within a thousand million either way; no number counts as the worst fit.
pub(crate) fn finite(x: f64) -> f64 {
    const MOST: f64 = 1e9;
    if x.is_nan() { -MOST } else { x.clamp(-MOST, MOST) }
}
