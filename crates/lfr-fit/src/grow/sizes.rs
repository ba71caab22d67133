//! One model for each number of deltas, and which one to take.

use super::field::Field;
use super::{GrowSettings, Grown, StartSearch};
use crate::sampling::Sampling;
use crate::{FitError, FrozenData, Rigid};
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use std::collections::VecDeque;

/// Why a size was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SizeChoice {
    /// The smallest that reaches the target.
    TargetReached,
    /// None reaches it; this is the smallest whose rms is within a factor of two of the best of all.
    Knee,
}

/// The models of a table over the number of deltas.
#[derive(Debug, Clone, PartialEq)]
pub struct Sizes<K: Sampling> {
    /// One entry a size that was tried, in the order given.
    pub grown: Vec<Grown<K>>,
    /// The entry to take.
    pub chosen: usize,
    /// Why.
    pub choice: SizeChoice,
}

/// [`super::grow`] for one set of deltas after the other, `sizes` from the smallest to the largest. The search begins in
/// the middle: upward until a size reaches the target (the model of one is among the starts of the next), downward while
/// the smaller one does too. [`StartSearch::All`] tries every size.
///
/// The smallest that reaches the target is chosen: with noisy data one more delta has nothing left to explain. If none
/// reaches it, the residual is what the models cannot represent, and the smallest is chosen that no larger one betters
/// by a factor of two (6 dB).
///
/// # Errors
/// [`FitError::Empty`] without sizes, and those of [`super::grow`].
pub fn grow_sizes<'a, K: Sampling>(
    local: &StateSpace<K>,
    rigid: impl Into<Rigid<'a>>,
    data: &FrozenData,
    sizes: &[Vec<DeltaBlock>],
    scheduling: &SchedulingRange,
    settings: &GrowSettings,
) -> Result<Sizes<K>, FitError> {
    let rms = |g: &Grown<K>| g.refined.account.rms;
    let field = Field::new(local, rigid.into(), data, scheduling, settings)?;
    let all = settings.search == StartSearch::All;
    let middle = if all { 0 } else { sizes.len().saturating_sub(1) / 2 };
    let mut grown: VecDeque<Grown<K>> = VecDeque::new();
    for deltas in sizes.iter().skip(middle) {
        let smaller = grown.back().map(|g| &g.refined.candidate);
        grown.push_back(field.grow(deltas, smaller)?);
        if !all && grown.back().is_some_and(|g| g.reached) {
            break;
        }
    }
    let reached = grown.iter().any(|g| g.reached);
    for deltas in sizes[..middle.min(sizes.len())].iter().rev() {
        let model = field.grow(deltas, None)?;
        let best = grown.iter().map(rms).fold(f64::INFINITY, f64::min);
        let good = if reached {
            model.reached
        } else {
            rms(&model) <= KNEE * best
        };
        grown.push_front(model);
        if !good {
            break;
        }
    }
    let best = grown.iter().map(rms).fold(f64::INFINITY, f64::min);
    let reached = grown.iter().position(|g| g.reached);
    let choice = reached.map_or(SizeChoice::Knee, |_| SizeChoice::TargetReached);
    let chosen = reached.or_else(|| grown.iter().position(|g| rms(g) <= KNEE * best));
    Ok(Sizes {
        chosen: chosen.ok_or(FitError::Empty { what: "sizes" })?,
        choice,
        grown: grown.into(),
    })
}

/// A residual larger than the best by no more than this is no reason for more deltas.
const KNEE: f64 = 2.0;
