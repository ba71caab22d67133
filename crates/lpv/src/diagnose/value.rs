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

impl Value {
    /// With as many digits as its deviation lets one know, six at the most.
    pub(crate) fn in_short(&self) -> String {
        let known = self
            .std
            .filter(|s| *s > 0.0)
            .map(|s| (self.value.abs() / s).log10());
        let digits = known.map_or(3, |k| (k.ceil() + 1.0).clamp(2.0, 6.0) as usize);
        format!("{} {}", digits_of(self.value, digits), self.unit)
            .trim_end()
            .to_owned()
    }
}

/// A number with so many digits.
fn digits_of(x: f64, digits: usize) -> String {
    let exponent = if x == 0.0 {
        0
    } else {
        x.abs().log10().floor() as i32
    };
    match exponent {
        -3..=5 => format!("{x:.*}", (digits as i32 - 1 - exponent).max(0) as usize),
        _ => format!("{x:.*e}", digits - 1),
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.5e}", self.value)?;
        if let Some(std) = self.std.filter(|s| *s > 0.0) {
            write!(f, " ({std:.1e})")?;
        }
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        Ok(())
    }
}
