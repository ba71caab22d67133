//! The noise of the sensors, in the loop and before it.

use super::Case;
use crate::TraceError;
use crate::base::{Base, Pair};
use crate::fit::Explained;
use crate::simulate::{LANES, Run, side_by_side};
use crate::track::Track;
use crate::whiten::{SHORT, Whitening};
use lpv_core::ControllerState;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Draws of the noise by record.
const DRAWS: usize = 8;

/// What noise of the sensors becomes in the loop: differences of simulations.
fn through_loop(
    model: &Explained,
    controller: &ControllerState,
    track: &Track,
    seed: usize,
    size: Pair,
) -> Result<Vec<Vec<Pair>>, TraceError> {
    let blocks = model.blocks();
    let run = |parts: usize| {
        Run::new(&model.base, &blocks, track)
            .in_loop(controller)
            .in_parts(parts)
    };
    let diverges = || TraceError::Diverges {
        record: track.name.clone(),
    };
    // Few parts of a sample are enough for differences, but may diverge where more do not.
    let (parts, without) = [track.coarse(), track.fine()]
        .into_iter()
        .find_map(|parts| Some((parts, run(parts).response()?)))
        .ok_or_else(diverges)?;
    let drawn = |draw: usize| -> Vec<Pair> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64((DRAWS * seed + draw) as u64);
        let mut draw = |size: f64| -> f64 {
            let x: f64 = StandardNormal.sample(&mut rng);
            size * x
        };
        (0..track.samples).map(|_| size.map(&mut draw)).collect()
    };
    let noise: Vec<Vec<Pair>> = (0..DRAWS).into_par_iter().map(drawn).collect();
    let with = noise.par_chunks(LANES).flat_map_iter(|some| {
        let runs: Vec<_> = some.iter().map(|n| run(parts).with_noise(n)).collect();
        side_by_side(&runs.iter().collect::<Vec<_>>())
    });
    with.map(|with| {
        let gap = |(a, b): (&Pair, &Pair)| [a[0] - b[0], a[1] - b[1]];
        let with = with.ok_or_else(diverges)?;
        Ok(with.outputs.iter().zip(&without.outputs).map(gap).collect())
    })
    .collect()
}

/// All draws of all records.
fn draws(
    model: &Explained,
    controller: &ControllerState,
    tracks: &[Track],
    size: Pair,
) -> Result<Vec<Vec<Pair>>, TraceError> {
    let all = tracks
        .par_iter()
        .enumerate()
        .map(|(r, track)| through_loop(model, controller, track, r, size))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(all.concat())
}

/// The closed-loop output noise of a model, by a filter with so many taps.
pub(super) fn loop_noise(case: &Case<'_>, model: &Explained, taps: usize) -> Result<Whitening, TraceError> {
    let left = draws(model, case.controller, case.fitted, case.noise)?;
    Ok(Whitening::new(&left, model.base.channels(), taps))
}

/// Bands of the spectrum in which the noise is looked at.
const BANDS: usize = 16;
/// Quiet ones, which count alone where the rest is louder than chance makes it.
const QUIET: usize = 5;
/// Power of the middle band over that of the quiet ones that chance does not make.
const LOUD: f64 = 1.6;

/// Deviation of the noise of the sensors from what leaves the loop while the scheduling rests at a position, by record and
/// sample.
///
/// The loop's own filter makes noise white again. Drifts, and whatever else does not repeat, are not: the middle of
/// sixteen bands of the spectrum counts, or the quietest where they stand out.
///
/// # Errors
/// [`TraceError::TooFew`] without samples; [`TraceError::Diverges`].
pub fn sensor_noise(
    base: &Base,
    controller: &ControllerState,
    like: &Track,
    position: f64,
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
    let bare = Explained {
        base: base.clone(),
        effects: Vec::new(),
    };
    let still = draws(&bare, controller, &[like.at_rest(position)], size)?;
    let whitening = Whitening::new(&still, base.channels(), SHORT);
    let (found, expected) = (bands(&whitening, left), bands(&whitening, &still));
    Ok(std::array::from_fn(|i| {
        let mut ratios: Vec<f64> = found[i]
            .iter()
            .zip(&expected[i])
            .map(|(f, e)| f / e.max(1e-300))
            .collect();
        ratios.sort_by(f64::total_cmp);
        let mean = |r: &[f64]| r.iter().sum::<f64>() / r.len() as f64;
        let (middle, quiet) = (
            mean(&ratios[BANDS / 2 - 3..BANDS / 2 + 3]),
            mean(&ratios[..QUIET]),
        );
        size[i] * (if middle > LOUD * quiet { quiet } else { middle }).sqrt()
    }))
}

/// Mean power by output and band of the whitened records.
fn bands(whitening: &Whitening, records: &[Vec<Pair>]) -> [[f64; BANDS]; 2] {
    let mut power = [[0.0; BANDS]; 2];
    let mut lines = [[0_usize; BANDS]; 2];
    let mut planner = realfft::RealFftPlanner::<f64>::new();
    for record in records.iter().filter(|r| !r.is_empty()) {
        let mut white = Vec::new();
        whitening.apply(record, &mut white);
        let transform = planner.plan_fft_forward(record.len());
        let mut spectrum = transform.make_output_vec();
        for (i, part) in white.chunks_mut(record.len()).enumerate() {
            // Lengths are those of the plan.
            if transform.process(part, &mut spectrum).is_err() {
                continue;
            }
            for (k, line) in spectrum.iter().enumerate() {
                let band = (k * BANDS / spectrum.len()).min(BANDS - 1);
                power[i][band] += line.norm_sqr() / record.len() as f64;
                lines[i][band] += 1;
            }
        }
    }
    for (power, lines) in power.iter_mut().zip(&lines) {
        power
            .iter_mut()
            .zip(lines)
            .for_each(|(p, n)| *p /= (*n).max(1) as f64);
    }
    power
}
