//! Levenberg-Marquardt on the manifold of filters.

use crate::predictor::{Predictor, reflected};
use crate::problem::{Equations, InitialStates, Point, Problem, Step, unit_directions, unvec};
use lpv_numerics::dense::complement;
use lpv_numerics::least_squares::{AfterDescent, AfterRefusal, Damping, Search, StopReason, Trial, minimise};
use nalgebra::DMatrix;
use std::convert::Infallible;
use std::ops::ControlFlow;

/// Along what a search may move.
#[derive(Debug, Clone)]
pub(crate) enum Coordinates {
    /// All filters of this order: the orthogonal complement of the tangent of the similarity orbit, taken anew at each
    /// point (data-driven local coordinates).
    Local,
    /// Fixed directions, as columns `vec([dA dB 0; dC dD dd])`; initial states are held.
    Fixed(DMatrix<f64>),
}

/// What happens to a step that leaves the poles allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bounds {
    /// The poles are moved back inside.
    Projected,
    /// The step is refused.
    Refused,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) iterations: usize,
    /// Decrease of the cost that counts as none.
    pub(crate) tolerance: f64,
}

pub(crate) struct Outcome {
    pub(crate) point: Point,
    pub(crate) iterations: usize,
    pub(crate) stop: StopReason,
}

const DAMPING: Damping = Damping {
    start: 1e-2,
    least: 1e-9,
    most: 1e10,
    attempts: usize::MAX,
    after_descent: AfterDescent::Divide(6.0),
    after_refusal: AfterRefusal::Multiply(4.0),
};

/// Minimises `ln det` of the residuals' covariance, whose gradient is that of the sum of squares weighted by the
/// inverse of the covariance at the point \[ljung1999\], (7.29).
pub(crate) fn search(problem: &Problem, start: Point, coordinates: &Coordinates, limits: Limits) -> Outcome {
    let mut descent = Descent {
        problem,
        coordinates,
        limits,
    };
    let Ok(found) = minimise(&mut descent, start, &DAMPING);
    Outcome {
        iterations: found.history.len() - 1,
        point: found.point,
        stop: found.stop,
    }
}

/// A problem on the way down.
struct Descent<'a> {
    problem: &'a Problem,
    coordinates: &'a Coordinates,
    limits: Limits,
}

/// Along what the cost changes, and how.
struct Linearised {
    directions: DMatrix<f64>,
    equations: Equations,
}

impl Search for Descent<'_> {
    type Point = Point;
    type Linear = Linearised;
    type Error = Infallible;

    fn cost(&self, point: &Point) -> f64 {
        point.cost
    }

    fn ended(&mut self, _: &Point, history: &[f64], _: &mut f64) -> Option<StopReason> {
        // One short step may only say that the damping was high.
        let short = |pair: &[f64]| pair[0] - pair[1] < self.limits.tolerance;
        if history.len() > 2 && history[history.len() - 3..].windows(2).all(short) {
            return Some(StopReason::CostSettled);
        }
        (history.len() > self.limits.iterations).then_some(StopReason::IterationLimit)
    }

    fn linearise(&mut self, point: &mut Point) -> Result<ControlFlow<StopReason, Linearised>, Infallible> {
        let (directions, initial) = match self.coordinates {
            Coordinates::Local => {
                rebalance(self.problem, point);
                let local = local_directions(self.problem, &point.predictor);
                (local, InitialStates::Estimated)
            }
            Coordinates::Fixed(directions) => (directions.clone(), InitialStates::Held),
        };
        let equations = Equations::new(self.problem, point, &directions, initial);
        Ok(
            equations.map_or(ControlFlow::Break(StopReason::NoDescent), |equations| {
                ControlFlow::Continue(Linearised {
                    directions,
                    equations,
                })
            }),
        )
    }

    fn trial(&mut self, point: &Point, linear: &Linearised, damping: f64) -> Trial<Point> {
        let bounds = match self.coordinates {
            Coordinates::Local => Bounds::Projected,
            Coordinates::Fixed(_) => Bounds::Refused,
        };
        let step = linear.equations.step(damping);
        let moved = step.and_then(|step| moved(self.problem, point, &linear.directions, &step, bounds));
        moved.map_or(Trial::Refused, |point| Trial::To {
            point,
            predicted: f64::NAN,
        })
    }
}

/// The point at the end of a step, if it is one.
pub(crate) fn moved(
    problem: &Problem,
    point: &Point,
    directions: &DMatrix<f64>,
    step: &Step,
    bounds: Bounds,
) -> Option<Point> {
    let (shape, states) = (point.predictor.matrix.shape(), point.predictor.states);
    let matrix = &point.predictor.matrix + unvec(shape, &(directions * &step.coefficients));
    let mut predictor = Predictor { states, matrix };
    if bounds == Bounds::Projected && !predictor.is_within(problem.region) {
        let inside = reflected(&predictor.a().into_owned(), problem.region)?;
        predictor
            .matrix
            .view_mut((0, 0), (states, states))
            .copy_from(&inside);
    }
    let mut initial = point.initial.clone();
    for (x, change) in initial.iter_mut().zip(&step.initial) {
        if x.len() == change.len() {
            *x += change;
        }
    }
    problem.point(predictor, initial)
}

/// Writes a filter in balanced coordinates, if rounding leaves it as good as it was.
fn rebalance(problem: &Problem, point: &mut Point) {
    let moved = point.predictor.balanced(&point.initial);
    let moved = moved.and_then(|(predictor, initial)| problem.point(predictor, initial));
    if let Some(moved) = moved.filter(|moved| moved.cost <= point.cost + 1e-9) {
        *point = moved;
    }
}

/// Tangents that depend on others up to this are none: the filter is not minimal.
const DEPENDENT: f64 = 1e-12;

/// Orthonormal directions along which the response of the filter changes: the complement of
/// `(T A - A T, T B, -C T)` for all T, and the free entries of D and d.
pub(crate) fn local_directions(problem: &Problem, predictor: &Predictor) -> DMatrix<f64> {
    let n = predictor.states;
    let (rows, columns) = predictor.matrix.shape();
    let (a, b, c) = (predictor.a(), predictor.b(), predictor.c());
    let mut tangent = DMatrix::zeros(rows * columns, n * n);
    for j in 0..n {
        for i in 0..n {
            // T = e_i e_j'.
            let mut change = DMatrix::zeros(rows, columns);
            for k in 0..n {
                change[(i, k)] += a[(j, k)];
                change[(k, j)] -= a[(k, i)];
            }
            for k in 0..b.ncols() {
                change[(i, n + k)] += b[(j, k)];
            }
            for k in 0..c.nrows() {
                change[(n + k, j)] -= c[(k, i)];
            }
            tangent.column_mut(j * n + i).copy_from_slice(change.as_slice());
        }
    }
    // D and d are not touched by T, so they are left out of the factorisation and come back as units.
    let bare: Vec<usize> = (0..rows * (columns - 1))
        .filter(|&i| i % rows < n || i / rows < n)
        .collect();
    let complement = complement(&tangent.select_rows(&bare), DEPENDENT);
    let feed = unit_directions((rows, columns), &problem.feedthrough(n));
    let mut all = DMatrix::zeros(rows * columns, complement.ncols() + feed.ncols());
    for (from, &to) in bare.iter().enumerate() {
        all.view_mut((to, 0), (1, complement.ncols()))
            .copy_from(&complement.row(from));
    }
    all.columns_mut(complement.ncols(), feed.ncols()).copy_from(&feed);
    all
}
