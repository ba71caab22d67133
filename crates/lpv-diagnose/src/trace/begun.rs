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
    let Some(whitening) = noise_of(case, model, &tracks) else {
        return tracks;
    };
    let mut cost = on(case, &whitening, &tracks, |bench| bench.judge(model).cost);
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
    let whitening = noise_of(case, model, &tracks)?;
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
    let fit = on(case, whitening, tracks, |bench| {
        bench.problem().fit(model, ITERATIONS, None).ok()
    })?;
    let tracks = settled(case, &fit.model, told);
    let cost = on(case, whitening, &tracks, |bench| bench.judge(&fit.model).cost);
    Some(Step {
        model: fit.model,
        tracks,
        cost,
    })
}

/// The noise in the loop of a model.
fn noise_of(case: &Case<'_>, model: &Explained, tracks: &[Vec<Track>; 2]) -> Option<Whitening> {
    loop_noise(&in_view_of_rounding(&along(case, tracks)).0, model, SHORT).ok()
}

/// What a bench says along these records, of which the rounding is noise.
fn on<T>(
    case: &Case<'_>,
    whitening: &Whitening,
    tracks: &[Vec<Track>; 2],
    says: impl FnOnce(&Bench<'_>) -> T,
) -> T {
    says(&Bench {
        whitening: whitening.clone(),
        case: &in_view_of_rounding(&along(case, tracks)).0,
        aim: Aim::Noise,
    })
}

/// The same case along other records.
fn along<'a>(case: &Case<'a>, [fitted, judged]: &'a [Vec<Track>; 2]) -> Case<'a> {
    Case {
        fitted,
        judged,
        ..*case
    }
}

fn settled(case: &Case<'_>, model: &Explained, told: &[Vec<Track>; 2]) -> [Vec<Track>; 2] {
    told.each_ref()
        .map(|tracks| observer::told_by(model, case.controller, tracks, true))
}
