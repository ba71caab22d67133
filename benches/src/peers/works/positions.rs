//! An LPV fit of frozen responses, judged between its positions.

use super::{Failure, Run, rows_of, warped, write};
use lpv_benches::Bench;
use lpv_core::{Frf, FrfEstimate};
use lpv_ident::{Interpolation, RegressionSettings, Weighting, regress};
use obf_basis::{FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
use pole_fit::{Integrators, PoleFitSettings, fit};
use rayon::prelude::*;
use std::path::Path;

const POSITIONS: usize = 9;
const LINES: usize = 401;
const FUNCTIONS: usize = 32;

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

pub(super) fn export(folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new()?;
    write(folder, "rates", warped(&bench, &bench.lines_hz(LINES)))?;
    write(folder, "positions", grid(&bench))?;
    write(folder, "between", between(&bench))?;
    let all = responses(&bench, &grid(&bench))?;
    write(folder, "frf", all.iter().flat_map(rows_of))
}

pub(super) fn ours() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let lines = bench.lines_hz(LINES);
    let positions = grid(&bench);
    let estimates = responses(&bench, &positions)?
        .into_iter()
        .zip(&positions)
        .map(|(frf, p)| Ok(FrfEstimate::with_unit_covariance(frf, Some(*p))?))
        .collect::<Result<Vec<_>, Failure>>()?;
    let pole_settings = PoleFitSettings::new(6)
        .integrators(Integrators::Fixed(2))
        .weighting(pole_fit::Weighting::Relative)
        .check()?;
    let basis_settings = FkcmSettings::new(FUNCTIONS)
        .starts(1)
        .max_iterations(20)
        .check()?;
    let settings = RegressionSettings::new()
        .diagonal_rigid_body(2)
        .weighting(Weighting::Relative)
        .check()?;
    Ok(Box::new(move || {
        let fits: Result<Vec<_>, _> = estimates
            .par_iter()
            .map(|e| fit(e, bench.clock, &pole_settings))
            .collect();
        let poles: Vec<_> = fits?.iter().flat_map(|f| f.flexible_poles()).collect();
        let found = fkcm(&PoleSet::new(&poles)?, &basis_settings)?;
        let basis = OrthonormalBasis::takenaka_malmquist(&found.poles, bench.clock)?;
        let model =
            regress(&estimates, basis.state_space(), &settings)?.interpolate(Interpolation::Spline)?;
        let mut all = Vec::new();
        for p in between(&bench) {
            all.extend(rows_of(&model.response(p, &lines)?));
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
