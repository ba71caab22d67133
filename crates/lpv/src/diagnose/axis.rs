//! The figures by which servo axes are compared in the literature, before and after.

use crate::PipelineError;
use crate::validation::{AxisCheck, check_axis};
use experiment_data::Bundle;
use lpv_core::{AxisOutput, ControllerState, Discrete, Record};
use lpv_diagnose::{Base, Explained, Trace, Track};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::slice::from_ref;

/// One record of a servo axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisErrors {
    /// The record.
    pub record: String,
    /// Without effects.
    pub before: AxisCheck,
    /// With the effects up to one, for all but the last.
    pub stages: Vec<AxisStage>,
    /// With those that were added.
    pub after: AxisCheck,
}

/// An axis with some of its effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisStage {
    /// The last of them.
    pub effect: String,
    /// The errors then.
    pub errors: AxisCheck,
}

/// Errors of some records; the clock comes with the highest frequency at which forces are compared.
pub(super) fn errors(
    found: &Trace,
    controller: &ControllerState,
    clock: (Discrete, f64),
    records: &[Record],
    tracks: &[Track],
) -> Result<Vec<AxisErrors>, PipelineError> {
    if !matches!(found.model.base, Base::Axis(_)) {
        return Ok(Vec::new());
    }
    let mut all = Vec::new();
    for (record, track) in records.iter().zip(tracks) {
        let check = |model: &Explained| check(model, controller, clock, record, track);
        // A machine that leaves all bounds without its loop has no figures to compare.
        let (Some(before), Some(after)) = (check(&found.bare)?, check(&found.model)?) else {
            continue;
        };
        let mut stages = Vec::new();
        let between = found.added.split_last().map_or(&[][..], |(_, earlier)| earlier);
        for a in between {
            if let Some(errors) = check(&a.then)? {
                let effect = a.effect.name.to_owned();
                stages.push(AxisStage { effect, errors });
            }
        }
        all.push(AxisErrors {
            record: record.name.clone(),
            before,
            stages,
            after,
        });
    }
    Ok(all)
}

/// What to say where the model with its effects, let run free, leaves records by more than they travel.
pub(super) fn runs_away(
    errors: &[AxisErrors],
    found: &Trace,
    tracks: [&[Track]; 2],
    bundle: &Bundle,
) -> Option<String> {
    let Base::Axis(_) = found.model.base else {
        return None;
    };
    let leaves = |track: &&Track| {
        let Some(own) = errors.iter().find(|e| e.record == track.name) else {
            return found.model.open_loop(track).is_none();
        };
        let [before, after] = [&own.before, &own.after].map(|check| check.open_loop_position_rms);
        after > before && after > Track::travel(from_ref(track), 0)
    };
    let tracks = tracks.into_iter().flatten().filter(leaves);
    let left: Vec<&str> = tracks.map(|t| t.name.as_str()).collect();
    let of_input = bundle.description().channels.input.columns.first()?;
    (!left.is_empty()).then(|| {
        format!(
            "let run free by {of_input} over a whole record, the model with its effects leaves {} by more than the record travels: small \
             forces add up; simulate it in closed loop, or over short horizons",
            left.join(", ")
        )
    })
}

/// Why motor and load took the place of a rigid axis, where they did.
pub(super) fn with_load(found: &Trace, bundle: &Bundle) -> Option<String> {
    let Base::Axis(axis) = &found.model.base else {
        return None;
    };
    let load = axis.load()?;
    let channels = &bundle.description().channels;
    let (output, unit) = (channels.output.columns.first()?, channels.output.units.first());
    let unit = unit.map_or(String::new(), |u| format!(" {u}"));
    let before = found.rigid.as_ref()?.closed_loop[0];
    Some(format!(
        "base: motor and load on a spring leave {:.3e}{unit} of {output} on held-out records, a rigid axis {before:.3e}{unit}; they swing \
         against each other at {:.4} Hz (damping {:.3}); {}",
        found.before.closed_loop[0],
        load.hz,
        load.ratio,
        match load.is_measured {
            // Its part of the mass has no effect on its motion.
            true => "the encoder is on the load".to_owned(),
            false => format!(
                "the encoder is on the motor, and the load has {:.1} % of the mass",
                100.0 * load.part
            ),
        }
    ))
}

fn check(
    model: &Explained,
    controller: &ControllerState,
    clock: (Discrete, f64),
    record: &Record,
    track: &Track,
) -> Result<Option<AxisCheck>, PipelineError> {
    let first = |pairs: Vec<[f64; 2]>| -> Vec<f64> { pairs.into_iter().map(|v| v[0]).collect() };
    let Some(open) = model.open_loop(track) else {
        return Ok(None);
    };
    let closed = model.closed_loop(controller, track);
    let force = |m: &lti_ident::rigid_body::Motion| {
        let motion = [&m.position[..], &m.velocity, &m.acceleration];
        model.inverse_dynamics(track, motion).unwrap_or_default()
    };
    let closed = closed.map(|run| (first(run.outputs), first(run.inputs)));
    let output = AxisOutput::Position;
    check_axis(clock, output, record, 0, force, &first(open.outputs), closed).map(Some)
}
