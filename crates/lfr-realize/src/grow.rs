//! From a local model to an LFR over the whole range: starts, cheap fits, one long fit.

mod coherent;
mod factorise;
mod settings;

use crate::sampling::Sampling;
use crate::{
    Candidate, CheckedRefineSettings, FrozenData, RandomChannels, RealizeError, RefineSettings, Refined,
    refine,
};
use coherent::Coherent;
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use nalgebra::DMatrix;
pub use settings::{CheckedGrowSettings, DeltaReach, GainFit, GrowSettings, StartSearch};
use std::time::Instant;

/// Where the channels of a start come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartKind {
    /// A polynomial of low degree through frozen models at all positions, its coefficients factorised.
    Coherent,
    /// Small random channels.
    Random {
        /// Same seed, same channels.
        seed: u64,
    },
}

/// How one start went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartAccount {
    /// Where its channels come from.
    pub kind: StartKind,
    /// Iterations of all its stages, the long fit included.
    pub iterations: usize,
    /// Time of all its stages on the wall clock, the long fit included.
    pub seconds: f64,
    /// Rms residual on the thinned lines; infinite if it failed.
    pub thinned_rms: f64,
    /// What became of it.
    pub outcome: StartOutcome,
}

/// What became of a start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StartOutcome {
    /// The long fit was made, and left this rms residual.
    Refined {
        /// In the unit of the data.
        rms: f64,
    },
    /// It missed the target on the thinned lines, and another start was better.
    Abandoned,
    /// The model had no response at some position of a ring.
    Failed,
}

/// The best model, and the account of all starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Grown<K: Sampling> {
    /// The model.
    pub refined: Refined<K>,
    /// One entry a start, in their order.
    pub starts: Vec<StartAccount>,
    /// Which start the model comes from.
    pub winner: usize,
    /// Whether the target was reached.
    pub reached: bool,
}

/// Fits an LFR with the given deltas to responses over the whole range, from a local model at its centre.
///
/// `local` and `gamma` are the flexible part and the gain of the rigid body, as [`crate::local_model`] gives them.
///
/// 1. The local model is fitted to one position after the other, outward from the centre, in coordinates that turn as
///    little as possible.
/// 2. The LFR of the flexible part is fitted to the responses of these models with more damping: `F(s + sigma)`, sigma
///    as far as the poles move. A resonance that moves by many times its width would hide the way.
/// 3. It is fitted to few lines of the data, and then to all.
///
/// The first start is the factorised polynomial through the local models, the others are small random channels: with
/// none at all the gradient vanishes, and small ones go where the data pull them. The long fit on all lines is made for
/// the starts that reach the target on few, until one reaches it on all lines too, or for the best if none does.
///
/// # Errors
/// [`RealizeError::Empty`] without deltas, [`RealizeError::Start`] if no start has a response at all positions, and those
/// of [`refine`] and [`Candidate::flexible`]. A target that is not reached is a result.
pub fn grow<K: Sampling>(
    local: &StateSpace<K>,
    gamma: Option<&DMatrix<f64>>,
    data: &FrozenData,
    deltas: &[DeltaBlock],
    scheduling: &SchedulingRange,
    settings: &CheckedGrowSettings,
) -> Result<Grown<K>, RealizeError> {
    if deltas.iter().all(|d| d.repetitions == 0) {
        return Err(RealizeError::Empty { what: "deltas" });
    }
    let set = settings.get();
    let random = |seed| RandomChannels { seed, size: set.size };
    // Checks what does not depend on the start.
    let mut whole = Candidate::flexible(local, gamma, deltas, scheduling.clone(), random(set.seed))?;
    if set.reach == DeltaReach::Outputs {
        whole = whole.with_free_outputs()?;
    }
    let thinned = data.thinned(set.lines);
    let field = Field {
        coherent: Coherent::new(local, gamma, &thinned, scheduling, set.reach)?,
        local,
        deltas,
        whole,
        thinned,
        data,
        settings,
    };
    let target = settings.target(data.unit());
    let mut starts: Vec<StartAccount> = Vec::new();
    // The best of the starts that missed the target on few lines, and of those that were fitted to all.
    let mut waiting: Option<(usize, Candidate<K>)> = None;
    let mut best: Option<(usize, Refined<K>)> = None;
    let mut failure = None;
    for at in 0..=set.restarts {
        let began = Instant::now();
        let mut account = StartAccount {
            kind: match at {
                0 => StartKind::Coherent,
                _ => StartKind::Random {
                    seed: set.seed.wrapping_add(at as u64 - 1),
                },
            },
            iterations: 0,
            seconds: 0.0,
            thinned_rms: f64::INFINITY,
            outcome: StartOutcome::Failed,
        };
        match field.start(random, &mut account) {
            Ok(candidate) => {
                account.outcome = StartOutcome::Abandoned;
                if account.thinned_rms <= target || set.search == StartSearch::All {
                    let refined = field.long_fit(candidate, &mut account)?;
                    if best
                        .as_ref()
                        .is_none_or(|(_, b)| refined.account.rms < b.account.rms)
                    {
                        best = Some((at, refined));
                    }
                } else if waiting
                    .as_ref()
                    .is_none_or(|(other, _)| account.thinned_rms < starts[*other].thinned_rms)
                {
                    waiting = Some((at, candidate));
                }
            }
            Err(error @ RealizeError::Start { .. }) => failure = Some(error),
            Err(error) => return Err(error),
        }
        account.seconds = began.elapsed().as_secs_f64();
        starts.push(account);
        let reached = best.as_ref().is_some_and(|(_, b)| b.account.rms <= target);
        if reached && set.search == StartSearch::UntilReached {
            break;
        }
    }
    if let (None, Some((at, candidate))) = (&best, waiting) {
        let began = Instant::now();
        best = Some((at, field.long_fit(candidate, &mut starts[at])?));
        starts[at].seconds += began.elapsed().as_secs_f64();
    }
    let none = RealizeError::Start {
        p: scheduling.centre(),
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

/// The damped fit ends at this relative rms: the fit to the data goes on from there.
const NEAR: f64 = 1e-3;

/// A start that wins less than this part of its cost in eight iterations is stuck.
const STUCK: f64 = 1e-2;

/// What all starts share.
struct Field<'a, K: Sampling> {
    coherent: Coherent<K>,
    local: &'a StateSpace<K>,
    deltas: &'a [DeltaBlock],
    /// Rigid body, mask and channels of every candidate.
    whole: Candidate<K>,
    thinned: FrozenData,
    data: &'a FrozenData,
    settings: &'a CheckedGrowSettings,
}

impl<K: Sampling> Field<'_, K> {
    /// A start, fitted to the damped responses and to the thinned data.
    fn start(
        &self,
        random: impl Fn(u64) -> RandomChannels,
        account: &mut StartAccount,
    ) -> Result<Candidate<K>, RealizeError> {
        let set = self.settings.get();
        let quick = |target: f64| -> Result<CheckedRefineSettings, RealizeError> {
            RefineSettings::new()
                .max_iterations(set.start_iterations)
                .tolerance(STUCK)
                .target(target)
                .check()
        };
        let flexible = |seed| self.coherent.random(self.local, self.deltas, random(seed));
        let start = match account.kind {
            StartKind::Coherent => self.coherent.factorised(flexible(set.seed)?)?,
            StartKind::Random { seed } => flexible(seed)?,
        };
        let (flexible, iterations) = self.coherent.fit(start, &quick(NEAR)?)?;
        account.iterations += iterations;
        let rigid = self.whole.states() - flexible.states();
        let mut m = self.whole.matrix().clone();
        let part = flexible.matrix();
        m.view_mut((rigid, rigid), part.shape()).copy_from(part);
        let target = self.settings.target(self.data.unit());
        let refined = refine(&self.whole.with_matrix(m), &self.thinned, &quick(target)?)?;
        account.iterations += refined.account.iterations();
        account.thinned_rms = refined.account.rms;
        Ok(refined.candidate)
    }

    fn long_fit(
        &self,
        candidate: Candidate<K>,
        account: &mut StartAccount,
    ) -> Result<Refined<K>, RealizeError> {
        let rigid = candidate.states() > self.local.states();
        let candidate = match self.settings.get().gain {
            GainFit::Free if rigid => candidate.with_free_gain()?,
            _ => candidate,
        };
        let refined = refine(&candidate, self.data, &self.settings.refine)?;
        account.iterations += refined.account.iterations();
        account.outcome = StartOutcome::Refined {
            rms: refined.account.rms,
        };
        Ok(refined)
    }
}
