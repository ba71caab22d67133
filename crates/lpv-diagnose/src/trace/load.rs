//! A load on a spring in the place of a rigid axis.
//!
//! Friction and a second mass hide each other: without the one, the other lowers no error. So the load is not one more effect of the
//! competition: it is sought alone and beside the effects that the rigid axis was given or nearly given, and where it earns its place there, the
//! competition is held again, with motor and load as the base.

use super::bench::{Aim, Bench};
use super::{Case, Contest, EQUAL, Trace, alone, compete};
use crate::base::{Axis, Base, Load, Pair, RESONANCE};
use crate::catalogue;
use crate::effect::{Effect, Place};
use crate::fit::{Explained, Fitted, Problem, squares};
use crate::observer;
use crate::track::Track;
use rayon::prelude::*;

/// The effect that is the same machine where the encoder is on the motor.
const SAME: &str = "extra-mode";
/// Starts: part of the mass that the load has, and its damping ratio.
const PART: f64 = 0.3;
const RATIO: f64 = 0.05;
/// Resonances that are tried in a factor of e.
const DENSITY: f64 = 3.0;
/// The lowest shows so many periods in a record; the highest has so many samples in one.
const PERIODS: f64 = 6.0;
const SAMPLES: f64 = 4.0;
/// Iterations of every start, then of how many of the likeliest, and of how many of those a whole fit.
const FIRST: usize = 3;
const SECOND: usize = 4;
const LIKELY: usize = 12;
const LEADERS: usize = 4;
const LAST: usize = 20;
/// How often the frequencies at which a fit leaves the most are tried, how many of them, and with which damping ratios.
const ROUNDS: usize = 3;
const PEAKS: usize = 3;
const RINGING: [f64; 2] = [0.01, 0.06];
/// Factor between errors on the judged records that are as large.
const AS_LARGE: f64 = 1.05;

/// A case with motor and load as its base.
pub(super) struct WithLoad {
    base: Base,
    fitted: Vec<Track>,
    judged: Vec<Track>,
}

impl WithLoad {
    /// What is found with motor and load as the base: the load is sought beside what the rigid axis was given, then beside what
    /// it was nearly given; none where it leaves more than the rigid axis. What swings on a spring begins in more ways than a rigid axis, of
    /// which the beginning is free: for the load, records are held to where they begin.
    /// None for another base than a free axis.
    pub(super) fn traced(case: &Case<'_>, rigid: &Contest) -> Option<Trace> {
        match case.base {
            Base::Axis(axis) if axis.load().is_none() && axis.stiffness().is_none() => {}
            _ => return None,
        }
        let of =
            |tracks: &[Track]| -> Vec<Track> { tracks.iter().map(Track::held_to_its_beginning).collect() };
        let (fitted, judged) = (of(case.fitted), of(case.judged));
        let held = Case {
            fitted: &fitted,
            judged: &judged,
            ..*case
        };
        let is_free = case.fitted.iter().chain(case.judged).any(Track::is_free);
        let anew;
        let strict = if is_free {
            anew = compete(&held, Aim::Noise, alone(&held).ok()?);
            &anew
        } else {
            rigid
        };
        let found = [false, true].into_iter().find_map(|nearly| {
            let loaded = Self::sought(&held, strict, nearly)?;
            let contest = loaded.contest(&held, strict)?;
            // A load that lets the loop diverge is none.
            contest.conclude(&loaded.case(&held)).ok()
        });
        found.filter(|found| found.after.cost <= AS_LARGE * rigid.after.cost)
    }

    /// Motor and load where they describe the fitted records in fewer words than a contest without the load.
    fn sought(case: &Case<'_>, strict: &Contest, nearly: bool) -> Option<Self> {
        let near = if nearly { Some(nearly_given(strict)?) } else { None };
        let parts = 2 * case.fitted.first()?.fine();
        let followed = |tracks: &[Track]| tracks.iter().map(|t| t.followed(parts)).collect::<Vec<Track>>();
        let rough = &case.fitted[worst(case, strict)?..][..1];
        let worst = followed(rough);
        let narrow = Case {
            fitted: &worst,
            ..*case
        };
        let bench = Bench {
            whitening: strict.whitening.clone(),
            case: &narrow,
            aim: Aim::Noise,
        };
        let without = bench.problem().fit(&strict.now.model, SECOND, None).ok()?;
        let found = best(&bench, rough, &near.unwrap_or_else(|| own(&bench, strict)))?;
        // Where the record begins, the rigid axis has told.
        let again = begun(&found.model, case, worst.clone());
        let narrow = Case {
            fitted: &again,
            ..narrow
        };
        let bench = Bench {
            whitening: strict.whitening.clone(),
            case: &narrow,
            aim: Aim::Noise,
        };
        let found = bench.problem().fit(&found.model, LAST, None).ok()?;
        (found.length() <= strict.most(without.length())).then(|| Self {
            fitted: begun(&found.model, case, followed(case.fitted)),
            judged: begun(&found.model, case, followed(case.judged)),
            base: found.model.base,
        })
    }

    pub(super) fn case<'a>(&'a self, like: &Case<'a>) -> Case<'a> {
        Case {
            base: &self.base,
            prior: None,
            free: None,
            fitted: &self.fitted,
            judged: &self.judged,
            ..*like
        }
    }

    /// The contest with the load, where it ends in fewer words than that without, and with no larger error on the judged records.
    pub(super) fn contest(&self, case: &Case<'_>, strict: &Contest) -> Option<Contest> {
        let case = self.case(case);
        let found = compete(&case, Aim::Noise, alone(&case).ok()?);
        let is_better = found.now.length() <= strict.most(strict.now.length())
            && found.after.cost <= AS_LARGE * strict.after.cost
            && is_one(&found.now.model.base, &case)
            && found.now.tells_its_load();
        is_better.then_some(found)
    }
}

impl Fitted {
    /// Whether the records tell where the load swings: where they do not, two masses and a damper stand for something else.
    fn tells_its_load(&self) -> bool {
        /// Most of the resonance that one deviation is.
        const MOST: f64 = 0.5;
        let parameters = self.model.base.parameters().into_iter();
        let mut all = parameters.zip(self.give_deviations(self.deviations(), &mut []));
        all.all(|(p, deviation)| p.name != RESONANCE || deviation < MOST * p.value)
    }
}

impl Contest {
    /// Longest description with a load that is better than one without of this length: one that names the load as an effect is as good.
    fn most(&self, length: f64) -> f64 {
        let is_same = self.added.iter().any(|a| a.effect.name == SAME);
        length + if is_same { EQUAL } else { -EQUAL }
    }
}

/// Records that an observer holds with the beginnings that a model tells; others as they are.
fn begun(model: &Explained, case: &Case<'_>, tracks: Vec<Track>) -> Vec<Track> {
    match tracks.iter().all(|t| t.follows) {
        true => observer::settled(model, case.controller, &tracks),
        false => tracks,
    }
}

/// The fitted record of which a contest leaves the most.
fn worst(case: &Case<'_>, strict: &Contest) -> Option<usize> {
    let bench = Bench {
        whitening: strict.whitening.clone(),
        case,
        aim: Aim::Noise,
    };
    let errors = bench.problem().errors(&strict.now.model)?;
    let size = |error: &Vec<Pair>| {
        let mut white = Vec::new();
        bench.whitening.apply(error, &mut white);
        squares(&white) / error.len() as f64
    };
    let sizes: Vec<f64> = errors.iter().map(size).collect();
    (0..sizes.len()).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b]))
}

/// The rigid axis with what it was given; where that is nothing, also with dry friction.
fn own(bench: &Bench<'_>, strict: &Contest) -> Vec<Explained> {
    let mut all = vec![without_mode(&strict.now.model)];
    if all[0].effects.is_empty() {
        let mut dry = strict.bare.model.clone();
        dry.effects.extend(dry_friction(bench, &strict.bare));
        all.push(dry);
    }
    all
}

/// The same with what it was nearly given, if it was given nothing: else most of what is missing has been told.
fn nearly_given(strict: &Contest) -> Option<Vec<Explained>> {
    if !without_mode(&strict.now.model).effects.is_empty() {
        return None;
    }
    let near = strict.near.as_ref().map(without_mode)?;
    (!near.effects.is_empty()).then(|| vec![near])
}

/// A model without what is the same as a load.
fn without_mode(model: &Explained) -> Explained {
    let mut model = model.clone();
    model.effects.retain(|(e, _)| e.name != SAME);
    model
}

/// The likeliest load, beside the effects of one of these models; the first steps from all starts are along the rough record.
fn best(bench: &Bench<'_>, rough: &[Track], beside: &[Explained]) -> Option<Fitted> {
    let case = bench.case;
    let starts: Vec<Explained> = beside.iter().flat_map(|model| starts(case, model)).collect();
    let first = Problem {
        tracks: rough,
        ..bench.problem()
    };
    let mut found: Vec<Fitted> = starts
        .par_iter()
        .filter_map(|start| first.fit(start, FIRST, None).ok())
        .collect();
    let further = |found: &mut Vec<Fitted>, iterations: usize, most: usize| {
        found.sort_by(|a, b| a.length().total_cmp(&b.length()));
        found.truncate(most);
        *found = found
            .par_iter()
            .filter_map(|f| bench.problem().fit(&f.model, iterations, Some(f)).ok())
            .collect();
    };
    further(&mut found, SECOND, LIKELY);
    further(&mut found, LAST, LEADERS);
    for _ in 0..ROUNDS {
        // Fits that ended at one load leave the most at the same frequencies.
        let apart = (0..found.len()).filter(|i| !found[..*i].iter().any(|f| is_same(f, &found[*i])));
        let starts: Vec<Explained> = apart.flat_map(|i| ringing(bench, &found[i])).collect();
        let mut again: Vec<Fitted> = starts
            .par_iter()
            .filter_map(|start| bench.problem().fit(start, SECOND, None).ok())
            .collect();
        further(&mut again, LAST, LEADERS);
        let least = |all: &[Fitted]| all.iter().map(Fitted::length).fold(f64::INFINITY, f64::min);
        let is_less = least(&again) < least(&found) - EQUAL;
        found.append(&mut again);
        found.sort_by(|a, b| a.length().total_cmp(&b.length()));
        found.truncate(LEADERS);
        if !is_less {
            break;
        }
    }
    found.retain(|f| is_one(&f.model.base, case));
    found.into_iter().min_by(|a, b| a.length().total_cmp(&b.length()))
}

/// Whether two fits have the same load.
fn is_same(one: &Fitted, other: &Fitted) -> bool {
    /// Largest difference, of the values.
    const NEAR: f64 = 1e-2;
    let load = |fit: &Fitted| match &fit.model.base {
        Base::Axis(axis) => axis.load(),
        Base::XyTable(_) | Base::Lpv(_) => None,
    };
    let near = |a: f64, b: f64| (a - b).abs() <= NEAR * a.abs().max(b.abs());
    matches!((load(one), load(other)), (Some(a), Some(b))
        if a.is_measured == b.is_measured && near(a.hz, b.hz) && near(a.part, b.part) && near(a.ratio, b.ratio))
}

/// The same load at the frequencies at which a fit leaves the most: what rings for long is found from near its frequency only, and a fit
/// that starts elsewhere ends with much damping.
fn ringing(bench: &Bench<'_>, fit: &Fitted) -> Vec<Explained> {
    let Base::Axis(axis) = &fit.model.base else {
        return Vec::new();
    };
    let (Some(load), Some(screen)) = (axis.load(), bench.look(&fit.model.base, fit)) else {
        return Vec::new();
    };
    let [low, high] = band(bench.case);
    let peaks = screen
        .peaks(PEAKS)
        .into_iter()
        .filter(|hz| (low..high).contains(hz));
    let at = |hz: f64| {
        RINGING.map(|ratio| Explained {
            base: Base::Axis(axis.clone().with_load(Load { hz, ratio, ..load })),
            effects: fit.model.effects.clone(),
        })
    };
    peaks.flat_map(at).collect()
}

/// Dry friction with the values at which it starts.
fn dry_friction(bench: &Bench<'_>, bare: &Fitted) -> Option<(&'static Effect, Vec<f64>)> {
    let effect = catalogue::all().find(|e| e.name == "coulomb-friction" && e.place == Place::Motor(0))?;
    let narrow = bench.problem().fit(&bare.model, 0, None).ok()?;
    let screen = bench.look(&bare.model.base, &narrow)?;
    let values = (effect.starts)(&screen, effect.place).into_iter().next()?;
    Some((effect, values))
}

/// A model with loads of all resonances that records can show, with the encoder at either end.
fn starts(case: &Case<'_>, model: &Explained) -> Vec<Explained> {
    let Base::Axis(axis) = &model.base else {
        return Vec::new();
    };
    let [low, high] = band(case);
    let count = (DENSITY * (high / low).ln()).ceil().max(1.0) as usize;
    let at = |i: usize| low * (high / low).powf(i as f64 / count as f64);
    let with = |axis: Axis| Explained {
        base: Base::Axis(axis),
        effects: model.effects.clone(),
    };
    (0..=count)
        .flat_map(|i| [false, true].map(|is_measured| (at(i), is_measured)))
        .map(|(hz, is_measured)| {
            with(axis.clone().with_load(Load {
                part: PART,
                hz,
                ratio: RATIO,
                is_measured,
            }))
        })
        .collect()
}

/// Resonances that the records can show.
fn band(case: &Case<'_>) -> [f64; 2] {
    let step = case.fitted.first().map_or(1.0, |t| t.step);
    let high = 1.0 / (SAMPLES * step);
    [(PERIODS / Track::longest(case.fitted)).min(0.5 * high), high]
}

/// Whether motor and load are two bodies that swing within what the records show.
fn is_one(base: &Base, case: &Case<'_>) -> bool {
    /// Least part of the mass on either side of the spring.
    const LEAST: f64 = 0.02;
    const MOST: f64 = 1.0 - LEAST;
    const MOST_RATIO: f64 = 1.0;
    let Base::Axis(axis) = base else { return false };
    let Some(load) = axis.load() else { return false };
    let [low, high] = band(case);
    load.part > LEAST
        && load.part < MOST
        && load.ratio < MOST_RATIO
        && load.hz > 0.5 * low
        && load.hz < 2.0 * high
}
