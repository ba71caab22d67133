//! Errors of the outputs on judged records.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Errors on records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Errors {
    /// By output.
    pub validation: BTreeMap<String, OutputError>,
}

impl Errors {
    /// The largest error on held-out records, in multiples of the noise.
    pub(super) fn largest(&self) -> f64 {
        let all = self.validation.values().map(|e| e.over_noise);
        all.fold(0.0, f64::max)
    }
}

/// Error of one output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OutputError {
    /// Root mean square, simulated in closed loop.
    pub rms: f64,
    /// The same over the closed-loop output noise.
    pub over_noise: f64,
    /// Root mean square one step ahead; responses have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_one_step: Option<f64>,
}
