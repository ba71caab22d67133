//! Where records begin, if an effect is found that lives off a wrong beginning: a drift of the sensor beside other effects, since a
//! beginning that was told by a model without these is wrong by something that dies out, as such a drift does; or a mass that comes soon
//! after the start of one record, where it may have been there.

use crate::PipelineError;
use lpv_diagnose::catalogue::from_the_start;
use lpv_diagnose::{Case, Explained, Trace, Track, observer, trace};

const DRIFT: &str = "sensor-drift";

/// What is found with other beginnings.
pub(super) struct Begun {
    pub(super) found: Trace,
    /// Fitted and judged records.
    pub(super) tracks: [Vec<Track>; 2],
}

/// What is found from the beginnings that a model without such an effect tells; none where it does not do without it.
pub(super) fn look(
    case: &Case<'_>,
    found: &Trace,
    told: &[Vec<Track>; 2],
) -> Result<Option<Begun>, PipelineError> {
    let Some((model, doubtful)) = without_drift(&found.model).or_else(|| loaded_from_the_start(&found.model))
    else {
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
    Ok(does_without(doubtful, &again, found).then_some(Begun {
        found: again,
        tracks: [fitted, judged],
    }))
}

/// A model without its drift, where there is one beside other effects.
fn without_drift(model: &Explained) -> Option<(Explained, &'static str)> {
    let is_drift = |name: &str| name == DRIFT;
    let counts = |name: &str| !is_drift(name) && name != "quantization";
    let names = || model.effects.iter().map(|(e, _)| e.name);
    // The beginnings of an axis whose load was found were told by a rigid one.
    if !(names().any(is_drift) && (model.base.has_load() || names().any(counts))) {
        return None;
    }
    let mut model = model.clone();
    model.effects.retain(|(e, _)| !is_drift(e.name));
    Some((model, DRIFT))
}

/// A model with a mass from the start of a record on, where it has one that comes later.
fn loaded_from_the_start(model: &Explained) -> Option<(Explained, &'static str)> {
    let mut effects = model.effects.iter().enumerate();
    let (i, loaded) = effects.find_map(|(i, (e, values))| Some((i, from_the_start(e, values)?)))?;
    let mut other = model.clone();
    let jump = std::mem::replace(&mut other.effects[i], loaded);
    Some((other, jump.0.name))
}

/// Whether what was found with other beginnings explains as much without an effect.
fn does_without(effect: &str, again: &Trace, found: &Trace) -> bool {
    /// Factor between squared errors that are as large.
    const AS_MUCH: f64 = 1.1;
    let has = again.added.iter().any(|a| a.effect.name == effect);
    !has && again.after.cost <= AS_MUCH * found.after.cost
}
