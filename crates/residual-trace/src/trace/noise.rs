//! The noise of the sensors, in the loop and before it.

use super::Case;
use crate::TraceError;
use crate::base::{Base, Pair};
use crate::fit::squares;
use crate::simulate::simulate;
use crate::track::Track;
use crate::whiten::Whitening;
use experiment_data::ControllerState;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// What noise of the sensors becomes in the loop: the difference of two simulations.
fn through_loop(
    base: &Base,
    controller: &ControllerState,
    track: &Track,
    seed: usize,
    size: Pair,
) -> Result<Vec<Pair>, TraceError> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed as u64);
    let mut draw = |size: f64| -> f64 {
        let x: f64 = StandardNormal.sample(&mut rng);
        size * x
    };
    let noise: Vec<Pair> = (0..track.samples).map(|_| size.map(&mut draw)).collect();
    let run = |noise| {
        simulate(base, &[], controller, track, noise, &mut ()).ok_or_else(|| TraceError::Diverges {
            record: track.name.clone(),
        })
    };
    let (with, without) = (run(Some(&noise))?, run(None)?);
    let gap = |(a, b): (&Pair, &Pair)| [a[0] - b[0], a[1] - b[1]];
    Ok(with.outputs.iter().zip(&without.outputs).map(gap).collect())
}

pub(super) fn loop_noise(case: &Case<'_>) -> Result<Whitening, TraceError> {
    let left = case
        .fitted
        .par_iter()
        .enumerate()
        .map(|(r, track)| through_loop(case.base, case.controller, track, r, case.noise))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Whitening::new(&left, case.base.channels()))
}

/// Deviation of the noise of the sensors from what leaves the loop while the scheduling rests, by record and sample: the
/// loop's own filter makes it white again, so that slow drifts do not count.
///
/// # Errors
/// [`TraceError::TooFew`] without samples; [`TraceError::Diverges`].
pub fn sensor_noise(
    base: &Base,
    controller: &ControllerState,
    like: &Track,
    left: &[Vec<Pair>],
) -> Result<Pair, TraceError> {
    let count = left.iter().map(Vec::len).sum::<usize>();
    if count == 0 {
        return Err(TraceError::TooFew {
            what: "the noise of the sensors needs samples of what does not repeat",
        });
    }
    let size: Pair = std::array::from_fn(|i| {
        (left.iter().flatten().map(|e| e[i] * e[i]).sum::<f64>() / count as f64).sqrt()
    });
    let still = like
        .at_rest()
        .iter()
        .enumerate()
        .map(|(r, track)| through_loop(base, controller, track, r, size))
        .collect::<Result<Vec<_>, _>>()?;
    let whitening = Whitening::new(&still, base.channels());
    let mut sum = [0.0; 2];
    for record in left {
        let mut white = Vec::new();
        whitening.apply(record, &mut white);
        for (i, part) in white.chunks(record.len().max(1)).enumerate() {
            sum[i] += squares(part);
        }
    }
    Ok(std::array::from_fn(|i| size[i] * (sum[i] / count as f64).sqrt()))
}
