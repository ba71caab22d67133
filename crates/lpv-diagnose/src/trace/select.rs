//! One more effect: all are looked at quickly, the most promising are fitted in full.

use super::bench::{Aim, Bench, Candidate};
use super::refine::WORTH;
use super::{EQUAL, Judged, NOISE, Tried, decibel, refine};
use crate::base::Base;
use crate::catalogue::{self, first_of_equals};
use crate::effect::{Effect, EffectParameter, Family, Scale};
use crate::fit::{Explained, Fitted};
use crate::screen::Screen;
use rayon::prelude::*;

/// Effects that are fitted in full after the quick look.
const FINALISTS: usize = 4;
/// Effects whose promise is compared with what they do.
const LOOKED_AT: usize = 10;
/// Periods of a disturbance that every record must hold.
const PERIODS: f64 = 3.0;
/// Part of the price of its parameters that an effect must promise.
const PROMISE: f64 = 1.0;

/// An effect with the fit of all parameters, and the errors on the judged records.
pub(super) type Final = (&'static Effect, Fitted, Judged);

/// What one look at the catalogue gives.
pub(super) struct Selection {
    /// The best start of each effect, the most promising first.
    screened: Vec<Candidate>,
    /// Those fitted in full, the best first.
    pub(super) finals: Vec<Final>,
}

/// Effects that might stand beside those of a fit, whose cost on the judged records is `cost`; none are fitted where none promises
/// what its parameters cost, or further than it takes to see that their objectives stay above a `rival`, that of what they would replace.
pub(super) fn select(
    bench: &Bench<'_>,
    base: &Base,
    (now, cost): (&Fitted, f64),
    rival: f64,
) -> Option<Selection> {
    let screen = bench.look(base, now)?;
    let taken = |e: &Effect| now.model.effects.iter().any(|(t, _)| t.is_called(e));
    let own = bench.case.own.iter().copied();
    let mut found: Vec<Candidate> = own
        .chain(catalogue::all())
        .filter(|e| e.suits(base) && !taken(e) && bench.aim.admits(e))
        .flat_map(|e| (e.starts)(&screen, e.place).into_iter().map(move |v| (e, v)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|(e, v)| bench.candidate(e, v, now, &screen))
        .collect();
    found.sort_by(|a, b| b.predicted.total_cmp(&a.predicted));
    let mut screened: Vec<Candidate> = Vec::new();
    for candidate in found {
        if !screened.iter().any(|c| c.effect.is(candidate.effect)) {
            screened.push(candidate);
        }
    }
    // What promises less than its parameters cost is chance.
    let price = (now.residual.len() as f64).ln();
    let promising = |c: &Candidate| c.predicted > PROMISE * price * c.effect.fitted() as f64;
    if !screened.iter().any(promising) {
        let finals = Vec::new();
        return Some(Selection { screened, finals });
    }
    let mut actual: Vec<(f64, usize)> = screened
        .par_iter()
        .enumerate()
        .take(LOOKED_AT)
        .map(|(i, c)| (c.starts().map(|s| bench.cost(s)).fold(f64::INFINITY, f64::min), i))
        .collect();
    actual.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<usize> = (0..screened.len())
        .filter(|i| promising(&screened[*i]))
        .take(FINALISTS)
        .collect();
    chosen.extend(actual.iter().map(|a| a.1).filter(|i| *i >= FINALISTS).take(2));
    let starts: Vec<&Explained> = chosen.iter().flat_map(|i| screened[*i].starts()).collect();
    let mut finals = bench.finals(&starts, now, rival);
    if bench.aim == Aim::Noise {
        let refined = refine::refined(bench, &finals, now, &screen)?;
        let rival = refine::leading(&finals).map_or(rival, |best| best.objective.min(rival));
        finals.extend(bench.finals(&refined.iter().collect::<Vec<_>>(), now, rival));
        refine::simplified(bench, &mut finals, now);
    }
    finals.retain(|(_, fit)| is_possible(bench, &fit.model, &screen));
    let mut finals: Vec<Final> = finals
        .into_par_iter()
        .map(|(e, f)| {
            let judged = bench.judge(&f.model);
            (e, f, judged)
        })
        .collect();
    let stays = |(effect, _, judged): &Final| {
        let rough = cost_of_rougher(&finals, effect);
        may_be_named(effect, judged.cost, rough) && takes_enough(effect, judged.cost, cost)
    };
    let stay: Vec<bool> = finals.iter().map(stays).collect();
    let mut stay = stay.into_iter();
    finals.retain(|_| stay.next() == Some(true));
    match bench.aim {
        Aim::Noise => {
            finals.sort_by(|a, b| a.1.length().total_cmp(&b.1.length()));
            equals_in_order(&mut finals, bench.case.judged.iter().all(|t| t.follows));
        }
        Aim::Force => {
            finals.sort_by(|a, b| a.2.cost.total_cmp(&b.2.cost));
            nearly_equal_in_order(&mut finals);
        }
    }
    refine::simpler_first(&mut finals, cost);
    Some(Selection { screened, finals })
}

impl Selection {
    /// How each effect did beside those of `now`, without which the cost on the judged records was `before`.
    pub(super) fn tried(&self, bench: &Bench<'_>, now: &Fitted, before: f64) -> Vec<Tried> {
        let full = |effect: &Effect| self.finals.iter().find(|(e, ..)| e.is(effect));
        let tried = |effect: &'static Effect, start: Option<&Explained>| {
            let fitted = full(effect);
            let cost = match (fitted, start) {
                (Some((.., judged)), _) => judged.cost,
                (None, Some(start)) => bench.judge(start).cost,
                (None, None) => f64::INFINITY,
            };
            Tried {
                effect,
                beside: now.model.effects.iter().map(|(e, _)| *e).collect(),
                gain_db: decibel(before / cost),
                fitted: fitted.is_some(),
                accepted: false,
            }
        };
        let looked_at = |e: &Effect| self.screened.iter().any(|c| c.effect.is(e));
        // Refinements come without a look.
        let finer = self.finals.iter().filter(|(e, ..)| !looked_at(e));
        let mut all: Vec<Tried> = Vec::new();
        for (effect, ..) in finer {
            if !all.iter().any(|t| t.effect.is(effect)) {
                all.push(tried(effect, None));
            }
        }
        all.par_extend(self.screened.par_iter().map(|c| tried(c.effect, Some(&c.start))));
        all
    }

    /// The best one, and what is worse by how much on the judged records.
    pub(super) fn best(&self) -> Option<(&Final, Option<(&'static Effect, f64)>)> {
        let best = self.finals.first()?;
        let next = self.finals.iter().find(|(e, ..)| !e.is(best.0));
        let runner_up = next.map(|(e, _, j)| (*e, decibel(j.cost / best.2.cost)));
        Some((best, runner_up))
    }
}

/// Of effects that explain the records equally well, with as many parameters, the first in the catalogue leads. Where an observer holds
/// the machine at its records and what is left is not noise, the length of a description counts forces that no effect makes: then
/// effects are equals too that do nearly as well on the judged records.
fn equals_in_order(finals: &mut [(&'static Effect, Fitted, Judged)], is_held: bool) {
    let Some((best, fit, judged)) = finals.first() else {
        return;
    };
    let (most, parameters) = (fit.length() + EQUAL, best.fitted());
    let near = match is_held && judged.cost > NOISE {
        true => WORTH * judged.cost,
        false => 0.0,
    };
    first_of_equals(
        finals,
        |(e, ..)| *e,
        |(e, f, j)| (f.length() <= most || j.cost <= near) && e.fitted() <= parameters,
    );
}

/// Of effects that leave nearly as much of the force of the judged records, the first in the catalogue leads.
fn nearly_equal_in_order(finals: &mut [Final]) {
    let Some((.., judged)) = finals.first() else {
        return;
    };
    let most = WORTH * judged.cost;
    first_of_equals(finals, |(e, ..)| *e, |(.., j)| j.cost <= most);
}

/// Whether an effect takes enough of the cost on the judged records. What happens once, or swings in time, can pass for much that a machine
/// does at that time; it leaves noise, or most of the error was due to it.
fn takes_enough(effect: &Effect, with: f64, without: f64) -> bool {
    const MOST: f64 = 0.75;
    let is_of_time = |p: &EffectParameter| match p.scale {
        Scale::Instant => true,
        Scale::Frequency => effect.family == Family::Disturbance,
        _ => false,
    };
    let is_of_motion = !effect.parameters.iter().any(is_of_time);
    is_of_motion || with <= NOISE || without - with >= MOST * (without - 1.0).max(0.0)
}

/// Least cost on the judged records of the effects that one refines; zero where none was fitted.
fn cost_of_rougher(finals: &[Final], effect: &Effect) -> f64 {
    let rougher = finals.iter().filter(|(e, ..)| effect.refines(e));
    rougher.map(|(.., j)| j.cost).reduce(f64::min).unwrap_or(0.0)
}

/// Whether an effect is one to be named beside what it leaves on the judged records, of which the effect that it refines leaves `rough`: much that
/// a machine may do looks like some of what friction does in time or with the load, but little of it looks like most.
pub(super) fn may_be_named(effect: &Effect, cost: f64, rough: f64) -> bool {
    /// Part of the cost.
    const LITTLE: f64 = 0.1;
    cost <= NOISE || cost <= LITTLE * rough || !catalogue::is_only_beside_noise(effect)
}

/// Whether the last effect is one with the values that were found, and repeats along a record: less of a wave passes for any force
/// that changes slowly, and rounding for a wave as long as its step.
fn is_possible(bench: &Bench<'_>, model: &Explained, screen: &Screen<'_>) -> bool {
    let Some((effect, values)) = model.effects.last() else {
        return true;
    };
    let is_seen = |(v, p): (&f64, &EffectParameter)| {
        let (shortest, longest) = match (p.scale, effect.family) {
            (Scale::Wavelength, Family::Sensor) => screen.periods(effect.place.first()),
            (Scale::Wavelength, _) => (0.0, screen.travel(effect.place.first())),
            // One period of a record is any slow change.
            (Scale::Frequency, Family::Disturbance) => (PERIODS / screen.shortest(), f64::INFINITY),
            _ => return true,
        };
        *v >= shortest && *v <= longest
    };
    let is_trend = catalogue::changes_with_position(effect) && screen.grows_with_time(effect.place.first());
    effect.allows(values)
        && catalogue::is_itself(effect, values, bench.case.fitted)
        && catalogue::is_change(effect, values, screen)
        && !is_trend
        && values.iter().zip(effect.parameters).all(is_seen)
        && bench.lasts(model, model.effects.len() - 1)
}
