//! What is left of an error, in `diagnosis.json`.

use experiment_data::Bundle;
use lpv_diagnose::{Character, Left};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Tests of what is left, the surest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftTests {
    /// Without effects.
    pub before: Vec<LeftTest>,
    /// With those that were added.
    pub after: Vec<LeftTest>,
}

impl LeftTests {
    /// What tests are sure of after the effects, in a line.
    pub(super) fn text(&self) -> String {
        /// Probability by chance from which a test is not sure.
        const CHANCE: f64 = 0.01;
        /// How many are told.
        const TOLD: usize = 3;
        let sure = self.after.iter().take_while(|t| t.adjusted < CHANCE).take(TOLD);
        let told: Vec<String> = sure
            .map(|t| {
                format!(
                    "{} with {} ({:.2} % of the white error, probability by chance {:.0e})",
                    t.output,
                    t.signal,
                    100.0 * t.share,
                    t.adjusted
                )
            })
            .collect();
        match told.as_slice() {
            [] => format!("{} tests see nothing in what is left", self.after.len()),
            told => format!(
                "{} tests of what is left, the surest: {}",
                self.after.len(),
                told.join("; ")
            ),
        }
    }
}

/// What the white error of an output owes to a signal and its past.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftTest {
    /// The output.
    pub output: String,
    /// The signal.
    pub signal: String,
    /// Part of the square of the error that it explains.
    pub share: f64,
    /// Probability of as much by chance.
    pub p_value: f64,
    /// The same for all tests of the list together (Holm).
    pub adjusted: f64,
}

/// What an error looks like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Characterisation {
    /// Output with the largest error over its noise.
    pub channel: String,
    /// Band with the middle eighty percent of its energy, Hz.
    pub band_hz: [f64; 2],
    /// Correlation of the error with signals, the largest first.
    pub correlations: Vec<(String, f64)>,
}

impl LeftTest {
    pub(super) fn new(found: &Left, outputs: &[String]) -> Self {
        Self {
            output: outputs[found.output].clone(),
            signal: found.signal.clone(),
            share: found.share,
            p_value: found.p_value,
            adjusted: found.adjusted,
        }
    }
}

impl Characterisation {
    pub(super) fn new(found: Character, bundle: &Bundle) -> Self {
        Self {
            channel: bundle.description().channels.output.columns[found.output].clone(),
            band_hz: found.band_hz,
            correlations: found
                .correlations
                .into_iter()
                .map(|(signal, r)| (signal.to_owned(), r))
                .collect(),
        }
    }
}
