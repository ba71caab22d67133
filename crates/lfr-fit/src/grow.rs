//! From a local model to an LFR over the whole range: starts, cheap fits, one long fit.

mod coherent;
mod expansion;
mod field;
mod moved;
mod settings;
mod sizes;
mod weights;

use crate::sampling::Sampling;
use crate::{Candidate, FitError, FrozenData, Refined, ResidualUnit, Rigid};
use coherent::Coherent;
pub(crate) use field::Field;
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
pub use settings::{DeltaReach, GainFit, GrowSettings, StartSearch};
pub use sizes::{SizeChoice, Sizes, grow_sizes};
pub(crate) use weights::roots;

/// Where the channels of a start come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartKind {
    /// A polynomial of this degree through frozen models at all positions, its Hankel matrix in powers of delta cut to rank.
    Coherent {
        /// Degree in the deltas.
        degree: usize,
    },
    /// A model with as many deltas or fewer, and small random channels for the rest: see [`grow_sizes`] and [`grow_from`].
    Given,
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
    /// Rms residual on few lines; infinite if it failed.
    pub few_rms: f64,
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
    /// It missed the target on few lines, and another start was better.
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

/// The same noisy data in few lines a position, for work that goes over them again and again.
///
/// Neighbouring lines that are closer together than to the poles of a local model there are merged, where that model is near the
/// data: one line at their mean frequency with the sum of their weights, its value that of the local model plus the weighted
/// mean of what the data add to it. The sum of squares of any model near the data is the same, up to a constant and to second order in the width of
/// what was merged. Data without noise come back as they are: any of their lines will do, see [`FrozenData::thinned`].
///
/// # Errors
/// As [`grow`].
pub fn merge_lines<'a, K: Sampling>(
    local: &StateSpace<K>,
    rigid: impl Into<Rigid<'a>>,
    data: &FrozenData,
    scheduling: &SchedulingRange,
    settings: &GrowSettings,
) -> Result<FrozenData, FitError> {
    settings.check()?;
    match data.unit() {
        ResidualUnit::Relative => Ok(data.clone()),
        ResidualUnit::StandardDeviation => {
            Ok(Coherent::in_few_lines(local, rigid.into(), data, scheduling, settings)?.1)
        }
    }
}

/// Fits an LFR with the given deltas to responses over the whole range, from a local model at its centre.
///
/// `local` and `rigid` are the model at the centre and what it has for a rigid body, as [`crate::local_model`] and
/// [`crate::local_body`] give them.
///
/// 1. The local model is fitted to one position after the other, outward from the centre, in coordinates that change as
///    little as possible; where that misses and the data know the poles ([`FrozenData::with_poles`]), with them.
/// 2. The LFR of the flexible part is fitted to the responses of these models with more damping: `F(s + sigma)`, sigma
///    as far as the poles move. A resonance that moves by many times its width would hide the way.
/// 3. It is fitted to few lines of the data (noisy ones merged, see [`merge_lines`]), and then to all.
///
/// The first starts are factorised polynomials through the local models, the others are small random channels: with
/// none at all the gradient vanishes, and small ones go where the data pull them. The long fit on all lines is made for
/// the starts that reach the target on few, until one reaches it on all lines too, or for the best if none does.
///
/// # Errors
/// [`FitError::Empty`] without deltas, [`FitError::Start`] if no start has a response at all positions, and those
/// of [`crate::refine`] and [`crate::Candidate::flexible`]. A target that is not reached is a result.
pub fn grow<'a, K: Sampling>(
    local: &StateSpace<K>,
    rigid: impl Into<Rigid<'a>>,
    data: &FrozenData,
    deltas: &[DeltaBlock],
    scheduling: &SchedulingRange,
    settings: &GrowSettings,
) -> Result<Grown<K>, FitError> {
    Field::new(local, rigid.into(), data, scheduling, settings)?.grow(deltas, None)
}

/// As [`grow`], with a model that has as many deltas or fewer for the first start.
///
/// # Errors
/// Those of [`grow`].
pub fn grow_from<'a, K: Sampling>(
    given: &Candidate<K>,
    local: &StateSpace<K>,
    rigid: impl Into<Rigid<'a>>,
    data: &FrozenData,
    deltas: &[DeltaBlock],
    settings: &GrowSettings,
) -> Result<Grown<K>, FitError> {
    Field::new(local, rigid.into(), data, given.range(), settings)?.grow(deltas, Some(given))
}
