//! Reduction.

mod coherent;
mod hankel;
mod weights;

use crate::sampling::Sampling;
use crate::{Candidate, FrozenData, RealizeError};
use coherent::LocalModels;
use lpv_core::{DeltaBlock, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// Rms residual at which a local fit is good enough to align the others by.
const LOCAL_TARGET: f64 = 1e-7;

/// Coherent.
pub fn coherent_start<K: Sampling>(
    local: &StateSpace<K>,
    gamma: Option<&DMatrix<f64>>,
    data: &FrozenData,
    deltas: &[DeltaBlock],
    scheduling: &SchedulingRange,
    degree: usize,
) -> Result<(Candidate<K>, Vec<f64>), RealizeError> {
    let models = LocalModels::new(local, gamma, data, scheduling)?;
    let candidate = models.factorised(data, deltas, scheduling, degree, 0)?;
    Ok((candidate, models.rms))
}
