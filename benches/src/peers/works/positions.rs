//! An LPV fit of frozen responses, judged between its positions.

use super::{C64, Failure, Run, rows_of, warped, write};
use lpv_benches::Bench;
use lpv_core::{Frf, FrfEstimate};
use lpv_ident::{Interpolation, interpolate_models};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, Weighting, fit};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::path::Path;

const POSITIONS: usize = 9;
const LINES: usize = 401;
/// Noise of an entry, relative: without any, vector fitting does not converge.
const NOISE: f64 = 1e-4;

fn grid(bench: &Bench) -> Vec<f64> {
    bench.machine.positions(POSITIONS)
}

/// The middles between them.
fn between(bench: &Bench) -> Vec<f64> {
    grid(bench).windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

fn responses(bench: &Bench, positions: &[f64]) -> Result<Vec<Frf>, Failure> {
    let lines = bench.lines_hz(LINES);
    let at = |p: &f64| {
        Ok(bench
            .machine
            .sampled(*p, bench.clock)?
            .frequency_response(&lines)?)
    };
    positions.iter().map(at).collect()
}

/// What is measured on the grid.
fn measured(bench: &Bench) -> Result<Vec<Frf>, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut all = responses(bench, &grid(bench))?;
    for frf in &mut all {
        for k in 0..LINES {
            for value in frf.line_slice_mut(k) {
                *value *= C64::new(1.0 + NOISE * normal(), NOISE * normal());
            }
        }
    }
    Ok(all)
}

pub(super) fn export(folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new()?;
    write(folder, "rates", warped(&bench, &bench.lines_hz(LINES)))?;
    write(folder, "positions", grid(&bench))?;
    write(folder, "between", between(&bench))?;
    let all = measured(&bench)?;
    write(folder, "frf", all.iter().flat_map(rows_of))
}

/// A pole fit of each position, and cubic splines through their matrices.
pub(super) fn ours() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let lines = bench.lines_hz(LINES);
    let estimates: Vec<(f64, FrfEstimate)> = grid(&bench)
        .into_iter()
        .zip(measured(&bench)?)
        .map(|(p, frf)| Ok((p, FrfEstimate::with_unit_covariance(frf, Some(p.into()))?)))
        .collect::<Result<_, Failure>>()?;
    let settings = PoleFitSettings {
        integrators: Integrators::Fixed(2),
        numerator: NumeratorDegree::StrictlyProper,
        weighting: Weighting::Relative,
        ..PoleFitSettings::new(6)
    };
    Ok(Box::new(move || {
        let local = estimates.par_iter().map(|(p, estimate)| -> Result<_, Failure> {
            Ok((*p, fit(estimate, bench.clock, &settings)?.parallel_form()?))
        });
        let local: Vec<_> = local.collect::<Result<_, _>>()?;
        let model = interpolate_models(&local, Interpolation::Spline)?;
        let mut all = Vec::new();
        for p in between(&bench) {
            all.extend(rows_of(&model.frozen(&[p])?.frequency_response(&lines)?));
        }
        Ok(all)
    }))
}

/// Root of the mean squared relative error of a line.
pub(super) fn error(found: &[f64]) -> Result<f64, Failure> {
    let bench = Bench::new()?;
    let truth: Vec<f64> = responses(&bench, &between(&bench))?
        .iter()
        .flat_map(rows_of)
        .collect();
    if truth.len() != found.len() {
        return Err(format!("{} numbers for {}", found.len(), truth.len()).into());
    }
    // Eight numbers a line.
    let lines = truth.chunks_exact(8).zip(found.chunks_exact(8));
    let squares = lines.map(|(t, f)| {
        let error: f64 = t.iter().zip(f).map(|(a, b)| (a - b).powi(2)).sum();
        error / t.iter().map(|a| a * a).sum::<f64>()
    });
    let count = truth.len() / 8;
    Ok((squares.sum::<f64>() / count as f64).sqrt())
}
