//! The figures by which servo axes are compared in the literature, before and after.

use crate::PipelineError;
use crate::validation::{AxisCheck, check_axis};
use lpv_core::{AxisOutput, ControllerState, Discrete, Record};
use lpv_diagnose::{Base, Explained, Motion, Trace, Track};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    let parameters = model.base.parameters();
    let [mass, viscous, offset, stiffness] =
        std::array::from_fn(|i| parameters.get(i).map_or(0.0, |p| p.value));
    let force = |m: &lti_ident::rigid_body::Motion| -> Vec<f64> {
        let motions: Vec<Motion> = m
            .position
            .iter()
            .zip(&m.velocity)
            .map(|(q, v)| Motion {
                motor_position: [*q, 0.0],
                motor_speed: [*v, 0.0],
                load_position: [*q, 0.0],
                load_speed: [*v, 0.0],
                deflection: [0.0; 2],
            })
            .collect();
        let effects = model.forces_along(track, &motions);
        m.velocity
            .iter()
            .zip(&m.acceleration)
            .zip(&effects)
            .zip(&m.position)
            .map(|(((v, a), f), q)| mass * a + viscous * v + stiffness * q + offset - f[0])
            .collect()
    };
    let closed = closed.map(|run| (first(run.outputs), first(run.inputs)));
    let output = AxisOutput::Position;
    check_axis(clock, output, record, 0, force, &first(open.outputs), closed).map(Some)
}
