//! Levenberg-Marquardt in the directions that no change of coordinates makes.

use crate::RealizeError;
use crate::problem::{Cost, Linear, Problem};
use crate::sampling::Sampling;
use lpv_numerics::dense::{complement, triangle_beside, triangle_of};
use nalgebra::{DMatrix, DVector};

/// Why a refinement ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The residual reached the target.
    TargetReached,
    /// What a step can still win, or what the last iterations won, is below the tolerance.
    CostSettled,
    /// The residual is rounding: noise-free data, fitted exactly.
    ResidualAtRounding,
    /// No step lowers the cost.
    NoDescent,
    /// `max_iterations` was reached first.
    IterationLimit,
    /// Nothing is free.
    NothingFree,
}

/// When to end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) max_iterations: usize,
    /// Relative decrease of the cost, over [`PATIENCE`] iterations, that counts as none.
    pub(crate) tolerance: f64,
    /// The cost that is low enough.
    pub(crate) target: f64,
    pub(crate) damping: f64,
    /// None where the noise of the data is not known.
    pub(crate) noise: Option<Noise>,
}

/// What is known of a cost in units of the noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Noise {
    /// The cost that noise alone makes.
    pub(crate) cost: f64,
    /// The decrease a direction that noise hides.
    pub(crate) hidden: f64,
}

/// Where the search ended, and the work it took.
pub(crate) struct Found {
    pub(crate) theta: DVector<f64>,
    pub(crate) cost: Cost,
    pub(crate) stop: StopReason,
    /// The cost before the first and after every iteration.
    pub(crate) history: Vec<f64>,
    /// Steps tried, those refused too.
    pub(crate) trials: usize,
    /// Tall blocks factorised.
    pub(crate) factorisations: usize,
    pub(crate) damping: f64,
}

/// Iterations over which the decrease of the cost is judged.
const PATIENCE: usize = 8;

/// Part of what noise hides in all directions together: iterations that win no more are not worth their time.
const SETTLED: f64 = 0.1;

/// A covariance that is estimated from few periods makes noise cost up to this many times what is expected.
const NOISE: f64 = 1.5;

/// A correction that bends a step by more than this is not believed.
const BEND: f64 = 0.75;

/// Damping, relative to the largest possible singular value of the scaled Jacobian: below the first it is rounding, above
/// the second a step is.
const LEAST_DAMPING: f64 = 1e-15;
const MOST_DAMPING: f64 = 1e6;

/// Tangents of a change of coordinates that depend on others up to this are dropped: a direction too many would be lost
/// to the search, one too few costs a direction without slope, which the damping holds.
const DEPENDENT: f64 = 1e-8;

/// The linearised problem in the coordinates that a step is taken in: `theta + map y`, residual `b + R y`.
pub(crate) struct Scaled {
    /// `n_theta x m`: the inverse scale times an orthonormal basis of the complement of the scaled tangents.
    pub(crate) map: DMatrix<f64>,
    pub(crate) r: DMatrix<f64>,
    pub(crate) b: DVector<f64>,
}

impl Scaled {
    /// Every free entry is scaled to a column of length one (Marquardt). A step in the complement of the tangents is the
    /// damped step of all entries in the limit of no damping along the tangents.
    pub(crate) fn new(linear: &Linear, tangents: &DMatrix<f64>) -> Self {
        let norms = linear.jacobian.column_iter().map(|c| c.norm());
        let scale = DVector::from_iterator(
            linear.jacobian.ncols(),
            norms.map(|norm| if norm > 0.0 { norm } else { 1.0 }),
        );
        let mut scaled = tangents.clone();
        for mut column in scaled.column_iter_mut() {
            column.component_mul_assign(&scale);
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
        }
        let mut map = complement(&scaled, DEPENDENT);
        for mut column in map.column_iter_mut() {
            column.component_div_assign(&scale);
        }
        let size = map.ncols();
        let factor = triangle_beside(&(&linear.jacobian * &map), &linear.residual);
        Self {
            r: factor.view((0, 0), (size, size)).into_owned(),
            b: factor.view((0, size), (size, 1)).column(0).into_owned(),
            map,
        }
    }

    /// What a full step of Gauss and Newton takes off the sum of squares, if it does what it promises.
    pub(crate) fn decrease(&self) -> f64 {
        self.b.norm_squared()
    }

    /// The minimiser of `||b + R y||^2 + damping ||y||^2`.
    fn step(&self, damping: f64) -> Option<Step> {
        let size = self.b.len();
        let mut top = DMatrix::zeros(size, size + 1);
        top.columns_mut(0, size).copy_from(&self.r);
        top.column_mut(size).copy_from(&self.b);
        let mut bottom = DMatrix::zeros(size, size + 1);
        bottom.fill_diagonal(damping.sqrt());
        let factor = triangle_of(size + 1, [&top, &bottom].into_iter());
        let r = factor.view((0, 0), (size, size));
        let y = -r.solve_upper_triangular(&factor.view((0, size), (size, 1)).column(0))?;
        let rest = &self.b + &self.r * &y;
        y.iter().all(|v| v.is_finite()).then(|| Step {
            predicted: self.b.norm_squared() - rest.norm_squared(),
            triangle: r.into_owned(),
            y,
        })
    }
}

/// A damped step.
struct Step {
    y: DVector<f64>,
    /// The decrease of the cost, if the residuals were straight.
    predicted: f64,
    /// `F^T F = R^T R + damping I`.
    triangle: DMatrix<f64>,
}

impl Step {
    /// What the step lacks to follow residuals that bend, `-1/2 (F^T F)^-1 c` with `c = (J map)^T r''` (Transtrum and
    /// Sethna 2012, geodesic acceleration).
    fn correction(&self, curvature: &DVector<f64>) -> Option<DVector<f64>> {
        let half = self.triangle.tr_solve_upper_triangular(curvature)?;
        Some(self.triangle.solve_upper_triangular(&half)? * -0.5)
    }
}

/// A sum of squares with its linearisation.
pub(crate) trait Objective {
    /// Number of free entries.
    fn size(&self) -> usize;
    /// None where the model does not exist, or a property of the start is lost.
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost>;
    /// At a point where the cost exists.
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear>;
    /// `J^T r''` for the second derivative of the residuals along a step; none where it is not known.
    fn curvature(
        &self,
        _theta: &DVector<f64>,
        _linear: &Linear,
        _step: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        None
    }
    /// Directions without effect, one a column.
    fn gauge(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, RealizeError>;
    /// The cost that rounding alone makes.
    fn rounding(&self) -> f64;
    /// Why a start has no cost.
    fn no_start(&self) -> RealizeError;
}

impl Linear {
    /// Both, the rows of `other` below.
    pub(crate) fn above(self, other: Self) -> Self {
        let (top, bottom) = (self.jacobian.nrows(), other.jacobian.nrows());
        let mut both = Self {
            jacobian: DMatrix::zeros(top + bottom, self.jacobian.ncols()),
            residual: DVector::zeros(top + bottom),
            factorisations: self.factorisations + other.factorisations,
            chains: self.chains,
        };
        both.jacobian.rows_mut(0, top).copy_from(&self.jacobian);
        both.jacobian.rows_mut(top, bottom).copy_from(&other.jacobian);
        both.residual.rows_mut(0, top).copy_from(&self.residual);
        both.residual.rows_mut(top, bottom).copy_from(&other.residual);
        both
    }
}

impl<K: Sampling> Objective for Problem<'_, K> {
    fn size(&self) -> usize {
        self.free.len()
    }
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        self.cost(theta)
    }
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        self.linearise(theta)
    }
    fn curvature(&self, theta: &DVector<f64>, linear: &Linear, step: &DVector<f64>) -> Option<DVector<f64>> {
        self.curvature(theta, linear, step)
    }
    fn gauge(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, RealizeError> {
        self.gauge(theta)
    }
    fn rounding(&self) -> f64 {
        self.rounding()
    }
    fn no_start(&self) -> RealizeError {
        self.no_start()
    }
}

/// The step with its correction; none where the residuals bend too much for it to be believed.
fn follow(
    problem: &impl Objective,
    theta: &DVector<f64>,
    (linear, scaled): (&Linear, &Scaled),
    step: &Step,
) -> Option<DVector<f64>> {
    let curvature = problem.curvature(theta, linear, &(&scaled.map * &step.y));
    let Some(more) = curvature.and_then(|c| step.correction(&scaled.map.tr_mul(&c))) else {
        return Some(step.y.clone());
    };
    (2.0 * more.norm() <= BEND * step.y.norm()).then(|| &step.y + more)
}

pub(crate) fn search(
    problem: &impl Objective,
    start: DVector<f64>,
    limits: &Limits,
) -> Result<Found, RealizeError> {
    let cost = problem.cost(&start).ok_or_else(|| problem.no_start())?;
    let rounding = problem.rounding();
    let mut found = Found {
        history: vec![cost.total],
        theta: start,
        cost,
        stop: StopReason::NothingFree,
        trials: 0,
        factorisations: 0,
        damping: limits.damping,
    };
    if problem.size() == 0 {
        return Ok(found);
    }
    found.stop = 'search: loop {
        let iterations = found.history.len() - 1;
        if found.cost.total <= rounding {
            break StopReason::ResidualAtRounding;
        }
        if found.cost.total <= limits.target {
            break StopReason::TargetReached;
        }
        // Near the noise the cost says nothing about what is left to win, its excess does.
        let worth = limits.noise.map_or(found.cost.total, |noise| {
            let least = noise.hidden * problem.size() as f64;
            (found.cost.total - NOISE * noise.cost).max(least)
        });
        let settled = |noise: Noise| {
            iterations >= PATIENCE
                && found.history[iterations - PATIENCE] - found.cost.total
                    <= SETTLED * noise.hidden * problem.size() as f64
        };
        if limits.noise.is_some_and(settled) {
            break StopReason::CostSettled;
        }
        if iterations >= PATIENCE
            && found.history[iterations - PATIENCE] <= found.cost.total + limits.tolerance * worth
        {
            break StopReason::CostSettled;
        }
        if iterations >= limits.max_iterations {
            break StopReason::IterationLimit;
        }
        let Some(linear) = problem.linearise(&found.theta) else {
            break StopReason::NoDescent;
        };
        found.factorisations += linear.factorisations;
        let scaled = Scaled::new(&linear, &problem.gauge(&found.theta)?);
        let hidden = |noise: Noise| scaled.decrease() <= noise.hidden * scaled.b.len() as f64;
        if limits.noise.is_some_and(hidden) {
            break StopReason::CostSettled;
        }
        let mut growth = 2.0;
        loop {
            if let Some(step) = scaled.step(found.damping) {
                if step.predicted <= 1e-3 * limits.tolerance * found.cost.total && found.damping < 1.0 {
                    break 'search StopReason::CostSettled;
                }
                found.trials += 1;
                let trial = follow(problem, &found.theta, (&linear, &scaled), &step).and_then(|y| {
                    let theta = &found.theta + &scaled.map * y;
                    let cost = problem.cost(&theta).filter(|c| c.total < found.cost.total)?;
                    Some((theta, cost))
                });
                if let Some((theta, cost)) = trial {
                    let gain = (found.cost.total - cost.total) / step.predicted;
                    // Nielsen's rule: a step that keeps what it promised lowers the damping to a fifth.
                    let factor = (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 5.0, 2.0);
                    found.damping = (found.damping * factor).max(LEAST_DAMPING);
                    found.history.push(cost.total);
                    found.theta = theta;
                    found.cost = cost;
                    continue 'search;
                }
            }
            found.damping *= growth;
            growth *= 2.0;
            if found.damping > MOST_DAMPING {
                break 'search StopReason::NoDescent;
            }
        }
    };
    Ok(found)
}
