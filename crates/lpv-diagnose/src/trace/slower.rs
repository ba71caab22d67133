//! The competition through a slower observer.
//!
//! An observer takes away what is slower than its bandwidth: the faster it is, the less of a slow force is left in the error, down to
//! nothing but noise. A slow one lets the model run nearly free, and a small force adds up over a record. It adds up with what a wrong
//! beginning makes, too, and that hides it where the beginnings are those of a model without the force; here the beginning of each
//! record is free, see [`observer::settled_anywhere`].

use super::bench::{Aim, Bench};
use super::noise::loop_noise;
use super::{Case, ITERATIONS, NOISE, Trace, Verdict, in_view_of_rounding, trace};
use crate::fit::Explained;
use crate::track::Track;
use crate::whiten::SHORT;
use crate::{TraceError, observer};

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
/// and judged; those of `case` are not read). `found` is what a faster one showed. None where a slower one is of no use, or loses the
/// records.
pub fn trace_slower(case: &Case<'_>, found: &Trace, told: &[Vec<Track>; 2]) -> Option<Slower> {
    let is_held = told.iter().flatten().all(|t| t.follows);
    let is_explained = matches!(found.verdict, Verdict::Explained | Verdict::NothingMissing);
    if !is_held || !is_explained && found.after.cost.sqrt() > FAR {
        return None;
    }
    let (tracks, cost) = followed(case, &found.model, told).ok()?;
    let named = || {
        let tracks = match found.model.effects.is_empty() {
            true => tracks,
            false => followed(case, &found.bare, told).ok()?.0,
        };
        let first = explained(case, &tracks)?;
        // Other beginnings are free about those of the model that was found.
        let (tracks, _) = followed(case, &first.model, told).ok()?;
        Some((explained(case, &tracks)?, tracks))
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

/// The records as a model lets them begin, about which they may begin anywhere, and its cost on the judged ones after a fit.
fn followed(
    case: &Case<'_>,
    model: &Explained,
    told: &[Vec<Track>; 2],
) -> Result<([Vec<Track>; 2], f64), TraceError> {
    let settled = |model: &Explained| {
        told.each_ref()
            .map(|tracks| observer::settled_anywhere(model, case.controller, tracks))
    };
    let [fitted, judged] = settled(model);
    let here = Case {
        fitted: &fitted,
        judged: &judged,
        ..*case
    };
    let here = in_view_of_rounding(&here).0;
    let whitening = loop_noise(&here, model, SHORT)?;
    let bench = Bench {
        whitening: whitening.clone(),
        case: &here,
        aim: Aim::Noise,
    };
    let fit = bench.problem().fit(model, ITERATIONS, None)?;
    let tracks = settled(&fit.model);
    let [fitted, judged] = &tracks;
    let there = Case {
        fitted,
        judged,
        ..here
    };
    let bench = Bench {
        whitening,
        case: &there,
        aim: Aim::Noise,
    };
    let cost = bench.judge(&fit.model).cost;
    Ok((tracks, cost))
}
