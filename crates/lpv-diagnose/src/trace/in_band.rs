//! The competition where no effect explains the records down to their noise: by the force that is missing in the band of the motion.
//!
//! More is wrong with a measured machine than a catalogue holds, and its error is thousands of times the noise of a reading. Whitened
//! by that noise it is what happens between two samples, of which the model knows nothing. Here it counts as the force that would take
//! it away, `M (w^2 e + 2 d w e')` for an observer of bandwidth w, up to some times that bandwidth: what an engineer compares as
//! the force of the inverse dynamics behind a low-pass \[janot2014\].
//!
//! What is left is no noise, so that no test tells which effects are there. Only those are tried that every machine has to some degree,
//! friction and forces that depend on where it is. They are named if the force that is missing falls on held-out records and on most records by
//! themselves; where much is left, dry friction alone.

use super::bench::{Aim, Bench};
use super::chosen::Chosen;
use super::noise::loop_noise;
use super::refine::WORTH;
use super::{Case, Contest, ITERATIONS, NOISE, Trace, Verdict, compete};
use crate::TraceError;
use crate::base::Base;
use crate::catalogue;
use crate::effect::{Effect, Family};
use crate::fit::{Explained, Fitted, Problem, Seen, squares};
use crate::observer::{DAMPING, FORCE_BAND};
use crate::track::Track;
use crate::whiten::{LONG, SHORT, Whitening};
use std::f64::consts::TAU;

/// Times the noise from which an error is that of the model.
const FAR: f64 = 30.0;
/// Time over which a rate is a mean, in periods of the highest frequency that counts: half of that amplitude is left.
const SPAN: f64 = 0.44;
/// Units far below the error, so that a fit minimises the logarithm of its size.
const FINER: f64 = 1e3;
/// Part of the squared force that may be left where effects are named, and where dry friction alone is.
const LEFT: f64 = 0.5;
const LEFT_BY_DRY_FRICTION: f64 = 0.8;
/// Part of the squared force of one record that counts as a fall, and part of the records on which it must fall.
const FALL: f64 = 0.05;
const MOST: f64 = 0.66;

impl Aim {
    /// Least fall of a cost that was so much without effects by which one is named: a trifle of the force says nothing where all else that
    /// is missing is not known.
    pub(super) fn least(self, before: f64) -> f64 {
        const PART: f64 = 0.05;
        match self {
            Self::Noise => 0.0,
            Self::Force => PART * before,
        }
    }

    /// Whether an effect is looked for.
    pub(super) fn admits(self, effect: &Effect) -> bool {
        let is_friction = effect.family == Family::Friction;
        // A straight force of position may also push away, which no cable does.
        let is_smooth =
            effect.family == Family::PositionForce && !["cogging", "cable-stiffness"].contains(&effect.name);
        match self {
            Self::Noise => !catalogue::is_rough(effect),
            // Refinements come last, see `Chosen::refine`.
            Self::Force => (is_friction || is_smooth) && !catalogue::is_refined(effect),
        }
    }
}

/// The same search where an observer of this bandwidth holds an axis at its records and `found`, what [`trace`](super::trace)
/// says of them, is far from their noise: by the force that is missing in the band of the motion. None where that names nothing.
///
/// # Errors
/// [`TraceError::Diverges`].
pub fn trace_in_band(case: &Case<'_>, observer_hz: f64, found: &Trace) -> Result<Option<Trace>, TraceError> {
    let is_held = case.fitted.iter().chain(case.judged).all(|t| t.follows);
    let is_explained = matches!(found.verdict, Verdict::Explained | Verdict::NothingMissing);
    let is_far = (0..case.base.channels()).all(|i| found.after.closed_loop[i] > FAR * found.noise[i]);
    if !(is_held && is_far && matches!(case.base, Base::Axis(_))) || is_explained {
        return Ok(None);
    }
    let start = Explained {
        base: case.base.clone(),
        effects: Vec::new(),
    };
    let whitening = in_band(case, observer_hz, &start)?;
    let bench = Bench {
        whitening: whitening.clone(),
        case,
        aim: Aim::Force,
    };
    let bare = bench.problem().fit(&start, ITERATIONS, None)?;
    let contest = compete(case, Aim::Force, (whitening, bare));
    contest.conclude_in_band(&bench, found)
}

/// The force that is missing, in units far below its size.
fn in_band(case: &Case<'_>, observer_hz: f64, start: &Explained) -> Result<Whitening, TraceError> {
    let w = TAU * observer_hz;
    let step = case.fitted.first().map_or(1.0, |t| t.step);
    let span = (SPAN / (FORCE_BAND * observer_hz * step)).round().max(1.0) as usize;
    let channels = case.base.channels();
    let mut errors = Vec::new();
    for track in case.fitted {
        let run = start.closed_loop(case.controller, track);
        let run = run.ok_or_else(|| TraceError::Diverges {
            record: track.name.clone(),
        })?;
        errors.push(run.error(track));
    }
    let force = Whitening::by_force(channels, [w * w, 2.0 * DAMPING * w], (span, step));
    Ok(force.sized(&errors).finer(FINER))
}

impl Contest {
    fn conclude_in_band(self, bench: &Bench<'_>, strict: &Trace) -> Result<Option<Trace>, TraceError> {
        let case = bench.case;
        let mut chosen = Chosen {
            now: self.now,
            judged: self.after,
            added: self.added,
            least: bench.aim.least(self.before.cost),
        };
        let coloured = loop {
            let coloured = bench.coloured(&chosen.now)?;
            let hidden = (0..chosen.added.len())
                .rev()
                .find(|i| !(coloured.shows(*i) && bench.lasts(&chosen.now.model, *i)));
            let Some(i) = hidden else { break coloured };
            chosen.added.remove(i);
            match chosen.without(bench, i) {
                Some((rest, judged)) if !chosen.added.is_empty() => {
                    (chosen.now, chosen.judged) = (rest, judged)
                }
                _ => return Ok(None),
            }
            chosen.account(bench, &self.bare);
        };
        let strictly = bench.judge(&strict.model).cost;
        if !strict.added.is_empty() && strict.explains_more(strictly, &chosen) {
            return Ok(None);
        }
        if !bench.is_named(&self.bare, &chosen, self.before.cost) {
            return Ok(None);
        }
        let mut added = chosen.added;
        let deviations = coloured.give_deviations(coloured.deviations(), &mut added);
        let model = chosen.now.model;
        // Told as everything else: errors of the outputs and over the noise.
        let noise = loop_noise(case, &model, LONG)?;
        let told = Bench {
            whitening: loop_noise(case, &self.bare.model, SHORT)?,
            case,
            aim: Aim::Noise,
        };
        let with = told.told(&model, &noise);
        let without = told.told(&self.bare.model, &noise);
        let mut candidates = strict.candidates.clone();
        candidates.extend(self.candidates);
        candidates.iter_mut().for_each(|t| t.accepted = false);
        for a in &added {
            if let Some(last) = candidates.iter_mut().rev().find(|t| t.effect.is(a.effect)) {
                last.accepted = true;
            }
        }
        Ok(Some(Trace {
            verdict: Verdict::PartlyExplained,
            rigid: None,
            before: told.judge(&self.bare.model),
            after: told.judge(&model),
            deviations,
            noise: noise.deviation,
            one_step: [&self.bare.model, &model].map(|m| told.one_step(m)),
            errors: [without.0, with.0],
            left: [without.1, with.1],
            bare: self.bare.model,
            model,
            added,
            candidates,
        }))
    }
}

impl Trace {
    /// Whether what the competition down to the noise found, which leaves this cost in the band, stands beside what was chosen there. Effects
    /// that not every machine has must explain far more.
    fn explains_more(&self, cost: f64, chosen: &Chosen) -> bool {
        /// Factor between squared forces by which other effects explain far more.
        const FAR_MORE: f64 = 2.0;
        let [own, there] =
            [&self.added, &chosen.added].map(|added| added.iter().map(|a| a.effect).collect::<Vec<_>>());
        let are_same = own.len() == there.len() && own.iter().all(|e| there.iter().any(|t| t.is(e)));
        let least = match own.iter().all(|e| Aim::Force.admits(e)) {
            _ if are_same => 1.0,
            true => WORTH,
            false => FAR_MORE,
        };
        least * cost < chosen.judged.cost
    }
}

impl Bench<'_> {
    /// The account of a fit with deviations that know the colour of what is left.
    fn coloured(&self, fit: &Fitted) -> Result<Fitted, TraceError> {
        let problem = Problem {
            seen: Seen::Outputs,
            ..self.problem()
        };
        let left = problem.errors(&fit.model).unwrap_or_default();
        let whitening = Whitening::new(&left, self.case.base.channels(), SHORT);
        let problem = Problem {
            whitening: &whitening,
            ..problem
        };
        problem.fit(&fit.model, 0, None)
    }

    /// Whether so much of the force that was missing is explained that the effects are named.
    fn is_named(&self, bare: &Fitted, chosen: &Chosen, before: f64) -> bool {
        let left = chosen.judged.cost / before.max(f64::MIN_POSITIVE);
        let is_dry = chosen.added.iter().all(|a| a.effect.name == "coulomb-friction");
        let most = if is_dry { LEFT_BY_DRY_FRICTION } else { LEFT };
        let tracks = [self.case.fitted, self.case.judged].map(|tracks| {
            let [before, after] = [&bare.model, &chosen.now.model].map(|m| self.by_record(m, tracks));
            let fell = before
                .iter()
                .zip(&after)
                .filter(|(b, a)| **a <= (1.0 - FALL) * **b);
            fell.count()
        });
        let records = self.case.fitted.len() + self.case.judged.len();
        let fell = tracks[0] + tracks[1];
        chosen.judged.cost > NOISE && left <= most && fell as f64 >= MOST * records as f64
    }

    /// Squares of the white errors of each record; infinite where the model leaves all bounds.
    fn by_record(&self, model: &Explained, tracks: &[Track]) -> Vec<f64> {
        let one = |track: &Track| {
            let run = model.closed_loop(self.case.controller, track)?;
            let mut white = Vec::new();
            self.whitening.apply(&run.error(track), &mut white);
            Some(squares(&white))
        };
        tracks.iter().map(|t| one(t).unwrap_or(f64::INFINITY)).collect()
    }
}
