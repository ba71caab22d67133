//! Where records begin, if a drift of the sensor is found beside other effects: a beginning that was told by a model without these is wrong
//! by something that dies out, and so does such a drift.

use crate::PipelineError;
use lpv_diagnose::{Case, Explained, Trace, Track, observer, trace};

const DRIFT: &str = "sensor-drift";

/// What is found with other beginnings.
pub(super) struct Begun {
    pub(super) found: Trace,
    /// Fitted and judged records.
    pub(super) tracks: [Vec<Track>; 2],
}

/// What is found from the beginnings that the other effects tell; none where it does not do without the drift.
pub(super) fn look(
    case: &Case<'_>,
    found: &Trace,
    told: &[Vec<Track>; 2],
) -> Result<Option<Begun>, PipelineError> {
    let Some(model) = without_drift(&found.model) else {
        return Ok(None);
    };
    let [fitted, judged] = told
        .each_ref()
        .map(|t| observer::settled(&model, case.controller, t));
    let again = trace(&Case {
        fitted: &fitted,
        judged: &judged,
        ..*case
    })?;
    Ok(does_without(&again, found).then_some(Begun {
        found: again,
        tracks: [fitted, judged],
    }))
}

/// A model without its drift, where there is one beside other effects.
fn without_drift(model: &Explained) -> Option<Explained> {
    let is_drift = |name: &str| name == DRIFT;
    let counts = |name: &str| !is_drift(name) && name != "quantization";
    let names = || model.effects.iter().map(|(e, _)| e.name);
    // The beginnings of an axis whose load was found were told by a rigid one.
    if !(names().any(is_drift) && (model.base.has_load() || names().any(counts))) {
        return None;
    }
    let mut model = model.clone();
    model.effects.retain(|(e, _)| !is_drift(e.name));
    Some(model)
}

/// Whether what was found with other beginnings explains as much without the drift.
fn does_without(again: &Trace, found: &Trace) -> bool {
    /// Factor between squared errors that are as large.
    const AS_MUCH: f64 = 1.1;
    let drifts = again.added.iter().any(|a| a.effect.name == DRIFT);
    !drifts && again.after.cost <= AS_MUCH * found.after.cost
}
