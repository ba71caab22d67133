//! What a user sees of an axis without a known controller, by record: its force, and its free run over stated horizons.

use super::axis::AxisErrors;
use crate::PipelineError;
use experiment_data::Bundle;
use lpv_core::{Purpose, Record};
use lpv_diagnose::{Base, Explained, Track};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Errors of one record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordErrors {
    /// The record.
    pub record: String,
    /// `estimation` or `validation`.
    #[serde(rename = "use")]
    pub purpose: String,
    /// Whether the force or the free run over the record is further off than without the effects.
    pub worse: bool,
    /// Force of the inverse dynamics, by input.
    pub force: BTreeMap<String, ForceErrors>,
    /// Positions simulated from the recorded inputs, from measured starts.
    pub free_run: Vec<FreeRun>,
}

/// Error of the force of the inverse dynamics, without effects and with them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ForceErrors {
    /// Over the size of the force.
    pub before_percent: f64,
    /// The same with effects.
    pub after_percent: f64,
    /// Root mean square, in units of the input.
    pub before: f64,
    /// The same with effects.
    pub after: f64,
    /// Unit of the input.
    pub unit: String,
    /// Band in which forces are compared, Hz.
    pub band_hz: [f64; 2],
}

/// Errors of a free run of one length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FreeRun {
    /// Length, in units of time.
    pub horizon_s: f64,
    /// Root mean square of the error, by output.
    #[serde(flatten)]
    pub outputs: BTreeMap<String, RunErrors>,
}

/// Root mean square of the error of a free run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunErrors {
    /// Without effects.
    pub before: f64,
    /// With them.
    pub after: f64,
    /// Unit of the output.
    pub unit: String,
}

/// Horizons beside the record itself, in units of time.
const HORIZONS: [f64; 2] = [0.1, 1.0];
/// Most runs of one length in a record.
const RUNS: usize = 20;

/// Errors by record, held-out ones first. `axis` and `records` are in one order, `axis` without records that a model leaves.
pub(super) fn of_records(
    [bare, model]: [&Explained; 2],
    bundle: &Bundle,
    axis: &[AxisErrors],
    records: &[&Record],
    tracks: &[&Track],
) -> Result<Vec<RecordErrors>, PipelineError> {
    let channels = &bundle.description().channels;
    let unit = |units: &[String]| units.first().cloned().unwrap_or_default();
    let mut all = Vec::new();
    for (record, track) in records.iter().zip(tracks) {
        let Some(errors) = axis.iter().find(|a| a.record == record.name) else {
            continue;
        };
        let (before, after) = (&errors.before, &errors.after);
        let force = ForceErrors {
            before_percent: before.force_percent,
            after_percent: after.force_percent,
            before: before.force_rms,
            after: after.force_rms,
            unit: unit(&channels.input.units),
            band_hz: [0.0, before.force_band_hz],
        };
        let output = record.outputs.names[0].clone();
        let length = track.step * record.len() as f64;
        let run = |horizon_s: f64, before: f64, after: f64| {
            let unit = unit(&channels.output.units);
            FreeRun {
                horizon_s,
                outputs: BTreeMap::from([(output.clone(), RunErrors { before, after, unit })]),
            }
        };
        let mut free_run = Vec::new();
        // What swings on a spring within a few samples, no few readings tell the start of; it forgets where it began.
        let is_free = matches!(&model.base, Base::Axis(axis) if axis.stiffness().is_none());
        for horizon in HORIZONS.into_iter().filter(|h| is_free && *h < length) {
            let found = [bare, model].map(|m| free(m, record, track, horizon));
            let [before, after] = found;
            if let (Some(before), Some(after)) = (before?, after?) {
                free_run.push(run(horizon, before, after));
            }
        }
        let (before, after) = (before.open_loop_position_rms, after.open_loop_position_rms);
        free_run.push(run(length, before, after));
        all.push(RecordErrors {
            record: record.name.clone(),
            purpose: match record.purpose {
                Purpose::Validation => "validation",
                Purpose::Estimation => "estimation",
            }
            .to_owned(),
            worse: force.after_percent > force.before_percent || after > before,
            force: BTreeMap::from([(record.inputs.names[0].clone(), force)]),
            free_run,
        });
    }
    all.sort_by_key(|r| r.purpose == "estimation");
    Ok(all)
}

/// Root mean square of the errors of free runs of one length, spread over the record; none where it is shorter than what tells how a
/// run begins, or where the model leaves all bounds.
fn free(
    model: &Explained,
    record: &Record,
    track: &Track,
    horizon: f64,
) -> Result<Option<f64>, PipelineError> {
    let samples = (horizon / track.step).round() as usize;
    if samples < Track::LEAST || samples > record.len() {
        return Ok(None);
    }
    let runs = (record.len() / samples).min(RUNS);
    let (mut squares, mut count) = (0.0, 0);
    for i in 0..runs {
        let first = i * (record.len() - samples) / runs.max(1);
        let part = track.part(&record.part(first..first + samples))?;
        let Some(found) = model.open_loop(&part) else {
            return Ok(None);
        };
        squares += found.error(&part).iter().map(|e| e[0] * e[0]).sum::<f64>();
        count += samples;
    }
    Ok(Some((squares / count.max(1) as f64).sqrt()))
}
