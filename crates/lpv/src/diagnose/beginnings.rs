//! Where records begin, if an effect is found that lives off a wrong beginning: a drift of the sensor beside other effects, since a
//! beginning that was told by a model without these is wrong by something that dies out, as such a drift does; a mass that comes soon
//! after the start of one record, where it may have been there; or a small effect beside large ones, of records that are explained.

use super::noise::roughness;
use crate::PipelineError;
use lpv_diagnose::catalogue::from_the_start;
use lpv_diagnose::{Case, Explained, Trace, Track, Verdict, observer, trace};

const DRIFT: &str = "sensor-drift";

/// What is found with other beginnings.
pub(super) struct Begun {
    pub(super) found: Trace,
    /// Fitted and judged records.
    pub(super) tracks: [Vec<Track>; 2],
}

/// What is found where the model tells the beginnings, with the noise that it sees.
pub(super) struct Settled {
    pub(super) begun: Begun,
    pub(super) noise: [f64; 2],
}

/// Where a record begins, and what is noise, is told by the model that was found, the better the more it explains: from there is looked again, and
/// once more as long as a look leaves at most half of what the one before left. None where nothing is missing.
pub(super) fn by_the_model(
    case: &Case<'_>,
    found: &Trace,
    told: &[Vec<Track>; 2],
) -> Result<Option<Settled>, PipelineError> {
    const MOST_LOOKS: usize = 5;
    const LESS: f64 = 0.5;
    let mut last: Option<Settled> = None;
    for _ in 0..MOST_LOOKS {
        let now = last.as_ref().map_or(found, |l| &l.begun.found);
        if now.verdict == Verdict::NothingMissing {
            break;
        }
        let before = now.after.cost;
        let tracks = told
            .each_ref()
            .map(|t| observer::settled(&now.model, case.controller, t));
        let seen = roughness(&now.model, case.controller, &tracks[0]);
        let known = last.as_ref().map_or(case.noise, |l| l.noise);
        let noise = std::array::from_fn(|i| known[i].min(seen[i]));
        let next = trace(&Case {
            noise,
            fitted: &tracks[0],
            judged: &tracks[1],
            seeks_load: now.rigid.is_some(),
            ..*case
        })?;
        let is_less = next.after.cost <= LESS * before;
        let begun = Begun { found: next, tracks };
        last = Some(Settled { begun, noise });
        if !is_less {
            break;
        }
    }
    Ok(last)
}

/// What is found from the beginnings that a model without such an effect tells; none where it does not do without it.
pub(super) fn look(
    case: &Case<'_>,
    found: &Trace,
    told: &[Vec<Track>; 2],
) -> Result<Option<Begun>, PipelineError> {
    let Some((model, doubtful)) = without_drift(&found.model)
        .or_else(|| loaded_from_the_start(&found.model))
        .or_else(|| without_the_least(found))
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

/// A model without the effect that brought the least, where that is much less than all, and the others explain the records with it.
fn without_the_least(found: &Trace) -> Option<(Explained, &'static str)> {
    /// Decibels of the squared error.
    const LITTLE: f64 = 20.0;
    let counts = |name: &str| name != "quantization";
    let counted = || found.added.iter().filter(|a| counts(a.effect.name));
    let least = counted().min_by(|a, b| a.gain_db.total_cmp(&b.gain_db))?;
    if found.verdict != Verdict::Explained || counted().count() < 2 || least.gain_db > LITTLE {
        return None;
    }
    let mut model = found.model.clone();
    model.effects.retain(|(e, _)| !e.is_called(least.effect));
    Some((model, least.effect.name))
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
