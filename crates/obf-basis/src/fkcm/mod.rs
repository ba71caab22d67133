//! Fuzzy-Kolmogorov c-Max: poles of a basis from observed poles.

mod centre;
mod settings;

pub use settings::{FkcmSettings, Refinement};

use crate::cost::{DB_PER_NEPER, kolmogorov_cost_db, log_fuzzy_cost};
use crate::disc::{log_distance, log_kappa, to_chart};
use crate::memberships::{log_memberships, log_power_mean};
use crate::minimax::exchange;
use crate::minimax::newton::{Convergence, FIRST_SHARPNESS, Mean, evaluate, moved_unit};
use crate::starts::{Shape, covering, distinct_upper, generator, leja};
use crate::{BasisError, PoleSet, PoleUnit, Stop};
use centre::Weighted;
use nalgebra::DMatrix;
use num_complex::Complex;
use rayon::prelude::*;

/// The account of [`fkcm`].
#[derive(Debug, Clone, PartialEq)]
pub struct FkcmResult {
    /// The basis poles found.
    pub poles: PoleSet,
    /// Their n-width cost on the observed poles, dB.
    pub cost_db: f64,
    /// Their fuzzy cost `ln(n_c^(m-1) J)`; `n_c` times it tends to the n-width cost in nepers as m grows.
    pub log_fuzzy_cost: f64,
    /// Memberships `mu_ik`, one row a centre (pair or real pole), one column an entry of `observed`.
    pub memberships: DMatrix<f64>,
    /// Distinct observed poles of the closed upper half plane, in the order of the columns of `memberships`.
    pub observed: Vec<Complex<f64>>,
    /// Alternations of the best start.
    pub alternations: usize,
    /// Newton steps of its joint refinement.
    pub refinement_steps: usize,
    /// Why the best start ended.
    pub stop: Stop,
    /// One line a start, in the order of their random streams.
    pub starts: Vec<StartAccount>,
    /// Starts whose n-width cost is within 0.01 dB of the best.
    pub reached_best: usize,
}

/// What one start reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartAccount {
    /// n-width cost where it began, dB.
    pub begin_db: f64,
    /// n-width cost after the alternation, dB.
    pub alternation_db: f64,
    /// n-width cost at the end, dB.
    pub end_db: f64,
    /// Alternations used.
    pub alternations: usize,
}

/// Minimises the fuzzy cost `max_k sum_i mu_ik^m d(z_k, v_i)` over centres and memberships (Toth, Heuberger, Van den
/// Hof, Automatica 45(6), 2009), from several seeded starts.
///
/// Memberships are `mu_ik = 1 / sum_j (d_ik / d_jk)^(1/(m-1))`. The centre step `min_v max_k mu_ik^m d(z_k, v)` is
/// solved by bisection on discs; the factor `kappa(z_k, conj v)` of a pair is taken at the last centre there, so that
/// the sublevel sets stay discs. The alternation ends where no centre alone can improve its own maximum, which is not
/// yet a minimum over all centres; [`Refinement::Joint`] then descends the same cost in all of them. The start with the
/// lowest fuzzy cost wins. The result is the same for any number of threads.
///
/// # Errors
/// [`BasisError::Setting`], [`BasisError::Functions`], and what [`PoleSet::from_units`] may say about a pole that rounding
/// has carried onto the unit circle.
pub fn fkcm(observed: &PoleSet, settings: &FkcmSettings) -> Result<FkcmResult, BasisError> {
    settings.check()?;
    let points = distinct_upper(observed.as_slice());
    let shape = Shape {
        pairs: settings.pairs(),
        reals: settings.reals(),
    };
    let s = settings;
    let mut runs: Vec<Run> = (0..s.starts)
        .into_par_iter()
        .map(|index| {
            let units = covering(&points, shape)
                .unwrap_or_else(|| leja(&points, shape, 0.25, &mut generator(s.seed, index)));
            run_start(&points, units, s)
        })
        .collect();
    let starts: Vec<StartAccount> = runs.iter().map(|r| r.account).collect();
    let mut best = 0;
    for (i, run) in runs.iter().enumerate() {
        if run.log_fuzzy_cost < runs[best].log_fuzzy_cost {
            best = i;
        }
    }
    let best_db = starts[best].end_db;
    let reached_best = starts.iter().filter(|a| a.end_db <= best_db + 0.01).count();
    let run = runs.swap_remove(best);
    let poles = PoleSet::from_units(run.units)?;
    let mut memberships = DMatrix::zeros(poles.units().len(), points.len());
    let mut column = Vec::with_capacity(poles.units().len());
    for (k, &z) in points.iter().enumerate() {
        column.clear();
        column.extend(poles.units().iter().map(|&unit| log_distance(z, unit)));
        log_memberships(&mut column, s.fuzziness);
        for (i, l) in column.iter().enumerate() {
            memberships[(i, k)] = l.exp();
        }
    }
    Ok(FkcmResult {
        cost_db: kolmogorov_cost_db(&poles, &points)?,
        log_fuzzy_cost: log_fuzzy_cost(&poles, &points, s.fuzziness)?,
        poles,
        memberships,
        observed: points,
        alternations: run.account.alternations,
        refinement_steps: run.refinement_steps,
        stop: run.stop,
        starts,
        reached_best,
    })
}

struct Run {
    units: Vec<PoleUnit>,
    log_fuzzy_cost: f64,
    account: StartAccount,
    refinement_steps: usize,
    stop: Stop,
}

fn run_start(points: &[Complex<f64>], units: Vec<PoleUnit>, s: &FkcmSettings) -> Run {
    let begin_db = cost_db(&units, points);
    let alternation = alternate(points, units, s);
    let mut run = Run {
        account: StartAccount {
            begin_db,
            alternation_db: cost_db(&alternation.units, points),
            end_db: 0.0,
            alternations: alternation.count,
        },
        log_fuzzy_cost: alternation.cost,
        units: alternation.units,
        refinement_steps: 0,
        stop: alternation.stop,
    };
    if s.refinement == Refinement::Joint && run.stop != Stop::Exact {
        let count = run.units.len() as f64;
        let descent = exchange(
            run.units.clone(),
            points,
            Mean::Power(s.fuzziness),
            10 * s.max_iterations,
            FIRST_SHARPNESS,
        );
        run.refinement_steps = descent.iterations;
        if descent.worst / count <= run.log_fuzzy_cost {
            run.log_fuzzy_cost = descent.worst / count;
            run.units = descent.units;
        }
        run.stop = match (run.log_fuzzy_cost == f64::NEG_INFINITY, descent.converged) {
            (true, _) => Stop::Exact,
            (_, Convergence::Reached) => Stop::Converged,
            (_, Convergence::OutOfIterations) => Stop::IterationLimit,
        };
    }
    run.account.end_db = cost_db(&run.units, points);
    run
}

fn cost_db(units: &[PoleUnit], points: &[Complex<f64>]) -> f64 {
    let mut values = Vec::new();
    evaluate(units, points, Mean::Geometric, &mut values);
    DB_PER_NEPER * values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

struct Alternation {
    units: Vec<PoleUnit>,
    cost: f64,
    count: usize,
    stop: Stop,
}

/// Memberships, then centres, until the fuzzy cost no longer falls; the best centres met are kept.
fn alternate(points: &[Complex<f64>], start: Vec<PoleUnit>, s: &FkcmSettings) -> Alternation {
    let m = s.fuzziness;
    let mut units = start;
    let mut best = Alternation {
        units: units.clone(),
        cost: f64::INFINITY,
        count: 0,
        stop: Stop::IterationLimit,
    };
    let mut log_mu: Vec<Vec<f64>> = vec![vec![0.0; units.len()]; points.len()];
    let mut stalled = 0;
    let mut log_weights = Vec::with_capacity(points.len());
    let mut weighted = Vec::with_capacity(points.len());
    for count in 0..=s.max_iterations {
        let mut cost = f64::NEG_INFINITY;
        for (row, &z) in log_mu.iter_mut().zip(points) {
            for (l, &unit) in row.iter_mut().zip(&units) {
                *l = log_distance(z, unit);
            }
            cost = cost.max(log_power_mean(row, m));
            log_memberships(row, m);
        }
        // Independent centre steps bound the cost but need not lower it, so a few steps without gain are allowed.
        stalled = if cost < best.cost - s.tolerance {
            0
        } else {
            stalled + 1
        };
        if cost < best.cost {
            best.cost = cost;
            best.units.clone_from(&units);
        }
        best.count = count;
        if cost == f64::NEG_INFINITY {
            best.stop = Stop::Exact;
            break;
        }
        if stalled >= 3 {
            best.stop = Stop::Converged;
            break;
        }
        for (i, unit) in units.iter_mut().enumerate() {
            let v = unit.upper();
            log_weights.clear();
            log_weights.extend(log_mu.iter().zip(points).map(|(row, &z)| match unit {
                PoleUnit::Real(_) => m * row[i],
                PoleUnit::Pair(_) => m * row[i] + log_kappa(z, v.conj()),
            }));
            // Only the ratios of the weights decide; n_c^-m itself may be far below any level.
            let finite = log_weights.iter().copied().filter(|l| l.is_finite());
            let heaviest = finite.fold(f64::NEG_INFINITY, f64::max);
            weighted.clear();
            let some = log_weights.iter().zip(points).filter(|(l, _)| l.is_finite());
            weighted.extend(some.map(|(l, &z)| Weighted::new(to_chart(v, z), l - heaviest)));
            let w = match unit {
                PoleUnit::Real(_) => Complex::new(centre::real_centre(&weighted).0, 0.0),
                PoleUnit::Pair(_) => centre::centre(&weighted).0,
            };
            *unit = moved_unit(*unit, w).unwrap_or(*unit);
        }
    }
    best
}
