//! Figures of frequency responses that were measured elsewhere.

use super::Spread;
use crate::account::NumberOrList;
use crate::responses::measured::Measured;
use experiment_data::Spread as Stated;
use frf_estimation::scatter;
use lpv_core::{Position, Purpose};
use schemars::JsonSchema;
use serde::Serialize;

/// One measured response, as it enters the fits.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ResponseInfo {
    /// Name of its record.
    pub name: String,
    /// `estimation` or `validation`.
    pub purpose: &'static str,
    /// Position; none without scheduling.
    #[schemars(with = "Option<NumberOrList>")]
    pub position: Option<Position>,
    /// What it is of and over; none where neither the description nor the file says.
    pub quantity: Option<&'static str>,
    /// Lines above 0 Hz.
    pub lines: usize,
    /// Lowest and highest of them, Hz.
    pub band_hz: [f64; 2],
    /// What its error is told by: `variance`, `covariance`, `coherence`, or `assumed`.
    pub error_from: &'static str,
    /// Relative standard deviation of the FRF over its lines, stated or assumed.
    pub frf_deviation: Spread,
    /// What neighbouring lines differ by, relative to their size, in the median; none of fewer than five lines.
    pub scatter: Option<f64>,
    /// What was done with it, in words.
    pub notes: Vec<String>,
}

pub(super) fn describe(measured: &Measured) -> ResponseInfo {
    let record = &measured.record;
    let lines = measured.estimate.frf().frequencies_hz();
    let deviations: Vec<f64> = (0..lines.len())
        .map(|k| measured.estimate.relative_deviation(k))
        .collect();
    ResponseInfo {
        name: record.name.clone(),
        purpose: match record.purpose {
            Purpose::Estimation => "estimation",
            Purpose::Validation => "validation",
        },
        position: record.position.clone(),
        quantity: record.quantity.map(|q| q.name()),
        lines: lines.len(),
        band_hz: [
            lines.first().copied().unwrap_or(0.0),
            lines.last().copied().unwrap_or(0.0),
        ],
        error_from: match record.spread {
            Stated::Unknown => "assumed",
            Stated::Variance(_) => "variance",
            Stated::Covariance(_) => "covariance",
            Stated::Coherence(_) => "coherence",
        },
        frf_deviation: Spread::of(&deviations),
        scatter: scatter(&record.frf),
        notes: measured.reasons.clone(),
    }
}
