//! From the end of a competition to what is told.

use super::bench::{Aim, Bench};
use super::chosen::Chosen;
use super::noise::loop_noise;
use super::{Case, Contest, ITERATIONS, Judged, LEFT, NOISE, Trace, Verdict};
use crate::TraceError;
use crate::base::Pair;
use crate::catalogue;
use crate::effect::EffectParameter;
use crate::fit::{Explained, Fitted, Problem, Seen, deviations};
use crate::force::prediction_errors;
use crate::left::{Left, what_is_left};
use crate::track::Track;
use crate::whiten::{LONG, SHORT, Whitening};
use rayon::prelude::*;
use std::f64::consts::LN_10;

/// Change of the errors by a finer integration, over the noise, that does not matter.
const STILL: f64 = 0.1;

/// Excess of the squared errors over the noise that is seen, and the part of it that effects must take to be named.
const SEEN: f64 = 0.2;
const TAKEN: f64 = 0.5;

/// Probability by chance below which a test is sure.
const CHANCE: f64 = 1e-3;
/// Part of the squared white error from which what a sure test sees is missing in the model.
pub const MISSING_SHARE: f64 = 0.05;

/// Iterations of a fit that is nearly there.
const FEW: usize = 4;

/// Deviations from zero that an amplitude must have to be one.
const SIGNIFICANT: f64 = 3.0;

/// Parts of a sample beyond which none are tried.
const FINEST: usize = 48;

impl Contest {
    pub(super) fn conclude(mut self, case: &Case<'_>) -> Result<Trace, TraceError> {
        // A competition is held with an integration that all can afford.
        let finer = self.finer(case);
        let finer = finer.as_ref().map(|[fitted, judged]| Case {
            fitted,
            judged,
            ..*case
        });
        let bench = Bench {
            whitening: self.whitening.clone(),
            case: finer.as_ref().unwrap_or(case),
            aim: Aim::Noise,
        };
        if finer.is_some() {
            self.bare = bench.problem().fit(&self.bare.model, FEW, None)?;
            self.before = bench.judge(&self.bare.model);
            self.now = bench.problem().fit(&self.now.model, ITERATIONS, None)?;
        }
        let mut chosen = Chosen {
            judged: bench.judge(&self.now.model),
            now: self.now,
            added: std::mem::take(&mut self.added),
            least: 0.0,
        };
        // What an effect explained may have been the coarse integration, or what a later one explains.
        chosen.keep_what_earns(&bench, &self.bare, finer.is_some());
        chosen.simplify(&bench, &self.bare);
        chosen.drop_weak(&bench, &self.bare);
        (self.now, self.after, self.added) = (chosen.now, chosen.judged, chosen.added);
        // The effects are in the loop through which the noise goes now.
        let mut noise = loop_noise(bench.case, &self.now.model, LONG)?;
        let verdict = self.verdict(&bench.told(&self.now.model, &noise).1);
        if verdict == Verdict::Unexplained && !self.added.is_empty() {
            self.added.clear();
            self.now = self.bare.clone();
            noise = loop_noise(bench.case, &self.now.model, LONG)?;
        }
        let forced = match verdict == Verdict::PartlyExplained && self.after.cost > NOISE {
            true => Some(bench.by_force(&self.now.model)?),
            false => None,
        };
        let shows_all =
            |f: &Fitted| (0..f.model.effects.len()).all(|i| f.shows(i) && bench.lasts(&f.model, i));
        let is_better = |f: &Fitted| shows_all(f) && self.falls_everywhere(&bench.judge(&f.model));
        let forced = forced.filter(is_better);
        let is_forced = forced.is_some();
        if let Some(forced) = forced {
            self.now = forced;
            if let Some((last, earlier)) = self.added.split_last_mut() {
                last.then = self.now.model.clone();
                for added in earlier {
                    added.then = bench.by_force(&added.then)?.model;
                }
            }
        }
        // A distance is resolved where it is larger than what is left of the motion.
        let left = bench.judge(&self.now.model).closed_loop;
        let resolved = [0, 1].map(|i| bench.case.noise[i].max(left[i]));
        let candidates = &mut self.candidates;
        for ((effect, values), added) in self.now.model.effects.iter_mut().zip(&mut self.added) {
            let turns = |channel| bench.turns(channel);
            let seen = catalogue::as_seen(effect, values, resolved, turns);
            let tried = candidates.iter_mut().filter(|t| t.effect.is(effect));
            tried.for_each(|t| t.effect = seen);
            (*effect, added.effect) = (seen, seen);
        }
        let model = self.now.model.clone();
        let stated = bench.stated(&self.now, is_forced);
        let machine = self.now.give_deviations(stated.into_iter(), &mut self.added);
        for added in &self.added {
            let tried = self.candidates.iter_mut();
            if let Some(last) = tried.rev().find(|t| t.effect.is(added.effect)) {
                last.accepted = true;
            }
        }
        let with = bench.told(&model, &noise);
        let without = bench.told(&self.bare.model, &noise);
        Ok(Trace {
            verdict,
            rigid: None,
            before: self.before,
            after: bench.judge(&model),
            deviations: machine,
            noise: noise.deviation,
            one_step: [&self.bare.model, &model].map(|m| bench.one_step(m)),
            errors: [without.0, with.0],
            left: [without.1, with.1],
            bare: self.bare.model,
            model,
            added: self.added,
            candidates: self.candidates,
        })
    }

    /// What the errors on the judged records amount to, and what tests still see in them. They are noise where they are as large,
    /// and no test is sure of a part that matters.
    fn verdict(&self, tests: &[Left]) -> Verdict {
        let left = (self.after.cost - 1.0).max(0.0) / (self.before.cost - 1.0).max(1e-9);
        let seen = tests
            .iter()
            .any(|t| t.adjusted < CHANCE && t.share > MISSING_SHARE);
        match (self.added.is_empty(), self.after.cost <= NOISE && !seen) {
            (true, true) => Verdict::NothingMissing,
            (false, true) if !self.is_seen_to_fall() => Verdict::Unexplained,
            (false, true) => Verdict::Explained,
            (false, false)
                if left <= LEFT && self.is_seen_to_fall() && self.falls_everywhere(&self.after) =>
            {
                Verdict::PartlyExplained
            }
            (_, false) => Verdict::Unexplained,
        }
    }

    /// Whether no output is further off than without the effects.
    fn falls_everywhere(&self, after: &Judged) -> bool {
        /// Factor by which an error that is not noise may grow by chance.
        const SAME: f64 = 1.1;
        (0..2).all(|i| {
            let before = self.before.closed_loop[i].max(self.whitening.deviation[i]);
            after.closed_loop[i] <= SAME * before
        })
    }

    /// Whether the errors themselves fall where they exceed the noise: white ones may, by an effect that hardly changes what one
    /// would see.
    fn is_seen_to_fall(&self) -> bool {
        let excess = |judged: &Judged| -> f64 {
            judged
                .closed_loop
                .iter()
                .zip(&self.whitening.deviation)
                .filter(|(_, noise)| **noise > 0.0)
                .map(|(error, noise)| ((error / noise).powi(2) - 1.0).max(0.0))
                .sum()
        };
        let before = excess(&self.before);
        before < SEEN || excess(&self.after) <= (1.0 - TAKEN) * before
    }

    /// Records to fit and to judge by, followed so finely that the errors of the result change no more; none where they do not
    /// anyway.
    fn finer(&self, case: &Case<'_>) -> Option<[Vec<Track>; 2]> {
        let errors = |judged: &[Track]| {
            let bench = Bench {
                whitening: self.whitening.clone(),
                case: &Case { judged, ..*case },
                aim: Aim::Noise,
            };
            bench
                .judging()
                .errors(&self.now.model)
                .unwrap_or_default()
                .concat()
        };
        let mut found = None;
        let mut coarse = errors(case.judged);
        let mut parts = case.judged.iter().map(Track::fine).max().unwrap_or(FINEST);
        while 2 * parts <= FINEST {
            parts *= 2;
            let judged: Vec<Track> = case.judged.iter().map(|t| t.followed(parts)).collect();
            let fine = errors(&judged);
            let moved = (0..case.base.channels()).any(|i| {
                let change: f64 = fine.iter().zip(&coarse).map(|(a, b)| (a[i] - b[i]).powi(2)).sum();
                change > fine.len() as f64 * (STILL * self.whitening.deviation[i]).powi(2)
            });
            if !moved {
                break;
            }
            let fitted = case.fitted.iter().map(|t| t.followed(parts)).collect();
            found = Some([fitted, judged]);
            coarse = fine;
        }
        found
    }
}

impl Bench<'_> {
    /// Root mean square of the error one step ahead on the judged records, by output.
    pub(super) fn one_step(&self, model: &Explained) -> Option<Pair> {
        let Case {
            controller,
            judged,
            noise,
            ..
        } = *self.case;
        let errors = prediction_errors(model, controller, judged, noise).ok()?;
        let count = errors.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let squares = |i: usize| errors.iter().flatten().map(|e| e[i] * e[i]).sum::<f64>();
        Some(std::array::from_fn(|i| (squares(i) / count).sqrt()))
    }

    /// By how much a finer integration would move the coordinates of a fit.
    fn moved_by_finer(&self, fit: &Fitted) -> Vec<f64> {
        /// Parts of which each is made, at most.
        const FINER: usize = 8;
        let tracks = self.case.fitted;
        let parts = tracks.iter().map(Track::fine).max().unwrap_or(1);
        let finer = (0..)
            .map(|n| parts << n)
            .take_while(|p| *p <= FINEST.min(FINER * parts));
        let finer = finer.last().unwrap_or(parts);
        let tracks: Vec<Track> = tracks.iter().map(|t| t.followed(finer)).collect();
        let problem = Problem {
            tracks: &tracks,
            ..self.problem()
        };
        let residual = problem.residual(&fit.model);
        residual.map_or_else(|| vec![0.0; fit.factor.ncols()], |r| problem.moved(fit, &r))
    }

    /// Standard deviations of all parameters that are fitted, as they are stated: by the noise or by what parts of the records would say
    /// without the others, whichever is larger, and by what a finer integration changes. That is far below what is left where a fit is one
    /// by force.
    pub(super) fn stated(&self, fit: &Fitted, is_by_force: bool) -> Vec<f64> {
        let finer = match is_by_force {
            true => vec![0.0; fit.factor.ncols()],
            false => self.moved_by_finer(fit),
        };
        let spread = fit.excess.sqrt();
        let parts = self.problem().deviations_without_parts(fit);
        // The noise alone is in units of what is left.
        let all = deviations(&fit.factor).into_iter().zip(parts).zip(finer);
        let all = all.map(|((noise, parts), finer)| noise.max(parts / spread).hypot(finer / spread));
        fit.in_values(all.collect()).collect()
    }

    /// A fit to what the controller gives, by its size: where errors are not noise, weights as if they were would follow the
    /// frequencies at which sensors are quiet and not those at which the model is wrong; and within the bandwidth the
    /// controller tells the force that the model lacks. The deviations are those of a noise with the spectrum of what is left.
    fn by_force(&self, model: &Explained) -> Result<Fitted, TraceError> {
        let fit =
            |model: &Explained, iterations: usize, whitening: &dyn Fn(&[Vec<Pair>], usize) -> Whitening| {
                let inputs = Problem {
                    seen: Seen::Inputs,
                    ..self.problem()
                };
                let left = inputs.errors(model).unwrap_or_default();
                let whitening = whitening(&left, self.case.base.channels());
                let problem = Problem {
                    whitening: &whitening,
                    ..inputs
                };
                problem.fit(model, iterations, None)
            };
        let sized = fit(model, ITERATIONS, &Whitening::by_size)?;
        fit(&sized.model, 0, &|left, channels| {
            Whitening::new(left, channels, SHORT)
        })
    }

    /// Errors on the judged records, and what tests find in them; nothing where the model diverges.
    pub(super) fn told(&self, model: &Explained, noise: &Whitening) -> (Vec<Vec<Pair>>, Vec<Left>) {
        let tracks = self.case.judged;
        let runs = tracks
            .par_iter()
            .map(|t| model.closed_loop(self.case.controller, t));
        let Some(runs) = runs.collect::<Option<Vec<_>>>() else {
            return (Vec::new(), Vec::new());
        };
        let errors: Vec<Vec<Pair>> = tracks.iter().zip(&runs).map(|(t, run)| run.error(t)).collect();
        let white: Vec<Vec<f64>> = errors
            .iter()
            .map(|e| {
                let mut out = Vec::new();
                noise.apply(e, &mut out);
                out
            })
            .collect();
        let left = what_is_left(&white, tracks, &runs, self.case.base.channels());
        (errors, left)
    }
}

impl Fitted {
    /// Standard deviations of all parameters that are fitted.
    pub(super) fn deviations(&self) -> impl Iterator<Item = f64> {
        self.in_values(deviations(&self.factor))
    }

    /// Deviations of values from those of the coordinates.
    fn in_values(&self, coordinates: Vec<f64>) -> impl Iterator<Item = f64> {
        /// Powers of ten within which one is known at least.
        const KNOWN: f64 = 3.0;
        let spread = self.excess.sqrt();
        // Of a logarithm that is hardly known, one deviation above tells more than the slope.
        let one = move |((d, s), is_logarithm): ((f64, f64), bool)| match is_logarithm {
            true if spread * d > KNOWN * LN_10 => f64::INFINITY,
            true => s * (spread * d).exp_m1(),
            false => s * spread * d,
        };
        let coordinates = coordinates.into_iter().zip(self.model.scales());
        coordinates.zip(self.model.bounded()).map(one)
    }

    /// Whether an effect has an amplitude that is not zero for all that is known.
    pub(super) fn shows(&self, i: usize) -> bool {
        self.shows_by(i, self.deviations())
    }

    /// The same by these deviations of all parameters that are fitted.
    pub(super) fn shows_by(&self, i: usize, deviations: impl Iterator<Item = f64>) -> bool {
        let effects = &self.model.effects;
        let earlier = effects[..i].iter().map(|(e, _)| e.fitted()).sum::<usize>();
        let mut deviations = deviations.skip(self.model.base.coordinates().len() + earlier);
        let (effect, values) = &effects[i];
        let shows = |(v, p): (&f64, &EffectParameter)| {
            let deviation = if p.scale.is_fitted() {
                deviations.next()
            } else {
                None
            };
            p.scale.is_amplitude() && deviation.is_some_and(|d| v.abs() > SIGNIFICANT * d)
        };
        values.iter().zip(effect.parameters).any(shows)
    }

    /// Standard deviations of the machine's parameters, infinite where they are held; those of the effects go to them.
    pub(super) fn give_deviations(
        &self,
        mut deviations: impl Iterator<Item = f64>,
        added: &mut [super::Added],
    ) -> Vec<f64> {
        let mut next = || deviations.next().unwrap_or(f64::INFINITY);
        let parameters = self.model.base.parameters();
        let machine = parameters
            .iter()
            .map(|p| if p.held { f64::INFINITY } else { next() })
            .collect();
        for (added, (effect, values)) in added.iter_mut().zip(&self.model.effects) {
            let each = values.iter().zip(effect.parameters);
            // What a start chose is not in doubt.
            added.values = each
                .map(|(v, p)| (*v, if p.scale.is_fitted() { next() } else { 0.0 }))
                .collect();
        }
        machine
    }
}
