//! Several starts, a quick fit of each, a long fit of the best.

use crate::sampling::Sampling;
use crate::{Candidate, CheckedRefineSettings, FrozenData, RealizeError, RefineSettings, Refined, refine};
use lpv_core::SchedulingRange;

/// What a start was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FactorStart {
    /// Truncation of states and deltas by Gramians averaged over positions and lines, one block for the states and one for
    /// each parameter.
    Balanced,
    /// Local models in one state basis, a polynomial of this degree through them, its Hankel matrix cut to rank.
    Coherent {
        /// Degree of the polynomial in the deltas.
        degree: usize,
    },
    /// The local model at the centre with small random channels, see [`crate::RandomChannels`].
    Random {
        /// Same seed, same channels.
        seed: u64,
    },
}

/// How a start went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorAccount {
    /// The start.
    pub start: FactorStart,
    /// Rms residual on few lines before any iteration; infinite where there is no response.
    pub before: f64,
    /// The same after the quick fit.
    pub after: f64,
    /// Iterations of the quick fit, and of the long one if it was made.
    pub iterations: usize,
}

/// How to choose among starts.
pub(crate) struct Selection {
    /// Lines a position of the quick fits.
    pub(crate) lines: usize,
    /// Most iterations of a quick fit.
    pub(crate) iterations: usize,
    /// Rms residual after which no further start is tried.
    pub(crate) target: f64,
    /// The long fit.
    pub(crate) refine: CheckedRefineSettings,
}

/// A start that wins less than this part of its cost in eight iterations is stuck.
const STUCK: f64 = 1e-2;

impl Selection {
    /// The best model, the account of all starts tried, and which one won. The long fit is made for the starts that reach
    /// the target on few lines, until one reaches it on all; for the best if none does.
    pub(crate) fn best<K: Sampling>(
        &self,
        starts: Vec<(FactorStart, Candidate<K>)>,
        data: &FrozenData,
        range: &SchedulingRange,
    ) -> Result<(Refined<K>, Vec<FactorAccount>, usize), RealizeError> {
        let thinned = data.thinned(self.lines);
        let quick = RefineSettings::new()
            .max_iterations(self.iterations)
            .tolerance(STUCK)
            .target(self.target)
            .check()?;
        let mut accounts: Vec<FactorAccount> = Vec::new();
        let mut waiting: Option<(usize, Candidate<K>)> = None;
        let mut best: Option<(usize, Refined<K>)> = None;
        for (index, (start, candidate)) in starts.into_iter().enumerate() {
            let mut account = FactorAccount {
                start,
                before: f64::INFINITY,
                after: f64::INFINITY,
                iterations: 0,
            };
            match refine(&candidate, &thinned, &quick) {
                Ok(fitted) => {
                    let first = fitted.account.costs.first().copied().unwrap_or(f64::INFINITY);
                    account.before = (first / thinned.rms_count(thinned.equations())).sqrt();
                    account.after = fitted.account.rms;
                    account.iterations = fitted.account.iterations();
                    if account.after <= self.target {
                        let long = refine(&fitted.candidate, data, &self.refine)?;
                        account.iterations += long.account.iterations();
                        if best
                            .as_ref()
                            .is_none_or(|(_, b)| long.account.rms < b.account.rms)
                        {
                            best = Some((index, long));
                        }
                    } else if waiting
                        .as_ref()
                        .is_none_or(|(at, _)| account.after < accounts[*at].after)
                    {
                        waiting = Some((index, fitted.candidate));
                    }
                }
                // No response at some position: another start may have one.
                Err(RealizeError::Start { .. }) => {}
                Err(error) => return Err(error),
            }
            accounts.push(account);
            if best.as_ref().is_some_and(|(_, b)| b.account.rms <= self.target) {
                break;
            }
        }
        if let (None, Some((at, candidate))) = (&best, waiting) {
            let long = refine(&candidate, data, &self.refine)?;
            accounts[at].iterations += long.account.iterations();
            best = Some((at, long));
        }
        let (winner, refined) = best.ok_or_else(|| RealizeError::Start {
            p: range.centre(),
            problem: "no start could be made",
        })?;
        Ok((refined, accounts, winner))
    }
}
