//! Where records begin and what a model is, told by each other: the better the one, the better the other.

use super::bench::{Aim, Bench};
use super::noise::loop_noise;
use super::{Case, ITERATIONS, NOISE, in_view_of_rounding};
use crate::fit::Explained;
use crate::observer;
use crate::track::Track;
use crate::whiten::{SHORT, Whitening};

/// Fitted and judged records that an observer holds, as a model lets them begin (`told` by their first samples). Where more than noise is left, the model is fitted
/// along them and tells again, as long as that leaves far less: axes that start abruptly are told by none of their samples.
pub fn begun(case: &Case<'_>, model: &Explained, told: &[Vec<Track>; 2]) -> [Vec<Track>; 2] {
    const MOST_FITS: usize = 8;
    /// Part of the squared error that is far less.
    const FAR_LESS: f64 = 0.25;
    let mut tracks = settled(case, model, told);
    if model.base.has_load() {
        return tracks;
    }
    let Some((whitening, mut cost)) = judged(case, model, &tracks) else {
        return tracks;
    };
    let mut model = model.clone();
    for _ in 0..MOST_FITS {
        if cost <= NOISE {
            break;
        }
        let Some(next) = step(case, &whitening, (&model, &tracks), told) else {
            break;
        };
        if next.cost > FAR_LESS * cost {
            break;
        }
        (model, tracks, cost) = (next.model, next.tracks, next.cost);
    }
    tracks
}

/// The records as a model lets them begin once it is fitted along them, and its cost on the judged ones then.
pub(super) fn followed(
    case: &Case<'_>,
    model: &Explained,
    told: &[Vec<Track>; 2],
) -> Option<([Vec<Track>; 2], f64)> {
    let tracks = settled(case, model, told);
    let (whitening, _) = judged(case, model, &tracks)?;
    let next = step(case, &whitening, (model, &tracks), told)?;
    Some((next.tracks, next.cost))
}

/// A model that was fitted along records, these as it lets them begin, and its cost on the judged ones.
struct Step {
    model: Explained,
    tracks: [Vec<Track>; 2],
    cost: f64,
}

fn step(
    case: &Case<'_>,
    whitening: &Whitening,
    (model, tracks): (&Explained, &[Vec<Track>; 2]),
    told: &[Vec<Track>; 2],
) -> Option<Step> {
    let fit = along(case, tracks, |case| {
        let bench = Bench {
            whitening: whitening.clone(),
            case,
            aim: Aim::Noise,
        };
        bench.problem().fit(model, ITERATIONS, None).ok()
    })?;
    let tracks = settled(case, &fit.model, told);
    let cost = along(case, &tracks, |case| {
        let bench = Bench {
            whitening: whitening.clone(),
            case,
            aim: Aim::Noise,
        };
        bench.judge(&fit.model).cost
    });
    Some(Step {
        model: fit.model,
        tracks,
        cost,
    })
}

/// The noise in the loop of a model, and its cost on the judged records.
fn judged(case: &Case<'_>, model: &Explained, tracks: &[Vec<Track>; 2]) -> Option<(Whitening, f64)> {
    along(case, tracks, |case| {
        let whitening = loop_noise(case, model, SHORT).ok()?;
        let bench = Bench {
            whitening: whitening.clone(),
            case,
            aim: Aim::Noise,
        };
        Some((whitening, bench.judge(model).cost))
    })
}

/// What something says of a case along these records, of which the rounding is noise.
fn along<T>(case: &Case<'_>, [fitted, judged]: &[Vec<Track>; 2], of: impl FnOnce(&Case<'_>) -> T) -> T {
    let case = Case {
        fitted,
        judged,
        ..*case
    };
    of(&in_view_of_rounding(&case).0)
}

fn settled(case: &Case<'_>, model: &Explained, told: &[Vec<Track>; 2]) -> [Vec<Track>; 2] {
    told.each_ref()
        .map(|tracks| observer::told_by(model, case.controller, tracks, true))
}
