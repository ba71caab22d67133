//! What the searches for an LFR minimise, and when they end.

use crate::FitError;
use crate::problem::{Cost, Linear, Problem};
use crate::sampling::Sampling;
use lpv_numerics::least_squares::{
    AfterDescent, AfterRefusal, DampedStep, Damping, Quadratic, Search, StopReason, Trial, minimise,
};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

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
}

/// Iterations over which the decrease of the cost is judged.
const PATIENCE: usize = 8;

/// Part of what noise hides in all directions together: iterations that win no more are not worth their time.
const SETTLED: f64 = 0.1;

/// A covariance that is estimated from few periods makes noise cost up to this many times what is expected.
const NOISE: f64 = 1.5;

/// A correction that bends a step by more than this is not believed.
const BEND: f64 = 0.75;

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
    fn indistinguishable(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, FitError>;
    /// The cost that rounding alone makes.
    fn rounding(&self) -> f64;
    /// Why a start has no cost.
    fn no_start(&self) -> FitError;
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
    fn indistinguishable(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        self.indistinguishable(theta)
    }
    fn rounding(&self) -> f64 {
        self.rounding()
    }
    fn no_start(&self) -> FitError {
        self.no_start()
    }
}

/// Damping, relative to the largest possible singular value of the scaled Jacobian: below the first it is rounding, above
/// the second a step is.
const DAMPING: [f64; 2] = [1e-15, 1e6];

/// An objective on the way down.
struct Descent<'a, O> {
    objective: &'a O,
    limits: &'a Limits,
    factorisations: usize,
}

struct Point {
    theta: DVector<f64>,
    cost: Cost,
}

struct Linearised {
    linear: Linear,
    quadratic: Quadratic,
}

impl<O: Objective> Search for Descent<'_, O> {
    type Point = Point;
    type Linear = Linearised;
    type Error = FitError;

    fn cost(&self, point: &Point) -> f64 {
        point.cost.total
    }

    fn ended(&mut self, point: &Point, history: &[f64], _: &mut f64) -> Option<StopReason> {
        let (cost, limits, size) = (point.cost.total, self.limits, self.objective.size() as f64);
        let iterations = history.len() - 1;
        if size == 0.0 {
            return Some(StopReason::NothingFree);
        }
        if cost <= self.objective.rounding() {
            return Some(StopReason::ResidualAtRounding);
        }
        if cost <= limits.target {
            return Some(StopReason::TargetReached);
        }
        if iterations >= PATIENCE {
            let won = history[iterations - PATIENCE] - cost;
            // Near the noise the cost says nothing about what is left to win, its excess does.
            let (worth, nothing) = limits.noise.map_or((cost, f64::NEG_INFINITY), |noise| {
                let hidden = noise.hidden * size;
                ((cost - NOISE * noise.cost).max(hidden), SETTLED * hidden)
            });
            if won <= (limits.tolerance * worth).max(nothing) {
                return Some(StopReason::CostSettled);
            }
        }
        (iterations >= limits.max_iterations).then_some(StopReason::IterationLimit)
    }

    fn linearise(&mut self, point: &mut Point) -> Result<ControlFlow<StopReason, Linearised>, FitError> {
        let Some(linear) = self.objective.linearise(&point.theta) else {
            return Ok(ControlFlow::Break(StopReason::NoDescent));
        };
        self.factorisations += linear.factorisations;
        let tangents = self.objective.indistinguishable(&point.theta)?;
        let quadratic = Quadratic::new(&linear.jacobian, &linear.residual, &tangents);
        let hidden = |noise: Noise| quadratic.decrease() <= noise.hidden * quadratic.b.len() as f64;
        Ok(match self.limits.noise.is_some_and(hidden) {
            true => ControlFlow::Break(StopReason::CostSettled),
            false => ControlFlow::Continue(Linearised { linear, quadratic }),
        })
    }

    fn trial(&mut self, point: &Point, linearised: &Linearised, damping: f64) -> Trial<Point> {
        let Some(step) = linearised.quadratic.step(damping) else {
            return Trial::Refused;
        };
        if step.predicted <= 1e-3 * self.limits.tolerance * point.cost.total && damping < 1.0 {
            return Trial::Stop(StopReason::CostSettled);
        }
        let moved = self.follow(point, linearised, &step).and_then(|y| {
            let theta = &point.theta + &linearised.quadratic.map * y;
            let cost = self.objective.cost(&theta)?;
            Some(Point { theta, cost })
        });
        moved.map_or(Trial::Refused, |point| Trial::To {
            point,
            predicted: step.predicted,
        })
    }
}

impl<O: Objective> Descent<'_, O> {
    /// The step with its correction; none where the residuals bend too much for it to be believed.
    fn follow(&self, point: &Point, at: &Linearised, step: &DampedStep) -> Option<DVector<f64>> {
        let map = &at.quadratic.map;
        let curvature = self
            .objective
            .curvature(&point.theta, &at.linear, &(map * &step.y));
        let Some(more) = curvature.and_then(|c| step.correction(&map.tr_mul(&c))) else {
            return Some(step.y.clone());
        };
        (2.0 * more.norm() <= BEND * step.y.norm()).then(|| &step.y + more)
    }
}

pub(crate) fn search(
    objective: &impl Objective,
    start: DVector<f64>,
    limits: &Limits,
) -> Result<Found, FitError> {
    let cost = objective.cost(&start).ok_or_else(|| objective.no_start())?;
    let mut descent = Descent {
        objective,
        limits,
        factorisations: 0,
    };
    let rule = Damping {
        start: limits.damping,
        least: DAMPING[0],
        most: DAMPING[1],
        attempts: usize::MAX,
        after_descent: AfterDescent::Nielsen,
        after_refusal: AfterRefusal::Doubling,
    };
    let found = minimise(&mut descent, Point { theta: start, cost }, &rule)?;
    Ok(Found {
        theta: found.point.theta,
        cost: found.point.cost,
        stop: found.stop,
        history: found.history,
        trials: found.trials,
        factorisations: descent.factorisations,
    })
}
