//! Fits and judgements of one case.

use super::{Case, ITERATIONS, Judged};
use crate::base::Base;
use crate::catalogue::quantization;
use crate::effect::{Effect, Scale};
use crate::fit::{Explained, Fitted, Grain, Problem, Seen, squares};
use crate::inverse::Moved;
use crate::screen::{Known, Pulses, Screen};
use crate::track::Track;
use crate::whiten::Whitening;
use lpv_core::linalg::least_squares;
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Iterations after which the leading fits go on.
const FIRST: usize = 2;
/// Part of the leader's gain by which a fit may be behind and still go on.
const BEHIND: f64 = 0.3;
/// How many effects go on at most, each from all its starts.
const LEADERS: usize = 3;

pub(super) struct Bench<'a> {
    pub(super) case: &'a Case<'a>,
    pub(super) whitening: Whitening,
    pub(super) aim: Aim,
}

impl Candidate {
    /// From where it is fitted.
    pub(super) fn starts(&self) -> impl Iterator<Item = &Explained> {
        [&self.start].into_iter().chain(&self.by_force)
    }
}

/// What a competition is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Aim {
    /// Records explained down to their noise.
    Noise,
    /// Less force that is missing, see [`super::in_band`].
    Force,
}

pub(super) struct Candidate {
    pub(super) effect: &'static Effect,
    pub(super) start: Explained,
    /// A second start.
    pub(super) by_force: Option<Explained>,
    pub(super) predicted: f64,
}

impl<'a> Bench<'a> {
    pub(super) fn problem(&'a self) -> Problem<'a> {
        Problem {
            tracks: self.case.fitted,
            controller: self.case.controller,
            whitening: &self.whitening,
            prior: self.case.prior,
            seen: Seen::Outputs,
        }
    }

    pub(super) fn judging(&'a self) -> Problem<'a> {
        Problem {
            tracks: self.case.judged,
            prior: None,
            ..self.problem()
        }
    }

    /// The screen at a model, with motions and what is left of the residual.
    pub(super) fn look(&'a self, base: &'a Base, fitted: &Fitted) -> Option<Screen<'a>> {
        let tracks = self.case.fitted;
        let step = tracks.first()?.step;
        let longest = tracks.iter().map(|t| t.samples).max()?;
        let observes = tracks.iter().all(|t| t.follows);
        let rough = self.problem().rough(&fitted.model)?;
        Some(Screen {
            base,
            tracks,
            motions: self.problem().motions(&fitted.model)?,
            resolution: quantization::steps(tracks).map(|(step, _)| step),
            known: Known::new(fitted.columns().into_owned(), &fitted.residual, rough),
            moved: match base {
                Base::Axis(axis) if observes && axis.load().is_none() => Moved::all(tracks),
                _ => None,
            },
            pulses: Pulses::new(
                base,
                (self.case.controller, observes),
                &self.whitening,
                (longest, step),
            ),
        })
    }

    pub(super) fn judge(&'a self, model: &Explained) -> Judged {
        let none = Judged {
            closed_loop: [f64::INFINITY; 2],
            white: [f64::INFINITY; 2],
            cost: f64::INFINITY,
            samples: 1,
        };
        let Some(errors) = self.judging().errors(model) else {
            return none;
        };
        let (mut closed_loop, mut each) = ([0.0; 2], [0.0; 2]);
        let (mut count, mut cost, mut samples) = (0, 0.0, 0);
        for error in &errors {
            let mut white = Vec::new();
            self.whitening.apply(error, &mut white);
            count += error.len();
            samples += white.len();
            cost += squares(&white);
            for i in 0..self.case.base.channels() {
                closed_loop[i] += error.iter().map(|e| e[i] * e[i]).sum::<f64>();
                each[i] += squares(&white[i * error.len()..(i + 1) * error.len()]);
            }
        }
        let root = |v: f64| (v / count.max(1) as f64).sqrt();
        Judged {
            closed_loop: closed_loop.map(root),
            white: each.map(root),
            cost: cost / samples.max(1) as f64,
            samples,
        }
    }

    /// Whether an observer holds the machine at its records, and errors are no larger than the noise: what tests still see in them,
    /// too small an effect would explain to be looked for.
    pub(super) fn is_below_noise(&self, judged: &Judged) -> bool {
        let sizes = judged.closed_loop.iter().zip(&self.whitening.deviation);
        self.case.judged.iter().all(|t| t.follows)
            && sizes.take(self.case.base.channels()).all(|(e, n)| e <= n)
    }

    /// Whether the time constants of an effect can be resolved from these records.
    pub(super) fn lasts(&self, model: &Explained, i: usize) -> bool {
        /// Records over which what changes so slowly is a straight line, which a force may cause too.
        const STRAIGHT: f64 = 10.0;
        /// Part of a record before and after a change, and that a slow one takes: a wrong beginning looks like one that comes, or is over,
        /// at once.
        const SIDE: f64 = 0.03;
        let tracks = self.case.fitted;
        let longest = Track::longest(tracks);
        let shortest = tracks
            .iter()
            .map(|t| t.step * t.samples as f64)
            .fold(f64::INFINITY, f64::min);
        let step = tracks.first().map_or(0.0, |t| t.step);
        let (effect, values) = &model.effects[i];
        values.iter().zip(effect.parameters).all(|(v, p)| match p.scale {
            Scale::Duration => *v >= step.max(SIDE * shortest) && *v <= STRAIGHT * longest,
            Scale::Instant => *v >= SIDE * shortest && *v <= (1.0 - SIDE) * longest,
            Scale::Frequency => v * longest >= 1.0,
            _ => true,
        })
    }

    /// Whether the last effect of a model, a force of the motion of an axis, lowers the squared force of the inverse dynamics on the judged
    /// records, beside a model without it; also where these do not tell.
    pub(super) fn lowers_force(&self, model: &Explained, without: &Explained) -> bool {
        /// Part of it that is a fall.
        const FALL: f64 = 0.05;
        let left = |model: &Explained| -> Option<f64> {
            let judged = self.case.judged.iter();
            judged.map(|track| model.force_left(track)).sum()
        };
        if !model.ends_with_a_force() {
            return true;
        }
        match (left(model), left(without)) {
            (Some(with), Some(without)) => with <= (1.0 - FALL) * without,
            _ => true,
        }
    }

    /// Whether an output goes back in a fitted record, by more than its noise.
    pub(super) fn turns(&self, output: usize) -> bool {
        /// Deviations of the noise that are a way.
        const WAY: f64 = 10.0;
        let least = WAY * self.case.noise[output];
        let mut tracks = self.case.fitted.iter();
        tracks.any(|track| track.goes(output, least) == [true; 2])
    }

    /// Whether an observer holds an axis that goes the same way in all fitted records: there friction is a constant force.
    pub(super) fn goes_one_way(&self) -> bool {
        let tracks = self.case.fitted;
        tracks.iter().all(|t| t.follows) && !Track::go_both_ways(tracks, 0)
    }

    pub(super) fn cost(&'a self, model: &Explained) -> f64 {
        self.problem()
            .residual(model)
            .map_or(f64::INFINITY, |r| self.problem().objective(&r))
    }

    /// Full fits: all for a few steps, those that lead for as many as they need, as long as their objectives may still fall to the best one
    /// after those few steps, and to that of a `rival`.
    pub(super) fn finals(
        &'a self,
        starts: &[&Explained],
        now: &Fitted,
        rival: f64,
    ) -> Vec<(&'static Effect, Fitted)> {
        let of = starts.len() + (2 * LEADERS).min(starts.len());
        (self.case.on_fit)(0, of);
        let done = AtomicUsize::new(0);
        let one_more = || (self.case.on_fit)(done.fetch_add(1, Ordering::Relaxed) + 1, of);
        let mut all: Vec<(&'static Effect, Fitted)> = starts
            .par_iter()
            .filter_map(|start| {
                let fit = self.problem().fit(start, FIRST, Some(now)).ok()?;
                one_more();
                Some((start.effects.last()?.0, fit))
            })
            .collect();
        all.sort_by(|a, b| a.1.objective.total_cmp(&b.1.objective));
        let best = all.first().map_or(0.0, |(_, f)| f.objective);
        let near = best + BEHIND * (now.objective - best).max(0.0) + 30.0;
        let mut leading: Vec<&Effect> = Vec::new();
        let leaders: Vec<&mut Fitted> = all
            .iter_mut()
            .filter_map(|(effect, fit)| {
                if leading.len() < LEADERS && !leading.iter().any(|e| e.is(effect)) {
                    leading.push(effect);
                }
                (fit.objective <= near && leading.iter().any(|e| e.is(effect))).then_some(fit)
            })
            .collect();
        done.store(starts.len(), Ordering::Relaxed);
        leaders.into_par_iter().for_each(|fit| {
            let goal = best.min(rival);
            if let Ok(better) = self
                .problem()
                .fit_towards(goal, &fit.model, ITERATIONS, Some(&*fit))
            {
                *fit = better;
            }
            one_more();
        });
        all
    }

    /// The part of a screen on the record with the largest residual, for many trials.
    pub(super) fn narrow(&'a self, fitted: &Fitted, screen: &Screen<'a>) -> Option<(Problem<'a>, Known)> {
        let rough = screen.known.rough.as_slice();
        let size = |r: usize| {
            let rows = self.rows(r);
            squares(&fitted.residual[rows.clone()]) / rows.len() as f64
        };
        let worst = (0..self.case.fitted.len()).max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
        let problem = Problem {
            tracks: &self.case.fitted[worst..=worst],
            prior: None,
            ..self.problem()
        };
        let rows = self.rows(worst);
        let columns = fitted.columns().rows(rows.start, rows.len()).into_owned();
        let known = Known::new(columns, &fitted.residual[rows.clone()], rough[rows].to_vec());
        Some((problem, known))
    }

    /// Rows of a record in the residual.
    fn rows(&self, record: usize) -> std::ops::Range<usize> {
        let channels = self.case.base.channels();
        let length = |t: &Track| t.samples * channels;
        let first = self.case.fitted[..record].iter().map(length).sum();
        first..first + length(&self.case.fitted[record])
    }

    /// The cost that a linear step in all parameters of the last effect, and in those of the machine, promises.
    pub(super) fn promise(
        &'a self,
        start: &Explained,
        (problem, known): (&Problem<'_>, &Known),
        now: &Fitted,
    ) -> Option<f64> {
        let all = start.coordinates().len();
        let first = all - start.effects.last()?.0.fitted();
        let rough = problem.rough(start)?;
        let (left, _) = step((problem, known), start, &rough, first..all, now)?;
        Some(left)
    }

    /// One linear step from the present model, which tells little where that is far from the records; and beside it what least squares say of the
    /// force along what was measured, where that is nearer to them.
    pub(super) fn candidate(
        &'a self,
        effect: &'static Effect,
        values: Vec<f64>,
        now: &Fitted,
        screen: &Screen<'_>,
    ) -> Option<Candidate> {
        let left = |start: &Explained| Some(squares(&self.problem().rough(start)?));
        let by_force = screen.moved.as_ref().and_then(|moved| {
            let mut start = now.model.clone();
            start.effects.push((effect, values.clone()));
            let is_force = start.starts_with_a_force();
            let start = is_force.then(|| start.by_its_force(self.case.fitted, moved))??;
            Some((left(&start)?, start))
        });
        let by_step = self.candidate_by_step(effect, values, now, screen)?;
        match by_force {
            Some((left_by_force, start)) if left(&by_step.start).is_none_or(|left| left_by_force < left) => {
                let predicted = screen.known.left.norm_squared() - left_by_force;
                Some(Candidate {
                    predicted: by_step.predicted.max(predicted),
                    by_force: Some(start),
                    ..by_step
                })
            }
            _ => Some(by_step),
        }
    }

    /// One step from a start in the directions of the machine and of the amplitudes.
    fn candidate_by_step(
        &'a self,
        effect: &'static Effect,
        values: Vec<f64>,
        now: &Fitted,
        screen: &Screen<'_>,
    ) -> Option<Candidate> {
        let known = &screen.known;
        let amplitudes = effect
            .parameters
            .iter()
            .take_while(|p| p.scale.is_amplitude())
            .count();
        let absent = values.iter().take(amplitudes).all(|v| *v == 0.0);
        let mut start = now.model.clone();
        start.effects.push((effect, values));
        let mut coordinates = start.coordinates();
        let first = coordinates.len() - effect.fitted();
        let rough = if absent {
            None
        } else {
            Some(self.problem().rough(&start)?)
        };
        let rough = rough.as_ref().unwrap_or(&known.rough);
        let which = first..first + amplitudes;
        let (left, step) = step((&self.problem(), known), &start, rough, which, now)?;
        let mut predicted = known.left.norm_squared() - left;
        for (i, s) in step.iter().enumerate() {
            coordinates[first + i] += s;
        }
        // An amplitude of zero hides the shape from the next step.
        let mut start = start.with(&coordinates);
        if let Some((effect, values)) = start.effects.last_mut() {
            for (v, p) in values.iter_mut().zip(effect.parameters) {
                if p.scale == Scale::NotNegative && *v <= 0.0 {
                    // It would have to be less than nothing.
                    predicted = 0.0;
                }
            }
        }
        Some(Candidate {
            effect,
            start,
            by_force: None,
            predicted,
        })
    }
}

/// The cost that a linear step in some parameters, and in those of the machine, leaves; and the step.
fn step(
    (problem, known): (&Problem<'_>, &Known),
    start: &Explained,
    rough: &[f64],
    which: std::ops::Range<usize>,
    now: &Fitted,
) -> Option<(f64, DVector<f64>)> {
    let grain = (Grain::Rough, rough);
    let mut columns = problem.columns(start, grain, which, &mut Vec::new())?;
    problem.weigh_columns(&mut columns, now.scale);
    // The start's residual is that of the present model and a small difference.
    let mut change: Vec<f64> = rough.iter().zip(&known.rough).map(|(a, b)| a - b).collect();
    problem.weigh(&mut change, now.scale);
    let residual = &known.residual + DVector::from_vec(change);
    let own = &columns - &known.basis * known.basis.tr_mul(&columns);
    let left = &residual - &known.basis * known.basis.tr_mul(&residual);
    let step = least_squares(own.clone(), &(-&left), 1e-9).ok()?;
    Some(((left + own * &step).norm_squared(), step))
}
