//! Levenberg-Marquardt on the manifold of filters.

use crate::StopReason;
use crate::predictor::{Predictor, reflected};
use crate::problem::{Equations, InitialStates, Point, Problem, Step, unit_directions, unvec};
use nalgebra::DMatrix;

/// Damping at which a search without descent gives up.
const LARGEST_DAMPING: f64 = 1e10;

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
    pub(crate) tolerance: f64,
}

pub(crate) struct Outcome {
    pub(crate) point: Point,
    pub(crate) iterations: usize,
    pub(crate) stop: StopReason,
}

/// Minimises `ln det` of the residuals' covariance, whose gradient is that of the sum of squares weighted by the
/// inverse of the covariance at the point \[ljung1999\], (7.29).
pub(crate) fn search(problem: &Problem, start: Point, coordinates: &Coordinates, limits: Limits) -> Outcome {
    let mut point = start;
    let mut damping = 1e-2;
    let mut small = 0;
    for iterations in 0..limits.iterations {
        if let Coordinates::Local = coordinates {
            point = rebalanced(problem, point);
        }
        let directions = match coordinates {
            Coordinates::Local => local_directions(problem, &point.predictor),
            Coordinates::Fixed(directions) => directions.clone(),
        };
        let (initial, bounds) = match coordinates {
            Coordinates::Local => (InitialStates::Estimated, Bounds::Projected),
            Coordinates::Fixed(_) => (InitialStates::Held, Bounds::Refused),
        };
        let next = Equations::new(problem, &point, &directions, initial)
            .and_then(|equations| descend(problem, &point, &directions, &equations, bounds, &mut damping));
        let Some(next) = next else {
            return Outcome {
                point,
                iterations,
                stop: StopReason::NoDescent,
            };
        };
        // One short step may only say that the damping was high.
        small = if point.cost - next.cost < limits.tolerance {
            small + 1
        } else {
            0
        };
        point = next;
        if small == 2 {
            return Outcome {
                point,
                iterations: iterations + 1,
                stop: StopReason::Converged,
            };
        }
    }
    Outcome {
        point,
        iterations: limits.iterations,
        stop: StopReason::IterationLimit,
    }
}

fn descend(
    problem: &Problem,
    point: &Point,
    directions: &DMatrix<f64>,
    equations: &Equations,
    bounds: Bounds,
    damping: &mut f64,
) -> Option<Point> {
    while *damping < LARGEST_DAMPING {
        let step = equations.step(*damping);
        let trial = step.and_then(|step| moved(problem, point, directions, &step, bounds));
        if let Some(trial) = trial.filter(|t| t.cost < point.cost) {
            *damping = (*damping / 6.0).max(1e-9);
            return Some(trial);
        }
        *damping *= 4.0;
    }
    None
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

/// The same filter in balanced coordinates, if rounding leaves it as good as it was.
fn rebalanced(problem: &Problem, point: Point) -> Point {
    let moved = point.predictor.balanced(&point.initial);
    let moved = moved.and_then(|(predictor, initial)| problem.point(predictor, initial));
    match moved {
        Some(moved) if moved.cost <= point.cost + 1e-9 => moved,
        _ => point,
    }
}

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
    let complement = complement(&tangent.select_rows(&bare));
    let feed = unit_directions((rows, columns), &problem.feedthrough(n));
    let mut all = DMatrix::zeros(rows * columns, complement.ncols() + feed.ncols());
    for (from, &to) in bare.iter().enumerate() {
        all.view_mut((to, 0), (1, complement.ncols()))
            .copy_from(&complement.row(from));
    }
    all.columns_mut(complement.ncols(), feed.ncols()).copy_from(&feed);
    all
}

/// Orthonormal basis of the orthogonal complement of the columns.
fn complement(m: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = m.shape();
    let rest = rows - columns;
    let mut last = DMatrix::zeros(rows, rest);
    last.view_mut((columns, 0), (rest, rest)).fill_with_identity();
    // H_1 H_2 ... applied to the last columns of the identity.
    let (reflectors, _) = householder(m.clone());
    for (j, v) in reflectors.iter().enumerate().rev() {
        let mut below = last.rows_mut(j, rows - j);
        let projected = below.tr_mul(v);
        below.ger(-2.0, v, &projected, 1.0);
    }
    last
}

/// Unit reflectors of the QR factorisation, and the factored matrix.
fn householder(mut m: DMatrix<f64>) -> (Vec<nalgebra::DVector<f64>>, DMatrix<f64>) {
    let (rows, columns) = m.shape();
    let mut reflectors = Vec::with_capacity(columns);
    for j in 0..columns {
        let mut v = m.view((j, j), (rows - j, 1)).column(0).into_owned();
        v[0] += v.norm().copysign(v[0]);
        let norm = v.norm();
        if norm > 0.0 {
            v /= norm;
        }
        let mut below = m.view_mut((j, j), (rows - j, columns - j));
        let projected = below.tr_mul(&v);
        below.ger(-2.0, &v, &projected, 1.0);
        reflectors.push(v);
    }
    (reflectors, m)
}
