//! Effects that refine others: from the rough one to the fine one, and back.

use super::bench::Bench;
use super::{Judged, NOISE, SURE};
use crate::catalogue;
use crate::effect::Effect;
use crate::fit::{Explained, Fitted};
use crate::screen::Screen;
use rayon::prelude::*;

/// Starts of the refinements of what was fitted: of each the one that promises the most.
pub(super) fn refined(
    bench: &Bench<'_>,
    finals: &[(&'static Effect, Fitted)],
    now: &Fitted,
    screen: &Screen<'_>,
) -> Option<Vec<Explained>> {
    let (narrow, known) = bench.narrow(now, screen)?;
    let taken = |e: &Effect| now.model.effects.iter().any(|(t, _)| t.is_called(e));
    let mut all = Vec::new();
    for (effect, rough) in finals {
        let (rest, values) = without_last(&rough.model)?;
        let finer = catalogue::all().filter(|e| !taken(e));
        for (finer, extends) in finer.filter_map(|e| e.extends.map(|x| (e, x))) {
            if !finer.refines(effect) {
                continue;
            }
            let best = (extends.starts)(&values, screen, finer.place)
                .into_par_iter()
                .filter_map(|v| {
                    let mut start = rest.clone();
                    start.effects.push((finer, v));
                    let left = bench.promise(&start, (&narrow, &known), now)?;
                    Some((left, start))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            all.extend(best.map(|b| b.1));
        }
    }
    Some(all)
}

/// The fit with the least objective.
pub(super) fn leading<'a>(finals: &'a [(&'static Effect, Fitted)]) -> Option<&'a Fitted> {
    let fits = finals.iter().map(|(_, fit)| fit);
    fits.min_by(|a, b| a.objective.total_cmp(&b.objective))
}

/// The leading refinement shows its simpler effect the way: that one is fitted again from the values that the two share, since
/// its own start may have led it astray.
pub(super) fn simplified(bench: &Bench<'_>, finals: &mut Vec<(&'static Effect, Fitted)>, now: &Fitted) {
    let Some(fine) = leading(finals) else {
        return;
    };
    let last = fine.model.effects.len() - 1;
    let taken = |start: &Explained| {
        let added = start.effects.last();
        added.is_some_and(|(e, _)| now.model.effects.iter().any(|(t, _)| t.is_called(e)))
    };
    for start in simpler_forms(&fine.model, last).into_iter().filter(|s| !taken(s)) {
        finals.extend(bench.finals(&[&start], now, f64::INFINITY));
    }
}

/// A model with the simpler effect in the place of one that refines it, from the values that the two share; of what comes twice, the second may
/// be the one.
pub(super) fn simpler_forms(model: &Explained, i: usize) -> Vec<Explained> {
    let (effect, values) = &model.effects[i];
    let is_simpler = |e: &&Effect| effect.refines(e) && e.suits(&model.base);
    let Some(simpler) = catalogue::all().find(is_simpler) else {
        return Vec::new();
    };
    let place = |name: &str| effect.parameters.iter().position(|p| p.name == name);
    let form = |again: &str| {
        let shared = |name: &str| place(&format!("{name}{again}")).or_else(|| place(name));
        let values: Option<Vec<f64>> = simpler
            .parameters
            .iter()
            .map(|p| shared(p.name).map(|i| values[i]))
            .collect();
        let mut start = model.clone();
        start.effects[i] = (simpler, values?);
        Some(start)
    };
    let comes_twice = simpler
        .parameters
        .iter()
        .any(|p| place(&format!("{}_2", p.name)).is_some());
    let again = if comes_twice { &["", "_2"][..] } else { &[""] };
    again.iter().filter_map(|again| form(again)).collect()
}

/// A model without its last effect, and the values of that.
fn without_last(model: &Explained) -> Option<(Explained, Vec<f64>)> {
    let mut rest = model.clone();
    let (_, values) = rest.effects.pop()?;
    Some((rest, values))
}

/// A refinement is taken for the effect that it refines only if it is worth it on the judged records.
pub(super) fn simpler_first(finals: &mut [(&'static Effect, Fitted, Judged)], before: f64) {
    let Some((best, _, fine)) = finals.first() else {
        return;
    };
    let simpler = finals.iter().position(|(e, ..)| best.refines(e));
    if let Some(simpler) = simpler
        && !is_worth(fine, &finals[simpler].2, before)
    {
        finals.swap(0, simpler);
    }
}

/// Whether a refinement lowers the cost of the effect that it refines so far on the judged records that it earns its parameters;
/// the cost was `before` without both.
pub(super) fn is_worth(fine: &Judged, rough: &Judged, before: f64) -> bool {
    let fall = (rough.cost - fine.cost) * rough.samples as f64;
    let least = if fine.cost <= NOISE { NOTICED } else { WORTH };
    fall >= SURE && rough.cost >= least * fine.cost && rough.cost - fine.cost >= TRIFLE * before
}

/// Factor by which a refinement must lower a squared error to noise.
const NOTICED: f64 = 1.005;

/// Factor by which it must lower one that is not noise.
pub(super) const WORTH: f64 = 1.1;

/// Part of the squared error before that is within the accuracy of the simulation.
const TRIFLE: f64 = 1e-8;
