//! The competition through a slower observer.
//!
//! An observer takes away what is slower than its bandwidth: the faster it is, the less of a slow force is left in the error, down to
//! nothing but noise. A slow one lets the model run nearly free, and a small force adds up over a record. It adds up with what a wrong
//! beginning makes, too, and that hides it where the beginnings are those of a model without the force; here the beginning of each
//! record is free, see [`settled`](crate::observer::settled).

use super::begun::followed;
use super::bench::{Aim, Bench};
use super::noise::loop_noise;
use super::{Added, Case, NOISE, Trace, Verdict, trace};
use crate::catalogue;
use crate::fit::Explained;
use crate::observer::first_errors;
use crate::track::Track;
use crate::whiten::SHORT;
use nalgebra::DVector;

/// Root of the cost on the judged records, of a model that leaves more than noise through a faster observer, beyond which a slower one is
/// of no use: what is missing is seen already.
const FAR: f64 = 2.0;

/// What a slower observer shows.
pub struct Slower {
    /// Error of the model on the judged records there, refitted, in units of the noise.
    pub over_noise: f64,
    /// What is found there, with the fitted and the judged records as it lets them begin; none where the model leaves noise, or where what it
    /// leaves has no name.
    pub found: Option<(Trace, [Vec<Track>; 2])>,
}

/// The same search as [`trace`] in the loop of a slower observer, the controller of `case`, which holds an axis at its records (`told`, fitted
/// and judged). `found` is what a faster one showed, in the loop and along the records of the case `faster`; where what the slower one shows
/// is worse there, or stands in the place of it and does not explain the records either, it has no name. None where a slower one is of no use, or loses the records.
pub fn trace_slower(
    case: &Case<'_>,
    (faster, found): (&Case<'_>, &Trace),
    told: &[Vec<Track>; 2],
) -> Option<Slower> {
    let is_held = told.iter().flatten().all(|t| t.follows);
    let is_explained = matches!(found.verdict, Verdict::Explained | Verdict::NothingMissing);
    if !is_held || !is_explained && found.after.cost.sqrt() > FAR {
        return None;
    }
    let (tracks, cost) = followed(case, &found.model, told)?;
    if cost.sqrt() > FAR && is_explained && !is_told(found, case, &tracks) {
        return None;
    }
    let named = || {
        let tracks = match found.model.effects.is_empty() {
            true => tracks,
            false => followed(case, &found.bare, told)?.0,
        };
        let first = explained(case, &tracks)?;
        // Other beginnings are free about those of the model that was found.
        let (tracks, _) = followed(case, &first.model, told)?;
        let there = explained(case, &tracks)?;
        let keeps = |a: &Added| there.added.iter().any(|t| t.effect.is_called(a.effect));
        let is_sure = there.verdict == Verdict::Explained || found.added.iter().all(keeps);
        (is_sure && is_no_worse(&there.model, &found.model, faster)).then_some((there, tracks))
    };
    Some(Slower {
        over_noise: cost.sqrt(),
        found: if is_explained && cost <= NOISE {
            None
        } else {
            named()
        },
    })
}

/// Whether errors in the loop of this case follow the parameters of the effects that were found in proportion, as far as these are not known. Where an
/// axis settles between the teeth of a magnet, or starts to slip, a small difference decides: then a slow observer loses the record, and
/// what is left says nothing.
fn is_told(found: &Trace, case: &Case<'_>, tracks: &[Vec<Track>; 2]) -> bool {
    /// Part of a deviation that is in proportion to the whole, and part of the change by which it may be off.
    const PART: f64 = 0.1;
    const OFF: f64 = 0.5;
    let errors = |model: &Explained| -> Option<DVector<f64>> {
        let one = |track: &Track| first_errors(model, case.controller, track);
        let all: Option<Vec<_>> = tracks[1].iter().map(one).collect();
        Some(DVector::from_vec(all?.concat()))
    };
    let Some(here) = errors(&found.model) else {
        return false;
    };
    let moved = |effect: usize, parameter: usize, by: f64| {
        let mut model = found.model.clone();
        let value = model.effects.get_mut(effect)?.1.get_mut(parameter)?;
        *value += by;
        Some(errors(&model)? - &here)
    };
    let named = found
        .added
        .iter()
        .filter(|a| !catalogue::quantization::EFFECT.is(a.effect));
    let mut parameters = named
        .enumerate()
        .flat_map(|(i, a)| a.values.iter().enumerate().map(move |(j, v)| (i, j, v.1)));
    let noise = case.noise[0] * (here.len() as f64).sqrt();
    parameters.all(|(i, j, deviation)| {
        if !(deviation > 0.0 && deviation.is_finite()) {
            return true;
        }
        match (moved(i, j, deviation), moved(i, j, PART * deviation)) {
            (Some(whole), Some(part)) => {
                let off = (&whole - part / PART).norm();
                off <= noise || off <= OFF * whole.norm()
            }
            _ => false,
        }
    })
}

/// Whether a model leaves no more of the judged records than another, in the loop of this case. A slow observer lets small errors of a simulation
/// grow, such as those of friction where a machine stands still, and effects that follow them are wrong where less grows.
fn is_no_worse(model: &Explained, than: &Explained, case: &Case<'_>) -> bool {
    /// Factor between squared errors that are as large.
    const AS_LARGE: f64 = 1.1;
    let bare = Explained {
        base: case.base.clone(),
        effects: Vec::new(),
    };
    let Ok(whitening) = loop_noise(case, &bare, SHORT) else {
        return false;
    };
    let bench = Bench {
        whitening,
        case,
        aim: Aim::Noise,
    };
    let [now, before] = [model, than].map(|m| bench.judge(m).cost);
    now <= NOISE || now <= AS_LARGE * before
}

/// What the competition finds along records, where it leaves noise, or little beside what was missing.
fn explained(case: &Case<'_>, [fitted, judged]: &[Vec<Track>; 2]) -> Option<Trace> {
    /// Part of the excess of the squared error.
    const LITTLE: f64 = 0.05;
    let found = trace(&Case {
        fitted,
        judged,
        ..*case
    });
    let leaves_little = |found: &Trace| match found.verdict {
        Verdict::Explained => found.after.cost <= NOISE,
        Verdict::PartlyExplained => found.after.cost - 1.0 <= LITTLE * (found.before.cost - 1.0),
        Verdict::NothingMissing | Verdict::Unexplained => false,
    };
    found.ok().filter(leaves_little)
}
