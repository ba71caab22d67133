//! A parameter with its deviation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Value {
    /// Value.
    pub value: f64,
    /// Standard deviation; none where it was not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Unit.
    pub unit: String,
}

impl Value {
    pub(crate) fn new(value: f64, std: f64, unit: String) -> Self {
        Self {
            value,
            std: std.is_finite().then_some(std),
            unit,
        }
    }
}
