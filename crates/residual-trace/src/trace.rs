//! The competition: which effects of the catalogue earn a place.

mod account;
mod bench;
mod conclude;
mod noise;
mod refine;

use crate::TraceError;
use crate::base::{Base, Pair};
use crate::catalogue::{CATALOGUE, first_of_equals, quantization};
use crate::effect::Effect;
use crate::fit::{Explained, Fitted, Prior};
use crate::track::Track;
use crate::whiten::Whitening;
pub use account::{Added, Judged, Trace, Tried, Verdict};
use bench::{Bench, Candidate};
use experiment_data::ControllerState;
use noise::loop_noise;
pub use noise::sensor_noise;
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// What is known before.
pub struct Case<'a> {
    /// Base model.
    pub base: &'a Base,
    /// What other data tell of its coordinates.
    pub prior: Option<&'a Prior>,
    /// Base and prior with parameters free that `base` holds: tried where effects do not explain the error in fewer words.
    pub free: Option<(&'a Base, &'a Prior)>,
    /// The loop of the experiment, at rest.
    pub controller: &'a ControllerState,
    /// Deviation of the noise of the sensors, by output; see [`sensor_noise`].
    pub noise: Pair,
    /// Records to fit.
    pub fitted: &'a [Track],
    /// Records to judge by.
    pub judged: &'a [Track],
}

/// An effect with its values.
type Choice = (&'static Effect, Vec<f64>);

/// Lengths of description, in units of the likelihood's logarithm, within which two effects are equals.
const EQUAL: f64 = 6.0;

/// Most effects at once.
const MOST_EFFECTS: usize = 3;
/// Effects that are fitted in full after the quick look.
const FINALISTS: usize = 4;
/// Effects whose promise is compared with what they do.
const LOOKED_AT: usize = 10;
/// Part of the price of its parameters that an effect must promise.
const PROMISE: f64 = 1.0;
/// Iterations of a full fit.
const ITERATIONS: usize = 40;
/// Fall of the squared whitened error on judged records that no chance makes.
const SURE: f64 = 14.0;
/// Cost over its expectation up to which what is left is noise.
const NOISE: f64 = 1.21;
/// Step of a grid of readings, in units of the noise, from which it matters.
const ROUGH: f64 = 3.0;
/// Part of the excess over the noise that may be left where effects are named.
const LEFT: f64 = 0.15;
/// Part of the excess that an effect must take to be tried further.
const SHARE: f64 = 0.2;

/// Finds the effects that a base model lacks.
///
/// The machine's parameters are refitted along the records; each effect of the catalogue is tried from its starts by one
/// linear step, the most promising ones are fitted in full together with the machine, and the best of them is added if it
/// lowers the error on records that it was not fitted to. This is repeated until nothing but noise is left or no effect
/// helps.
///
/// # Errors
/// [`TraceError::TooFew`] without records to fit or to judge by; [`TraceError::Diverges`].
pub fn trace(case: &Case<'_>) -> Result<Trace, TraceError> {
    if case.fitted.is_empty() || case.judged.is_empty() {
        return Err(TraceError::TooFew {
            what: "a diagnosis needs at least one record to fit and one with use = \"validation\" to judge by",
        });
    }
    // Readings on a grid: rounding is noise to all that follows.
    let steps = quantization::steps(case.fitted);
    let coarse: [bool; 2] = std::array::from_fn(|i| steps[i].0 > ROUGH * case.noise[i]);
    let noise = std::array::from_fn(|i| match coarse[i] {
        true => case.noise[i].hypot(steps[i].0 / 12.0_f64.sqrt()),
        false => case.noise[i],
    });
    let case = Case { noise, ..*case };
    let strict = compete(&case, alone(&case)?);
    let free = match case.free {
        Some((base, prior)) if !strict.is_noise() => {
            let free = Case {
                base,
                prior: Some(prior),
                free: None,
                ..case
            };
            let bare = alone(&free)?;
            (bare.1.length() < strict.now.length()).then_some((free, bare))
        }
        _ => None,
    };
    let mut found = match free {
        Some((free, bare)) => compete(&free, bare).conclude(&free)?,
        None => strict.conclude(&case)?,
    };
    if coarse.contains(&true) && found.verdict != Verdict::Unexplained {
        let values = [0, 1].map(|i: usize| if coarse[i] { steps[i] } else { (0.0, f64::INFINITY) });
        found.added.insert(
            0,
            Added {
                effect: &quantization::EFFECT,
                values: values.to_vec(),
                then: found.bare.clone(),
                gain_db: 0.0,
                p_value: 0.0,
                runner_up: None,
            },
        );
        if found.verdict == Verdict::NothingMissing {
            found.verdict = Verdict::Explained;
        }
    }
    Ok(found)
}

/// The base model alone: the noise in its loop, and its fit.
fn alone(case: &Case<'_>) -> Result<(Whitening, Fitted), TraceError> {
    let bare = Explained {
        base: case.base.clone(),
        effects: Vec::new(),
    };
    let bench = Bench {
        whitening: loop_noise(case, &bare)?,
        case,
    };
    let fit = bench.problem().fit(&bare, ITERATIONS, None)?;
    Ok((bench.whitening, fit))
}

/// What a competition leaves.
struct Contest {
    whitening: Whitening,
    /// Without effects.
    bare: Fitted,
    before: Judged,
    /// With those that were added.
    now: Fitted,
    after: Judged,
    added: Vec<Added>,
    candidates: Vec<Tried>,
}

impl Contest {
    /// Whether nothing was added because nothing is missing.
    fn is_noise(&self) -> bool {
        self.added.is_empty() && self.after.cost <= NOISE
    }
}

fn compete(case: &Case<'_>, (whitening, bare): (Whitening, Fitted)) -> Contest {
    let bench = Bench { whitening, case };
    let before = bench.judge(&bare.model);
    let (mut now, mut judged) = (bare.clone(), before.clone());
    let (mut all_added, mut candidates) = (Vec::<Added>::new(), Vec::new());
    let mut rivals: Vec<Vec<Choice>> = Vec::new();
    for _ in 0..MOST_EFFECTS {
        let Some(screen) = bench.look(&bare.model.base, &now) else {
            break;
        };
        let taken: Vec<&str> = now.model.effects.iter().map(|(e, _)| e.name).collect();
        let mut found: Vec<Candidate> = CATALOGUE
            .iter()
            .filter(|e| !taken.contains(&e.name))
            .flat_map(|e| (e.starts)(&screen).into_iter().map(|v| (*e, v)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|(e, v)| bench.candidate(e, v, &now, &screen))
            .collect();
        found.sort_by(|a, b| b.predicted.total_cmp(&a.predicted));
        let mut best_of: Vec<Candidate> = Vec::new();
        for candidate in found {
            if best_of.iter().all(|c| c.effect.name != candidate.effect.name) {
                best_of.push(candidate);
            }
        }
        // What promises less than its parameters cost is chance.
        let price = (now.residual.len() as f64).ln();
        let promising = |c: &Candidate| c.predicted > PROMISE * price * c.effect.parameters.len() as f64;
        if !best_of.iter().any(promising) {
            break;
        }
        let mut actual: Vec<(f64, usize)> = best_of
            .iter()
            .enumerate()
            .take(LOOKED_AT)
            .map(|(i, c)| (bench.cost(&c.start), i))
            .collect();
        actual.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut chosen: Vec<usize> = (0..best_of.len())
            .filter(|i| promising(&best_of[*i]))
            .take(FINALISTS)
            .collect();
        chosen.extend(actual.iter().map(|a| a.1).filter(|i| *i >= FINALISTS).take(2));
        let starts: Vec<&Explained> = chosen.iter().map(|i| &best_of[*i].start).collect();
        let mut finals = bench.finals(&starts, &now);
        let Some(refined) = refine::refined(&bench, &finals, &now, &screen) else {
            break;
        };
        finals.extend(bench.finals(&refined.iter().collect::<Vec<_>>(), &now));
        refine::simplified(&bench, &mut finals, &now);
        finals.retain(|(_, fit)| is_possible(&fit.model));
        let mut finals: Vec<(&'static Effect, Fitted, Judged)> = finals
            .into_iter()
            .map(|(e, f)| {
                let judged = bench.judge(&f.model);
                (e, f, judged)
            })
            .collect();
        finals.sort_by(|a, b| a.1.length().total_cmp(&b.1.length()));
        if candidates.is_empty() {
            candidates = best_of
                .iter()
                .map(|c| Tried {
                    effect: c.effect,
                    gain_db: match finals.iter().find(|(e, ..)| e.name == c.effect.name) {
                        Some((.., j)) => decibel(before.cost / j.cost),
                        None => decibel(before.cost / bench.judge(&c.start).cost),
                    },
                    accepted: false,
                })
                .collect();
        }
        equals_in_order(&mut finals);
        refine::simpler_first(&mut finals, judged.cost);
        let Some((effect, fit, after)) = finals.first().cloned() else {
            break;
        };
        let fall = (judged.cost - after.cost) * judged.samples as f64;
        let shorter = now.length() - fit.length();
        let excess = (judged.cost - 1.0).max(0.0);
        let enough = after.cost <= NOISE || judged.cost - after.cost >= SHARE * excess;
        if fall < SURE || shorter <= 0.0 || !enough {
            break;
        }
        let added = Added {
            effect,
            values: Vec::new(),
            then: fit.model.clone(),
            gain_db: decibel(judged.cost / after.cost),
            p_value: chance(now.objective - fit.objective, effect.parameters.len()),
            runner_up: finals
                .iter()
                .find(|(e, ..)| e.name != effect.name)
                .map(|(e, _, j)| (*e, decibel(j.cost / after.cost))),
        };
        all_added.push(added);
        rivals.push(refine::rivals(&finals));
        (now, judged) = (fit, after);
        if judged.cost <= NOISE {
            break;
        }
    }
    // Which of two like effects it was may show only when the others are there too.
    while let Some((i, fit)) = refine::exchanged(&bench, &now, &mut rivals) {
        let there = bench.judge(&fit.model);
        let (Some(added), Some((effect, _))) = (all_added.get_mut(i), fit.model.effects.get(i)) else {
            break;
        };
        let refines = effect.extends.is_some_and(|x| x.name == added.effect.name);
        if there.cost > judged.cost || refines && !refine::is_worth(&there, &judged, before.cost) {
            continue;
        }
        added.runner_up = Some((added.effect, decibel(judged.cost / there.cost)));
        added.effect = effect;
        added.then = fit.model.clone();
        judged = there;
        now = fit;
    }
    Contest {
        whitening: bench.whitening,
        bare,
        before,
        now,
        after: judged,
        added: all_added,
        candidates,
    }
}

/// Of effects that explain the records equally well, with as many parameters, the first in the catalogue leads.
fn equals_in_order(finals: &mut [(&'static Effect, Fitted, Judged)]) {
    let Some((best, fit, _)) = finals.first() else {
        return;
    };
    let (most, parameters) = (fit.length() + EQUAL, best.parameters.len());
    first_of_equals(
        finals,
        |(e, ..)| *e,
        |(e, f, _)| f.length() <= most && e.parameters.len() <= parameters,
    );
}

/// Whether the last effect is one with the values that were found.
fn is_possible(model: &Explained) -> bool {
    model.effects.last().is_none_or(|(e, values)| e.allows(values))
}

fn decibel(ratio: f64) -> f64 {
    let db = 10.0 * ratio.log10();
    if db.is_finite() { db } else { -300.0 }
}

/// Probability of such a fall of twice the negative logarithm of the likelihood by chance.
pub(crate) fn chance(fall: f64, parameters: usize) -> f64 {
    ChiSquared::new(parameters as f64).map_or(1.0, |d| d.sf(fall.max(0.0)))
}
