//! Where records begin: the model that was found tells it better than the first samples. And what is found where an effect lives off a wrong
//! beginning: a drift of the sensor beside other effects, since a beginning that was told by a model without these is wrong by something
//! that dies out, as such a drift does; or a mass that comes soon after the start of one record, where it may have been there.

use super::noise::roughness;
use crate::PipelineError;
use lpv_diagnose::catalogue::from_the_start;
use lpv_diagnose::{Case, Explained, Trace, Track, Verdict, begun, observer, trace};

const DRIFT: &str = "sensor-drift";

/// What is found with other beginnings.
pub(super) struct Begun {
    pub(super) found: Trace,
    /// Fitted and judged records.
    pub(super) tracks: [Vec<Track>; 2],
}

/// What is found where the model tells the beginnings, with the noise that it sees.
pub(super) struct Seen {
    pub(super) found: Trace,
    pub(super) tracks: [Vec<Track>; 2],
    pub(super) noise: [f64; 2],
}

/// Looks again from where the model that was found lets the records begin, and with the noise that it sees: where something was missing, or where
/// the noise is clearly smaller than was thought, behind which something may be missing.
pub(super) fn by_the_model(
    case: &Case<'_>,
    (tracks, found): ([Vec<Track>; 2], Trace),
    told: &[Vec<Track>; 2],
) -> Result<Seen, PipelineError> {
    const CLEARLY: f64 = 0.8;
    let is_missing = found.verdict != Verdict::NothingMissing;
    let seen = roughness(&found.model, case.controller, &tracks[0]);
    let mut less = seen.iter().zip(case.noise);
    if !(is_missing || less.any(|(seen, thought)| *seen < CLEARLY * thought)) {
        return Ok(Seen {
            found,
            tracks,
            noise: case.noise,
        });
    }
    let tracks = begun(case, &found.model, told);
    let seen = roughness(&found.model, case.controller, &tracks[0]);
    let noise = std::array::from_fn(|i| case.noise[i].min(seen[i]));
    let found = trace(&Case {
        noise,
        fitted: &tracks[0],
        judged: &tracks[1],
        seeks_load: found.rigid.is_some() || !is_missing,
        ..*case
    })?;
    Ok(Seen { found, tracks, noise })
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
