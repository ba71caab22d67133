//! The refinement and its result.

use crate::minimax::polish;
use crate::problem::Problem;
use crate::sampling::Sampling;
use crate::search::{Found, Limits, Noise, search};
use crate::{Candidate, FitError, FrozenData, RefineSettings, ResidualUnit};
use lpv_core::WellPosedness;
use lpv_numerics::dense::right_singular;
use lpv_numerics::least_squares::{Quadratic, StopReason};
use nalgebra::{DMatrix, DVector};

/// A refined model, with the account of its making.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined<K: Sampling> {
    /// The model.
    pub candidate: Candidate<K>,
    /// How it went.
    pub account: RefineAccount,
    /// Rms residual of each position, in the order of the data and in their unit.
    pub position_rms: Vec<f64>,
    /// `Z` with `cov(theta) = Z Z^T`, `n_theta x rank`.
    pub(crate) factor: DMatrix<f64>,
    pub(crate) clock: lpv_core::Discrete,
}

/// How a refinement went.
#[derive(Debug, Clone, PartialEq)]
pub struct RefineAccount {
    /// Why the search ended.
    pub stop: StopReason,
    /// Sum of squared residuals before the first iteration and after every one.
    pub costs: Vec<f64>,
    /// Steps tried, those refused too.
    pub trials: usize,
    /// Tall blocks of rows factorised: the unit of work.
    pub factorisations: usize,
    /// Rms residual over all positions, in the unit of the data.
    pub rms: f64,
    /// The largest residual of a line, the root of the sum of its squares over channels, in the unit of the data.
    pub largest: f64,
    /// What a residual of one means.
    pub unit: ResidualUnit,
    /// Real equations: two a line and channel.
    pub equations: usize,
    /// Free entries.
    pub free: usize,
    /// Dimension of the changes of coordinates among them.
    pub indistinguishable: usize,
    /// Directions of the rest that the data determine, beyond rounding. Fewer than `free - indistinguishable`: too many deltas or
    /// states for what the data show.
    pub rank: usize,
    /// Largest over smallest singular value of the scaled Jacobian in the directions that are determined.
    pub condition: f64,
    /// Variance of a real equation: 1 where the covariance of the data is known, else estimated from the residual.
    pub variance: f64,
    /// What a full step of Gauss and Newton from here would take off the sum of squares, in units of `variance`. Where it
    /// is not small against `rank`, the search has not come to its end, and the covariance of the result is too small.
    pub decrease: f64,
    /// Whether the LFR is well-posed over the whole range.
    pub well_posedness: WellPosedness,
}

impl RefineAccount {
    /// Iterations.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.costs.len().saturating_sub(1)
    }
    /// Whether what the search has left undone is hidden by the noise: `decrease` at most 0.1 a direction determined, so
    /// that the error is at most 5 % larger than its covariance says.
    #[must_use]
    pub fn is_converged(&self) -> bool {
        self.decrease <= HIDDEN * self.rank as f64
    }
    /// Real equations less the directions determined.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.equations.saturating_sub(self.rank)
    }
}

/// A decrease of the sum of squares, in variances a direction, that the noise hides: it makes the error 5 % larger.
const HIDDEN: f64 = 0.1;

/// Singular values of the scaled Jacobian below this part of the largest count as zero.
const UNDETERMINED: f64 = 1e-10;

/// Moves the free entries of a candidate to where its frozen responses fit the data best.
///
/// What is minimised is the sum over positions and lines of `||W_y (F - G) W_u||_F^2`, F the response of the model held
/// at p (sampled by zero-order hold if it is continuous) and G the data. Derivatives are exact. A step is refused that
/// makes the model ill-posed, makes a stable frozen model unstable, or raises the cost.
///
/// # Errors
/// [`FitError`]: data that the candidate has no place for, a start without a response, fewer equations than unknowns.
/// A fit that is merely poor is a result; the account says so.
pub fn refine<K: Sampling>(
    candidate: &Candidate<K>,
    data: &FrozenData,
    settings: &RefineSettings,
) -> Result<Refined<K>, FitError> {
    settings.check()?;
    let set = settings;
    let mut problem = Problem::new(candidate, data)?;
    let limits = Limits {
        max_iterations: set.max_iterations,
        tolerance: set.tolerance,
        target: set.target.powi(2) * data.rms_count(data.equations()),
        damping: START_DAMPING,
        noise: (data.unit() == ResidualUnit::StandardDeviation && !set.to_the_end).then_some(Noise {
            cost: data.equations() as f64,
            hidden: HIDDEN,
        }),
    };
    let mut found = search(&problem, problem.theta(candidate), &limits)?;
    if set.minimax_passes > 0 {
        found = polish(&mut problem, found, set.minimax_passes, &limits)?;
    }
    account(&problem, data, found)
}

/// Damping of the first step, relative to the length of the scaled columns.
pub(crate) const START_DAMPING: f64 = 1e-4;

/// The result of a search.
pub(crate) fn account<K: Sampling>(
    problem: &Problem<'_, K>,
    data: &FrozenData,
    found: Found,
) -> Result<Refined<K>, FitError> {
    let linear = problem
        .linearise(&found.theta)
        .ok_or_else(|| problem.no_start())?;
    let scaled = Quadratic::new(
        &linear.jacobian,
        &linear.residual,
        &problem.indistinguishable(&found.theta)?,
    );
    let (values, vectors) = right_singular(&scaled.r)?;
    let largest = values.get(0).copied().unwrap_or(0.0);
    let rank = values.iter().filter(|v| **v > UNDETERMINED * largest).count();
    let (equations, unknowns) = (data.equations(), scaled.map.ncols());
    if equations < unknowns {
        return Err(FitError::TooFewEquations { equations, unknowns });
    }
    let total: f64 = found.cost.lines.iter().flatten().sum();
    let variance = match data.unit() {
        ResidualUnit::StandardDeviation => 1.0,
        ResidualUnit::Relative => total / (equations - rank).max(1) as f64,
    };
    let inverse = DVector::from_iterator(rank, values.iter().take(rank).map(|v| variance.sqrt() / v));
    let factor = &scaled.map * vectors.columns(0, rank) * DMatrix::from_diagonal(&inverse);
    let channels = 2 * data.outputs() * data.inputs();
    let rms = |squares: f64, lines: usize| (squares / data.rms_count(channels * lines)).sqrt();
    let candidate = problem.candidate(&found.theta);
    let biggest = found.cost.lines.iter().flatten().copied().fold(0.0, f64::max);
    Ok(Refined {
        account: RefineAccount {
            stop: found.stop,
            costs: found.history,
            trials: found.trials,
            factorisations: found.factorisations + linear.factorisations,
            rms: rms(total, equations / channels),
            largest: biggest.sqrt(),
            unit: data.unit(),
            equations,
            free: problem.free.len(),
            indistinguishable: problem.free.len() - scaled.map.ncols(),
            rank,
            condition: values.iter().take(rank).next_back().map_or(1.0, |v| largest / v),
            variance,
            decrease: scaled.decrease() / variance.max(f64::MIN_POSITIVE),
            well_posedness: candidate.to_lfr()?.well_posedness()?,
        },
        position_rms: found
            .cost
            .lines
            .iter()
            .map(|lines| rms(lines.iter().sum(), lines.len()))
            .collect(),
        candidate,
        factor,
        clock: data.clock(),
    })
}
