//! The effects that earned a place so far.

use super::bench::Bench;
use super::refine::{is_worth, refined, simpler_forms};
use super::select::{Final, Selection, may_be_named, select};
use super::{Added, EQUAL, ITERATIONS, Judged, NOISE, SURE, decibel};
use crate::catalogue;
use crate::fit::Fitted;
use lpv_numerics::statistics::chi_squared_p_value;

/// Part of the excess that an effect must take to be tried further.
const SHARE: f64 = 0.2;

/// A base model with effects, in the order in which they came.
pub(super) struct Chosen {
    pub(super) now: Fitted,
    pub(super) judged: Judged,
    pub(super) added: Vec<Added>,
    /// Least fall of the cost on the judged records by which a further effect is one.
    pub(super) least: f64,
}

impl Chosen {
    /// Adds the best of a selection; whether it earns a place.
    pub(super) fn add(&mut self, selection: &Selection) -> bool {
        let Some(((effect, fit, after), runner_up)) = selection.best() else {
            return false;
        };
        let excess = (self.judged.cost - 1.0).max(0.0);
        let enough = after.cost <= NOISE || self.judged.cost - after.cost >= self.least.max(SHARE * excess);
        if !(enough && earns((fit, after), (&self.now, &self.judged))) {
            return false;
        }
        self.added.push(Added {
            effect,
            values: Vec::new(),
            then: fit.model.clone(),
            gain_db: decibel(self.judged.cost / after.cost),
            p_value: chi_squared_p_value(self.now.objective - fit.objective, effect.fitted()),
            runner_up,
        });
        (self.now, self.judged) = (fit.clone(), after.clone());
        true
    }

    /// Adds the best pair of effects where none earns a place alone; whether one earns it.
    pub(super) fn add_pair(&mut self, bench: &Bench<'_>, bare: &Fitted, selection: &Selection) -> bool {
        /// Effects that another one is sought beside.
        const BEAM: usize = 3;
        let pairs = selection.finals.iter().take(BEAM).filter_map(|first| {
            let selection = select(bench, &bare.model.base, (&first.1, first.2.cost), f64::INFINITY)?;
            let ((second, fit, judged), runner_up) = selection.best()?;
            Some((first.0, *second, fit.clone(), judged.clone(), runner_up))
        });
        let best = pairs.min_by(|a, b| a.3.cost.total_cmp(&b.3.cost));
        let Some((first, second, fit, judged, runner_up)) = best else {
            return false;
        };
        let fall = self.judged.cost - judged.cost;
        if fall < self.least.max(SHARE * self.judged.cost)
            || !earns((&fit, &judged), (&self.now, &self.judged))
        {
            return false;
        }
        for (effect, runner_up) in [(first, None), (second, runner_up)] {
            self.added.push(Added {
                effect,
                values: Vec::new(),
                then: fit.model.clone(),
                gain_db: 0.0,
                p_value: 1.0,
                runner_up,
            });
        }
        (self.now, self.judged) = (fit, judged);
        self.account(bench, bare);
        true
    }

    /// Which effect it was may show only when others are there too: each but the last is taken out, and chosen again beside the
    /// others. One that explains nothing beside them goes.
    pub(super) fn choose_again(&mut self, bench: &Bench<'_>, bare: &Fitted) {
        let mut changed = false;
        let mut i = 0;
        while i + 1 < self.added.len() {
            let Some((rest, without)) = self.without(bench, i) else {
                i += 1;
                continue;
            };
            if !earns((&self.now, &self.judged), (&rest, &without)) {
                self.added.remove(i);
                (self.now, self.judged) = (rest, without);
                changed = true;
                continue;
            }
            // One with fewer parameters may take the place with a larger objective, by no more than these cost.
            let rival = self.now.length();
            let selection = select(bench, &bare.model.base, (&rest, without.cost), rival);
            if let Some((best, runner_up)) = selection.as_ref().and_then(Selection::best)
                && self.is_better(i, best, without.cost)
                && let Some((fit, there)) = self.in_place(bench, i, &best.1)
            {
                self.added[i].effect = best.0;
                self.added[i].runner_up = runner_up;
                (self.now, self.judged) = (fit, there);
                changed = true;
            }
            i += 1;
        }
        if changed {
            self.account(bench, bare);
        }
    }

    /// Refinements take the place of effects where they are worth it on the judged records.
    pub(super) fn refine(&mut self, bench: &Bench<'_>, bare: &Fitted) {
        for i in 0..self.added.len() {
            if let Some((effect, fit, judged)) = self.refinement(bench, bare, i) {
                self.added[i].runner_up =
                    Some((self.added[i].effect, decibel(self.judged.cost / judged.cost)));
                self.added[i].effect = effect;
                (self.now, self.judged) = (fit, judged);
                self.account(bench, bare);
            }
        }
    }

    /// The best refinement of one effect that is worth it.
    fn refinement(&self, bench: &Bench<'_>, bare: &Fitted, i: usize) -> Option<Final> {
        let (rest, without) = match self.added.len() {
            1 => (bare.clone(), bench.judge(&bare.model)),
            _ => self.without(bench, i)?,
        };
        let mut last = self.now.clone();
        let own = last.model.effects.remove(i);
        last.model.effects.push(own);
        let screen = bench.look(&bare.model.base, &rest)?;
        let starts = refined(bench, &[(self.added[i].effect, last)], &rest, &screen)?;
        let finals = bench.finals(&starts.iter().collect::<Vec<_>>(), &rest, f64::INFINITY);
        let worth = finals.into_iter().filter_map(|(effect, fit)| {
            let (fit, judged) = self.in_place(bench, i, &fit)?;
            let falls = self.judged.cost - judged.cost >= self.least;
            let is_better = falls
                && may_be_named(effect, judged.cost, self.judged.cost)
                && is_worth(&judged, &self.judged, without.cost);
            let (at, values) = (&fit.model.effects[i].0, &fit.model.effects[i].1);
            let exists = at.allows(values) && catalogue::is_itself(at, values, bench.case.fitted);
            (is_better && exists && bench.lasts(&fit.model, i)).then_some((effect, fit, judged))
        });
        worth.min_by(|a, b| a.2.cost.total_cmp(&b.2.cost))
    }

    /// Effects whose amplitudes may as well be zero, or whose times no record shows, go, the last first; where the integration has
    /// changed also those that explain nothing beside the others. Amplitudes that make up for each other may each be zero where the effect may
    /// not: one without which much more is left stays.
    pub(super) fn keep_what_earns(&mut self, bench: &Bench<'_>, bare: &Fitted, has_changed: bool) {
        /// Factor of the squared error.
        const NEEDED: f64 = 2.0;
        let before = self.added.len();
        for i in (0..before).rev() {
            let lasts = bench.lasts(&self.now.model, i);
            // What a smooth force leaves of a stroke looks like a wave, in some parts of the records and not in others; and beside other effects
            // anything may stand for some of what these leave, if that is more than noise.
            let stays = || {
                let is_wave = catalogue::is_wave(self.added[i].effect);
                let may_be_anything = self.added.len() > 1 && self.judged.cost > NOISE;
                !(is_wave || may_be_anything)
                    || self.now.shows_by(i, bench.stated(&self.now, false).into_iter())
            };
            let shows = lasts && self.now.shows(i) && stays();
            if shows && !has_changed {
                continue;
            }
            let without = match self.added.len() {
                1 => Some((bare.clone(), bench.judge(&bare.model))),
                _ => self.without(bench, i),
            };
            if let Some((rest, without)) = without
                && !(shows && earns((&self.now, &self.judged), (&rest, &without)))
                && !(lasts && without.cost > NEEDED * self.judged.cost)
            {
                self.added.remove(i);
                (self.now, self.judged) = (rest, without);
            }
        }
        if self.added.len() < before {
            self.account(bench, bare);
        }
    }

    /// Effects that may as well be simpler become so: a refinement that was worth it need not be beside what came later, or without what went.
    pub(super) fn simplify(&mut self, bench: &Bench<'_>, bare: &Fitted) {
        for i in 0..self.added.len() {
            if let Some((effect, fit, judged)) = self.simpler(bench, bare, i) {
                self.added[i].effect = effect;
                (self.now, self.judged) = (fit, judged);
                self.account(bench, bare);
            }
        }
    }

    /// The simpler form of one effect, if the records do not show that it is worth more.
    fn simpler(&self, bench: &Bench<'_>, bare: &Fitted, i: usize) -> Option<Final> {
        let forms = simpler_forms(&self.now.model, i);
        if forms.is_empty() {
            return None;
        }
        let without = match self.added.len() {
            1 => bench.judge(&bare.model),
            _ => self.without(bench, i)?.1,
        };
        let as_good = forms.iter().filter_map(|form| {
            let fit = bench.problem().fit(form, ITERATIONS, Some(&self.now)).ok()?;
            let judged = bench.judge(&fit.model);
            let (effect, values) = &fit.model.effects[i];
            let is_as_good = effect.allows(values) && !is_worth(&self.judged, &judged, without.cost);
            is_as_good.then_some((*effect, fit, judged))
        });
        as_good.min_by(|a, b| a.2.cost.total_cmp(&b.2.cost))
    }

    /// Where more than noise is left beside several effects, the last of them goes if it brought little and lowers no force of the inverse
    /// dynamics: so much of any error looks like one effect or another.
    pub(super) fn drop_weak(&mut self, bench: &Bench<'_>, bare: &Fitted) {
        /// Fall of the squared error that is more, dB.
        const LITTLE: f64 = 2.0;
        while self.judged.cost > NOISE
            && self.added.len() > 1
            && self.added.last().is_some_and(|last| last.gain_db < LITTLE)
            && let Some((rest, without)) = self.without(bench, self.added.len() - 1)
            && !bench.lowers_force(&self.now.model, &rest.model)
        {
            self.added.pop();
            (self.now, self.judged) = (rest, without);
            self.account(bench, bare);
        }
    }

    /// A fit without one of the effects.
    pub(super) fn without(&self, bench: &Bench<'_>, i: usize) -> Option<(Fitted, Judged)> {
        let mut rest = self.now.model.clone();
        rest.effects.remove(i);
        let rest = bench.problem().fit(&rest, ITERATIONS, Some(&self.now)).ok()?;
        let judged = bench.judge(&rest.model);
        Some((rest, judged))
    }

    /// Whether another effect in the place of one explains the records in clearly fewer words, or as few with no more parameters;
    /// the cost on the judged records is `without` both.
    fn is_better(&self, i: usize, (effect, fit, there): &Final, without: f64) -> bool {
        let own = self.added[i].effect;
        let simpler = effect.fitted() < own.fitted();
        let most = self.now.length() + if simpler { EQUAL } else { -EQUAL };
        let refines = effect.refines(own);
        let worse = (there.cost - self.judged.cost) * there.samples as f64;
        !effect.is(own)
            && fit.length() < most
            && worse < SURE
            && (!refines || is_worth(there, &self.judged, without))
    }

    /// A fit whose last effect takes the place of another.
    fn in_place(&self, bench: &Bench<'_>, i: usize, fit: &Fitted) -> Option<(Fitted, Judged)> {
        let mut model = fit.model.clone();
        let last = model.effects.pop()?;
        model.effects.insert(i, last);
        let fit = bench.problem().fit(&model, ITERATIONS, Some(fit)).ok()?;
        let judged = bench.judge(&fit.model);
        Some((fit, judged))
    }

    /// What each effect brought, one after the other.
    pub(super) fn account(&mut self, bench: &Bench<'_>, bare: &Fitted) {
        let (mut before, mut cost) = (bare.objective, bench.judge(&bare.model).cost);
        for (i, added) in self.added.iter_mut().enumerate() {
            let mut model = self.now.model.clone();
            model.effects.truncate(i + 1);
            let fit = match i + 1 < self.now.model.effects.len() {
                true => bench.problem().fit(&model, ITERATIONS, Some(&self.now)),
                false => Ok(self.now.clone()),
            };
            let Ok(fit) = fit else { continue };
            let judged = bench.judge(&fit.model).cost;
            added.gain_db = decibel(cost / judged);
            added.p_value = chi_squared_p_value(before - fit.objective, added.effect.fitted());
            added.then = fit.model;
            (before, cost) = (fit.objective, judged);
        }
    }
}

/// Whether a fit with one effect more is better than one without by more than chance, on the judged records and in the length of
/// the description.
fn earns((with, there): (&Fitted, &Judged), (without, here): (&Fitted, &Judged)) -> bool {
    (here.cost - there.cost) * here.samples as f64 >= SURE && with.length() < without.length()
}
