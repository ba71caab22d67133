//! What all starts share, and one growth after the other.

use super::coherent::{Coherent, ERROR_FLOOR};
use super::{DeltaReach, GainFit, GrowSettings, Grown, StartAccount, StartKind, StartOutcome, StartSearch};
use crate::sampling::Sampling;
use crate::{
    Candidate, FitError, FrozenData, RandomChannels, RefineSettings, Refined, ResidualUnit, Rigid, refine,
};
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use std::time::Instant;

/// The damped fit ends at this relative rms: the fit to the data goes on from there.
const NEAR: f64 = 1e-3;

/// A start that wins less than this part of its cost in eight iterations is stuck.
const STUCK: f64 = 1e-2;

/// From one stage of the long fit to the next the lines of a position grow by this factor.
const STAGE: usize = 8;

/// What does not depend on the number of deltas.
pub(crate) struct Field<'a, K: Sampling> {
    local: &'a StateSpace<K>,
    rigid: Rigid<'a>,
    data: &'a FrozenData,
    scheduling: &'a SchedulingRange,
    settings: &'a GrowSettings,
    coherent: Coherent<K>,
    /// The data in few lines a position.
    few: FrozenData,
    /// The same without the lines of a very good signal to noise ratio, which lead a start astray.
    floored: Option<FrozenData>,
}

impl<'a, K: Sampling> Field<'a, K> {
    pub(crate) fn new(
        local: &'a StateSpace<K>,
        rigid: Rigid<'a>,
        data: &'a FrozenData,
        scheduling: &'a SchedulingRange,
        settings: &'a GrowSettings,
    ) -> Result<Self, FitError> {
        settings.check()?;
        let (coherent, few) = Coherent::in_few_lines(local, rigid, data, scheduling, settings)?;
        Ok(Self {
            coherent,
            local,
            rigid,
            data,
            scheduling,
            settings,
            floored: (data.unit() == ResidualUnit::StandardDeviation)
                .then(|| few.with_error_floor(ERROR_FLOOR)),
            few,
        })
    }

    /// The best model with these deltas; `given` has as many or fewer.
    pub(crate) fn grow(
        &self,
        deltas: &[DeltaBlock],
        given: Option<&Candidate<K>>,
    ) -> Result<Grown<K>, FitError> {
        let set = self.settings;
        let random = (0..set.restarts as u64).map(|at| StartKind::Random {
            seed: set.seed.wrapping_add(at),
        });
        let coherent = self
            .coherent
            .degrees()
            .into_iter()
            .map(|degree| StartKind::Coherent { degree });
        let mut kinds: Vec<StartKind> = coherent.collect();
        if let Some(given) = given {
            // One with as many deltas may need no fit; one with fewer has random channels.
            let whole = given.delta_count() == deltas.iter().map(|d| d.repetitions).sum::<usize>();
            kinds.insert(usize::from(!whole), StartKind::Given);
        }
        kinds.extend(random);
        self.best(kinds, deltas, given)
    }

    fn best(
        &self,
        kinds: Vec<StartKind>,
        deltas: &[DeltaBlock],
        given: Option<&Candidate<K>>,
    ) -> Result<Grown<K>, FitError> {
        if deltas.iter().all(|d| d.repetitions == 0) {
            return Err(FitError::Empty { what: "deltas" });
        }
        let set = self.settings;
        let target = self.target();
        let mut starts: Vec<StartAccount> = Vec::new();
        // The best of the starts that missed the target on few lines, and of those that were fitted to all.
        let mut waiting: Option<(usize, Candidate<K>)> = None;
        let mut best: Option<(usize, Refined<K>)> = None;
        let mut failure = None;
        for (at, kind) in kinds.into_iter().enumerate() {
            let began = Instant::now();
            let mut account = StartAccount {
                kind,
                iterations: 0,
                seconds: 0.0,
                few_rms: f64::INFINITY,
                outcome: StartOutcome::Failed,
            };
            match self.start(deltas, given, &mut account) {
                Ok(candidate) => {
                    account.outcome = StartOutcome::Abandoned;
                    if account.few_rms <= target || set.search == StartSearch::All {
                        let refined = self.long_fit(candidate, &mut account)?;
                        if best
                            .as_ref()
                            .is_none_or(|(_, b)| refined.account.rms < b.account.rms)
                        {
                            best = Some((at, refined));
                        }
                    } else if waiting
                        .as_ref()
                        .is_none_or(|(other, _)| account.few_rms < starts[*other].few_rms)
                    {
                        waiting = Some((at, candidate));
                    }
                }
                Err(error @ FitError::Start { .. }) => failure = Some(error),
                Err(error) => return Err(error),
            }
            account.seconds = began.elapsed().as_secs_f64();
            starts.push(account);
            let reached = best.as_ref().is_some_and(|(_, b)| b.account.rms <= target);
            if set.search == StartSearch::UntilReached && (reached || agree(&starts)) {
                break;
            }
        }
        if let (None, Some((at, candidate))) = (&best, waiting) {
            let began = Instant::now();
            best = Some((at, self.long_fit(candidate, &mut starts[at])?));
            starts[at].seconds += began.elapsed().as_secs_f64();
        }
        let none = FitError::Start {
            p: self.scheduling.centre(),
            problem: "no start could be made",
        };
        let (winner, refined) = best.ok_or_else(|| failure.unwrap_or(none))?;
        Ok(Grown {
            reached: refined.account.rms <= target,
            refined,
            starts,
            winner,
        })
    }

    fn target(&self) -> f64 {
        self.settings.target(self.data.unit())
    }

    /// A start, fitted to the damped responses and to few lines.
    fn start(
        &self,
        deltas: &[DeltaBlock],
        given: Option<&Candidate<K>>,
        account: &mut StartAccount,
    ) -> Result<Candidate<K>, FitError> {
        let set = self.settings;
        let quick = |target: f64| RefineSettings {
            max_iterations: set.start_iterations,
            tolerance: STUCK,
            target,
            ..RefineSettings::default()
        };
        let start = |rigid: Rigid<'_>, seed: u64| {
            let random = RandomChannels { seed, size: set.size };
            let start = Candidate::flexible(self.local, rigid, deltas, self.scheduling.clone(), random)?;
            match set.reach {
                DeltaReach::States => Ok(start),
                DeltaReach::Outputs => start.with_free_outputs(),
            }
        };
        let within = self.rigid.within();
        let flexible = match (account.kind, given) {
            (StartKind::Coherent { degree }, _) => {
                self.coherent.factorised(start(within, set.seed)?, degree)?
            }
            (StartKind::Given, Some(given)) => extended(start(within, set.seed)?, given),
            (StartKind::Given, None) => start(within, set.seed)?,
            (StartKind::Random { seed }, _) => start(within, seed)?,
        };
        let (flexible, iterations) = self.coherent.fit(flexible, &quick(NEAR))?;
        account.iterations += iterations;
        let whole = match (start(self.rigid, set.seed)?, set.gain, self.rigid.gain()) {
            (whole, GainFit::Free, Some(_)) => whole.with_free_gain()?,
            (whole, ..) => whole,
        };
        let beside = whole.states() - flexible.states();
        let mut m = whole.matrix().clone();
        let part = flexible.matrix();
        m.view_mut((beside, beside), part.shape()).copy_from(part);
        let mut whole = whole.with_matrix(m);
        if let Some(floored) = &self.floored {
            let near = refine(&whole, floored, &quick(1.0))?;
            account.iterations += near.account.iterations();
            whole = near.candidate;
        }
        let refined = refine(&whole, &self.few, &quick(self.target()))?;
        account.iterations += refined.account.iterations();
        account.few_rms = refined.account.rms;
        Ok(refined.candidate)
    }

    fn long_fit(&self, candidate: Candidate<K>, account: &mut StartAccount) -> Result<Refined<K>, FitError> {
        // Few lines leave little to do for many.
        let mut stages = Vec::new();
        if self.data.unit() == ResidualUnit::StandardDeviation {
            stages.push(self.few.clone());
        } else {
            let most = self.data.responses().map(lpv_core::Frf::len).max().unwrap_or(0);
            let lines = std::iter::successors(Some(STAGE * self.settings.lines), |n| Some(n * STAGE));
            stages.extend(lines.take_while(|n| *n < most).map(|n| self.data.thinned(n)));
        }
        let mut candidate = candidate;
        for stage in &stages {
            let fitted = refine(&candidate, stage, &self.settings.refine)?;
            account.iterations += fitted.account.iterations();
            candidate = fitted.candidate;
        }
        let refined = refine(&candidate, self.data, &self.settings.refine)?;
        account.iterations += refined.account.iterations();
        account.outcome = StartOutcome::Refined {
            rms: refined.account.rms,
        };
        Ok(refined)
    }
}

/// The search stops when so many starts agree on the lowest residual; so many of them are
/// random, since the coherent ones are alike.
const AGREE: (usize, usize) = (3, 2);

fn agree(starts: &[StartAccount]) -> bool {
    let least = starts.iter().map(|s| s.few_rms).fold(f64::INFINITY, f64::min);
    let same = |s: &&StartAccount| s.few_rms.is_finite() && s.few_rms <= 1.01 * least;
    let random = |s: &StartAccount| matches!(s.kind, StartKind::Random { .. });
    let ends: Vec<&StartAccount> = starts.iter().filter(same).collect();
    ends.len() >= AGREE.0 && ends.into_iter().filter(|s| random(s)).count() >= AGREE.1
}

/// The flexible part of a model with fewer deltas in the channels of another candidate; its other channels do not feed
/// those.
fn extended<K: Sampling>(base: Candidate<K>, given: &Candidate<K>) -> Candidate<K> {
    let (shape, nc) = (base.shape(), base.channels().len());
    let beside = given.states() - shape.states;
    // The k-th channel of a parameter becomes the k-th of that parameter.
    let mut taken = vec![false; nc];
    let places: Vec<Option<usize>> = given
        .channels()
        .iter()
        .map(|channel| {
            let place = (0..nc).find(|&j| !taken[j] && base.channels()[j] == *channel)?;
            taken[place] = true;
            Some(place)
        })
        .collect();
    let all = |inner: usize| {
        (0..inner)
            .map(Some)
            .chain(places.iter().map(move |p| p.map(|p| inner + p)))
    };
    let (old, mut m) = (given.matrix(), base.matrix().clone());
    for place in places.iter().flatten() {
        m.row_mut(shape.rows() + place).fill(0.0);
    }
    for (i, row) in all(shape.rows()).enumerate() {
        for (j, column) in all(shape.columns()).enumerate() {
            if let (Some(row), Some(column)) = (row, column) {
                m[(row, column)] = old[(beside + i, beside + j)];
            }
        }
    }
    base.with_matrix(m)
}
