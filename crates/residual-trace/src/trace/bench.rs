//! Fits and judgements of one case.

use super::{Case, ITERATIONS, Judged};
use crate::base::Base;
use crate::effect::{Effect, Scale};
use crate::fit::{Explained, Fitted, Problem, squares};
use crate::screen::{Known, Screen};
use crate::track::Track;
use crate::whiten::Whitening;
use nalgebra::DVector;

/// Iterations after which the leading fits go on.
const FIRST: usize = 2;
/// Part of the leader's gain by which a fit may be behind and still go on.
const BEHIND: f64 = 0.3;
/// How many go on at most.
const LEADERS: usize = 3;

pub(super) struct Bench<'a> {
    pub(super) case: &'a Case<'a>,
    pub(super) whitening: Whitening,
}

pub(super) struct Candidate {
    pub(super) effect: &'static Effect,
    pub(super) start: Explained,
    pub(super) predicted: f64,
}

impl<'a> Bench<'a> {
    pub(super) fn problem(&'a self) -> Problem<'a> {
        Problem {
            tracks: self.case.fitted,
            controller: self.case.controller,
            whitening: &self.whitening,
            prior: self.case.prior,
        }
    }

    pub(super) fn judging(&'a self) -> Problem<'a> {
        Problem {
            tracks: self.case.judged,
            prior: None,
            ..self.problem()
        }
    }

    pub(super) fn screen(&'a self, base: &'a Base, tracks: &'a [Track]) -> Screen<'a> {
        Screen {
            base,
            tracks,
            motions: Vec::new(),
            controller: self.case.controller,
            whitening: &self.whitening,
            known: None,
        }
    }

    /// The screen at a model, with motions and what is left of the residual.
    pub(super) fn look(&'a self, base: &'a Base, fitted: &Fitted) -> Option<Screen<'a>> {
        let mut screen = self.screen(base, self.case.fitted);
        screen.motions = self.problem().motions(&fitted.model, &screen)?;
        screen.known = Some(Known::new(&fitted.columns, &fitted.residual));
        Some(screen)
    }

    pub(super) fn judge(&'a self, model: &Explained, screen: &Screen<'_>) -> Judged {
        let none = Judged {
            closed_loop: [f64::INFINITY; 2],
            one_step: [f64::INFINITY; 2],
            cost: f64::INFINITY,
            samples: 1,
        };
        let Some(errors) = self.judging().errors(model, screen) else {
            return none;
        };
        let (mut closed_loop, mut one_step) = ([0.0; 2], [0.0; 2]);
        let (mut count, mut cost, mut samples) = (0, 0.0, 0);
        for error in &errors {
            let mut white = Vec::new();
            self.whitening.apply(error, &mut white);
            count += error.len();
            samples += white.len();
            cost += squares(&white);
            for i in 0..self.case.base.channels() {
                closed_loop[i] += error.iter().map(|e| e[i] * e[i]).sum::<f64>();
                one_step[i] += squares(&white[i * error.len()..(i + 1) * error.len()]);
            }
        }
        let root = |v: f64| (v / count.max(1) as f64).sqrt();
        Judged {
            closed_loop: closed_loop.map(root),
            one_step: one_step.map(root),
            cost: cost / samples.max(1) as f64,
            samples,
        }
    }

    pub(super) fn cost(&'a self, model: &Explained, screen: &Screen<'_>) -> f64 {
        self.problem()
            .residual(model, screen)
            .map_or(f64::INFINITY, |r| self.problem().objective(&r))
    }

    /// Full fits: all for a few steps, those that lead for as many as they need.
    pub(super) fn finals(
        &'a self,
        starts: &[&Explained],
        now: &Fitted,
        screen: &Screen<'_>,
    ) -> Vec<(&'static Effect, Fitted)> {
        let mut all: Vec<(&'static Effect, Fitted)> = starts
            .iter()
            .filter_map(|start| {
                let fit = self.problem().fit(start, screen, FIRST, Some(now)).ok()?;
                Some((start.effects.last()?.0, fit))
            })
            .collect();
        all.sort_by(|a, b| a.1.objective.total_cmp(&b.1.objective));
        let best = all.first().map_or(0.0, |(_, f)| f.objective);
        let near = best + BEHIND * (now.objective - best).max(0.0) + 30.0;
        for (_, fit) in all.iter_mut().take(LEADERS).filter(|(_, f)| f.objective <= near) {
            let better = self.problem().fit(&fit.model, screen, ITERATIONS, Some(&*fit));
            if let Ok(better) = better {
                *fit = better;
            }
        }
        all
    }

    /// The cost that a linear step in all parameters of the last effect, and in those of the machine, promises.
    pub(super) fn promise(&'a self, start: &Explained, now: &Fitted, screen: &Screen<'_>) -> Option<f64> {
        let mut residual = self.problem().residual(start, screen)?;
        let all = start.coordinates().len();
        let first = all - start.effects.last()?.0.parameters.len();
        let mut columns = self
            .problem()
            .columns(start, screen, &residual, first..all, &mut Vec::new())?;
        self.problem().weigh(&mut residual, now.excess);
        self.problem().weigh_columns(&mut columns, now.excess);
        let known = screen.known.as_ref()?;
        let residual = DVector::from_vec(residual);
        let own = &columns - &known.basis * known.basis.tr_mul(&columns);
        let left = &residual - &known.basis * known.basis.tr_mul(&residual);
        let step = own.clone().svd(true, true).solve(&(-&left), 1e-9).ok()?;
        Some((left + own * step).norm_squared())
    }

    /// One step from a start in the directions of the machine and of the amplitudes.
    pub(super) fn candidate(
        &'a self,
        effect: &'static Effect,
        values: Vec<f64>,
        now: &Fitted,
        screen: &Screen<'_>,
    ) -> Option<Candidate> {
        let mut start = now.model.clone();
        start.effects.push((effect, values));
        let all = start.coordinates();
        let first = all.len() - effect.parameters.len();
        let amplitudes = effect
            .parameters
            .iter()
            .take_while(|p| p.scale != Scale::Logarithmic)
            .count();
        let mut residual = self.problem().residual(&start, screen)?;
        let mut steps = Vec::new();
        let mut columns =
            self.problem()
                .columns(&start, screen, &residual, first..first + amplitudes, &mut steps)?;
        self.problem().weigh(&mut residual, now.excess);
        self.problem().weigh_columns(&mut columns, now.excess);
        let known = screen.known.as_ref()?;
        let residual = DVector::from_vec(residual);
        let own = &columns - &known.basis * known.basis.tr_mul(&columns);
        let left = &residual - &known.basis * known.basis.tr_mul(&residual);
        let before = known.left.norm_squared();
        let step = own.clone().svd(true, true).solve(&(-&left), 1e-9).ok()?;
        let mut predicted = before - (&left + &own * &step).norm_squared();
        let mut coordinates = all;
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
            predicted,
        })
    }
}
