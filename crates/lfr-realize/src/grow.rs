//! From a local model to an LFR over the whole range: random channels, cheap fits, one long fit.

mod settings;

use crate::sampling::Sampling;
use crate::{
    Candidate, CheckedRefineSettings, FrozenData, RandomChannels, RealizeError, RefineSettings, Refined,
    refine,
};
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use nalgebra::DMatrix;
pub use settings::{CheckedGrowSettings, DeltaReach, GainFit, GrowSettings};

/// How one start went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartAccount {
    /// Seed of its channels.
    pub seed: u64,
    /// Iterations of all its stages, the long fit included.
    pub iterations: usize,
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
    /// Whether the target was reached.
    pub reached: bool,
}

/// Fits an LFR with the given deltas to responses over the whole range, from a local model at its centre.
///
/// `local` and `gamma` are the flexible part and the gain of the rigid body, as [`crate::local_model`] gives them. The
/// deltas begin as small random channels: with none at all the gradient vanishes, and small ones go where the data
/// pull them. Each start is fitted on few lines first; the long fit on all lines is made for the starts that reach the
/// target there, until one reaches it on all lines too, or for the best if none does.
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
    let target = settings.target(data.unit());
    let rings = rings(&data.thinned(set.lines), scheduling, set.rings)?;
    let quick = RefineSettings::new()
        .max_iterations(set.start_iterations)
        .tolerance(STUCK)
        .target(target)
        .check()?;
    let long_fit = |candidate: Candidate<K>, account: &mut StartAccount| {
        let candidate = match (set.gain, gamma) {
            (GainFit::Free, Some(_)) => candidate.with_free_gain()?,
            _ => candidate,
        };
        let refined = refine(&candidate, data, &settings.refine)?;
        account.iterations += refined.account.iterations();
        account.outcome = StartOutcome::Refined {
            rms: refined.account.rms,
        };
        Ok::<_, RealizeError>(refined)
    };
    let mut starts: Vec<StartAccount> = Vec::new();
    // The best of the starts that missed the target on few lines, and of those that were fitted to all.
    let mut waiting: Option<(usize, Candidate<K>)> = None;
    let mut best: Option<Refined<K>> = None;
    let mut failure = None;
    for restart in 0..=set.restarts {
        let mut account = StartAccount {
            seed: set.seed.wrapping_add(restart as u64),
            iterations: 0,
            thinned_rms: f64::INFINITY,
            outcome: StartOutcome::Failed,
        };
        let random = RandomChannels {
            seed: account.seed,
            size: set.size,
        };
        let mut start = Candidate::flexible(local, gamma, deltas, scheduling.clone(), random)?;
        if set.reach == DeltaReach::Outputs {
            start = start.with_free_outputs()?;
        }
        match widen(start, &rings, &quick, &mut account) {
            Ok(grown) => {
                account.outcome = StartOutcome::Abandoned;
                if account.thinned_rms <= target {
                    let refined = long_fit(grown, &mut account)?;
                    if best.as_ref().is_none_or(|b| refined.account.rms < b.account.rms) {
                        best = Some(refined);
                    }
                } else if waiting
                    .as_ref()
                    .is_none_or(|(at, _)| account.thinned_rms < starts[*at].thinned_rms)
                {
                    waiting = Some((restart, grown));
                }
            }
            Err(error @ RealizeError::Start { .. }) => failure = Some(error),
            Err(error) => return Err(error),
        }
        starts.push(account);
        if best.as_ref().is_some_and(|b| b.account.rms <= target) {
            break;
        }
    }
    if let (None, Some((at, candidate))) = (&best, waiting) {
        best = Some(long_fit(candidate, &mut starts[at])?);
    }
    let none = RealizeError::Start {
        p: scheduling.centre(),
        problem: "no start could be made",
    };
    let refined = best.ok_or_else(|| failure.unwrap_or(none))?;
    Ok(Grown {
        reached: refined.account.rms <= target,
        refined,
        starts,
    })
}

/// A start that wins less than this part of its cost in eight iterations is stuck.
const STUCK: f64 = 1e-2;

/// Fits ring after ring, each from the end of the one before.
fn widen<K: Sampling>(
    mut candidate: Candidate<K>,
    rings: &[FrozenData],
    quick: &CheckedRefineSettings,
    account: &mut StartAccount,
) -> Result<Candidate<K>, RealizeError> {
    for ring in rings {
        let refined = refine(&candidate, ring, quick)?;
        account.iterations += refined.account.iterations();
        account.thinned_rms = refined.account.rms;
        candidate = refined.candidate;
    }
    Ok(candidate)
}

/// Data sets that widen from the centre of the range, by the largest normalised parameter; the last is all.
fn rings(
    data: &FrozenData,
    scheduling: &SchedulingRange,
    count: usize,
) -> Result<Vec<FrozenData>, RealizeError> {
    for p in data.scheduling() {
        scheduling.check(p)?;
    }
    let distance = |p: &[f64]| {
        scheduling
            .normalise(p)
            .into_iter()
            .fold(0.0, |d: f64, v| d.max(v.abs()))
    };
    let mut distances: Vec<f64> = data.scheduling().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    // Positions that differ by rounding belong to one ring.
    distances.dedup_by(|a, b| *a - *b < 1e-9);
    let count = count.min(distances.len());
    (1..=count)
        .map(|ring| {
            let outer = distances[distances.len() * ring / count - 1];
            data.subset(|p| distance(p) <= outer + 1e-9)
        })
        .collect()
}
