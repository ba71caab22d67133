//! Direct minimax descent of the n-width cost.

pub(crate) mod newton;
mod settings;

pub use settings::MinimaxSettings;
pub(crate) use settings::within;

use crate::cost::{DB_PER_NEPER, kolmogorov_cost_db};
use crate::poles::check_inside;
use crate::starts::{Shape, covering, distinct_upper, generator, leja};
use crate::{BasisError, PoleSet, PoleUnit, disc::pseudo_hyperbolic_distance};
use newton::{Convergence, Descent, FIRST_SHARPNESS, Mean, descend, evaluate};
use num_complex::Complex;
use rayon::prelude::*;

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// No further improvement above the tolerance.
    Converged,
    /// The allowed iterations were used up; the best poles so far are returned.
    IterationLimit,
    /// Every observed pole is a basis pole: the cost is minus infinity.
    Exact,
}

/// The account of [`polish_minimax`].
#[derive(Debug, Clone, PartialEq)]
pub struct MinimaxResult {
    /// The poles found.
    pub poles: PoleSet,
    /// Their n-width cost on the observed poles, dB.
    pub cost_db: f64,
    /// Cost of the start, dB; `cost_db` is never above it.
    pub start_cost_db: f64,
    /// Newton steps of the best descent.
    pub iterations: usize,
    /// Observed poles within 0.01 dB of the maximum, in the upper half plane.
    pub active: Vec<Complex<f64>>,
    /// Cost reached from each start, dB; entry 0 is the start given.
    pub start_costs_db: Vec<f64>,
    /// Starts within 0.01 dB of the best.
    pub reached_best: usize,
    /// Why it ended.
    pub stop: Stop,
}

/// Improves `start` until no small change of its poles lowers the n-width cost
/// `20 log10 max_z prod_j kappa(z, l_j)` over the observed poles, and tries Leja starts beside it.
///
/// The number of real poles and of pairs stays as in `start`. The maximum is smoothed to
/// `1/p ln sum exp(p F)`, its exact Newton steps run in Moebius charts centred at the poles, and p grows by stages
/// until the smoothing is below 0.01 dB. Long lists are handled by exchange: descend on a sample, add the points
/// that the sample missed, repeat.
///
/// # Errors
/// [`BasisError::Setting`]; [`BasisError::Empty`], [`BasisError::NotFinite`], [`BasisError::NotInside`] for the observed poles.
pub fn polish_minimax(
    start: &PoleSet,
    observed: &[Complex<f64>],
    settings: &MinimaxSettings,
) -> Result<MinimaxResult, BasisError> {
    settings.check()?;
    check_inside("observed poles", observed)?;
    let start_cost_db = kolmogorov_cost_db(start, observed)?;
    let points = distinct_upper(observed);
    let shape = Shape::of(start.units());
    let s = settings;
    let runs: Vec<Descent> = (0..=s.extra_starts)
        .into_par_iter()
        .map(|index| {
            // A low first sharpness follows the smooth optimum and forgets where it began; a high one stays in the valley
            // of the start. Neither is always better, so they take turns.
            let sharpness = FIRST_SHARPNESS * if index % 2 == 0 { 256.0 } else { 1.0 };
            let units = match index {
                0 => start.units().to_vec(),
                _ => covering(&points, shape)
                    .unwrap_or_else(|| leja(&points, shape, 0.2, &mut generator(s.seed, index))),
            };
            exchange(units, &points, Mean::Geometric, s.max_iterations, sharpness)
        })
        .collect();
    let start_costs_db: Vec<f64> = runs.iter().map(|r| DB_PER_NEPER * r.worst).collect();
    let mut best = 0;
    for (i, run) in runs.iter().enumerate() {
        // A start that only ties does not replace the one given.
        if run.worst < runs[best].worst {
            best = i;
        }
    }
    let reached_best = start_costs_db
        .iter()
        .filter(|&&c| c <= start_costs_db[best] + 0.01)
        .count();
    let run = &runs[best];
    let poles = PoleSet::from_units(run.units.clone())?;
    let cost_db = kolmogorov_cost_db(&poles, observed)?;
    let mut values = Vec::new();
    evaluate(poles.units(), &points, Mean::Geometric, &mut values);
    let active = points
        .iter()
        .zip(&values)
        .filter(|(_, v)| DB_PER_NEPER * **v >= cost_db - 0.01)
        .map(|(z, _)| *z)
        .collect();
    let stop = match (cost_db == f64::NEG_INFINITY, run.converged) {
        (true, _) => Stop::Exact,
        (_, Convergence::Reached) => Stop::Converged,
        (_, Convergence::OutOfIterations) => Stop::IterationLimit,
    };
    Ok(MinimaxResult {
        poles,
        cost_db,
        start_cost_db,
        iterations: run.iterations,
        active,
        start_costs_db,
        reached_best,
        stop,
    })
}

/// Sample size of the first round, and the points a later round may add.
const SAMPLE: usize = 128;
const ADDED: usize = 32;
const ROUNDS: usize = 8;
/// Where the rounds after the first begin: near enough to keep what is found.
const REFINED_SHARPNESS: f64 = 3e3;

/// Descends on a sample of a long list and adds what it missed, until the list's maximum is the sample's.
pub(crate) fn exchange(
    units: Vec<PoleUnit>,
    points: &[Complex<f64>],
    mean: Mean,
    max_iterations: usize,
    sharpness: f64,
) -> Descent {
    if points.len() <= 2 * SAMPLE {
        return descend(units, points, mean, max_iterations, sharpness);
    }
    let mut values = Vec::with_capacity(points.len());
    evaluate(&units, points, mean, &mut values);
    let worst_of = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut best = Descent {
        units: units.clone(),
        worst: worst_of(&values),
        iterations: 0,
        converged: Convergence::OutOfIterations,
    };
    let stride = points.len().div_ceil(SAMPLE);
    let mut sample: Vec<_> = points.iter().copied().step_by(stride).collect();
    sample.extend(points.last());
    let (mut now, mut used) = (units, 0);
    let mut sharpness = sharpness;
    for _ in 0..ROUNDS {
        let run = descend(now, &sample, mean, max_iterations.saturating_sub(used), sharpness);
        used += run.iterations;
        evaluate(&run.units, points, mean, &mut values);
        let worst = worst_of(&values);
        if worst < best.worst {
            best.worst = worst;
            best.units.clone_from(&run.units);
            best.converged = run.converged;
        }
        best.iterations = used;
        if worst <= run.worst + 1e-4 || used >= max_iterations {
            break;
        }
        let mut missed: Vec<usize> = (0..points.len()).filter(|&k| values[k] > run.worst).collect();
        missed.sort_by(|&a, &b| values[b].total_cmp(&values[a]).then(a.cmp(&b)));
        let before = sample.len();
        for k in missed {
            // One peak brings many neighbours; a few of them, apart from each other, are enough.
            let apart = |z: &Complex<f64>| pseudo_hyperbolic_distance(*z, points[k]) > 1e-3;
            if sample.len() < before + ADDED && sample[before..].iter().all(apart) {
                sample.push(points[k]);
            }
        }
        now = run.units;
        sharpness = REFINED_SHARPNESS;
    }
    best
}
