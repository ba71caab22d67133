//! Records along a moving p, for the coordinates of the small LFR.

use crate::identify::fitted_samples;
use crate::progress::Progress;
use crate::responses::{Responses, load_records, rests};
use crate::{IdentifyConfig, PipelineError};
use experiment_data::Bundle;
use lfr_fit::moving::MovingData;
use lpv_core::{Purpose, Record};
use lpv_numerics::statistics::range;

/// Part of the measured range by which a record may leave it: rounding, where p has its zero far away.
const SLACK: f64 = 4e-10;

/// What the moves of a bundle give.
#[derive(Debug, Clone)]
pub struct Moves {
    /// The records in the bundle's loop, in units of their noise; or why there are none.
    pub data: Result<MovingData, &'static str>,
    /// Records that were not used, in words.
    pub reasons: Vec<String>,
}

impl Moves {
    /// No moves, and why.
    pub fn none(why: &'static str) -> Self {
        Self {
            data: Err(why),
            reasons: Vec::new(),
        }
    }

    /// The estimation records along a moving p that stay between the measured positions.
    ///
    /// # Errors
    /// Whatever is wrong with the records or the controller.
    pub(crate) fn of(
        bundle: &Bundle,
        config: &IdentifyConfig,
        responses: &Responses,
        progress: Progress<'_>,
    ) -> Result<Self, PipelineError> {
        let description = bundle.description();
        let Some(controller) = &description.controller else {
            return Ok(Self::none(match description.channels.reference.is_empty() {
                true => {
                    "without a reference there is no loop to close, and moves are fitted in closed loop alone"
                }
                false => "the bundle has no [controller]",
            }));
        };
        let Some(noise) = responses
            .noise
            .as_deref()
            .filter(|noise| noise.iter().all(|n| *n > 0.0))
        else {
            return Ok(Self::none("the noise of a sample is not known"));
        };
        let moving = |i: usize| {
            let entry = &description.records[i];
            entry.purpose == Purpose::Estimation && entry.is_transient()
        };
        let mut records = load_records(bundle, moving, progress)?;
        for record in &mut records {
            let fitted = fitted_samples(record, config);
            record.truncate(fitted);
        }
        records.retain(|r| !rests(r, bundle));
        if records.is_empty() {
            return Ok(Self::none("no estimation record has a moving scheduling signal"));
        }
        let positions: Vec<f64> = responses
            .estimates
            .iter()
            .filter_map(|e| e.single_position())
            .collect();
        let (low, high) = range(&positions);
        let (inside, outside): (Vec<Record>, Vec<Record>) = records.into_iter().partition(|r| {
            let (least, most) = range(&r.scheduling.columns[0]);
            // What rounding puts outside is inside.
            let slack = SLACK * (high - low);
            least >= low - slack && most <= high + slack
        });
        let reasons = outside
            .iter()
            .map(|r| {
                let (least, most) = range(&r.scheduling.columns[0]);
                format!(
                    "warning: record {} goes from {least:.5} to {most:.5}, outside the measured positions {low:.5} to {high:.5}, and is not used",
                    r.name
                )
            })
            .collect();
        if inside.is_empty() {
            return Ok(Self {
                reasons,
                ..Self::none("every one leaves the measured positions")
            });
        }
        Ok(Self {
            data: Ok(MovingData::new(
                responses.clock,
                &inside,
                noise,
                Some(&controller.feedback(responses.clock)?),
            )?),
            reasons,
        })
    }
}
