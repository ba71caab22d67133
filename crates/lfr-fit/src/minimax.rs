//! Lawson's iteration: weights that grow where the residual is large, until the largest is as small as can be.

use crate::FitError;
use crate::problem::{Cost, Problem};
use crate::sampling::Sampling;
use crate::search::{Found, Limits, search};

/// Iterations of one reweighted fit.
const ITERATIONS: usize = 10;

/// Squared weights are kept above this part of their mean, so that no line is lost for good.
const LEAST: f64 = 1e-6;

/// After each fit the squared weight of a line is multiplied by its residual (Lawson). The point with the smallest
/// largest residual wins, the start included.
pub(crate) fn polish<K: Sampling>(
    problem: &mut Problem<'_, K>,
    start: Found,
    passes: usize,
    limits: &Limits,
) -> Result<Found, FitError> {
    let mut squares: Vec<Vec<f64>> = start.cost.lines.iter().map(|l| vec![1.0; l.len()]).collect();
    let mut best = start;
    let mut point = (best.theta.clone(), best.cost.clone());
    let limits = Limits {
        max_iterations: ITERATIONS,
        target: 0.0,
        noise: None,
        ..*limits
    };
    for _ in 0..passes {
        reweight(&mut squares, &point.1);
        problem.emphasise(
            squares
                .iter()
                .map(|l| l.iter().map(|w| w.sqrt()).collect())
                .collect(),
        );
        let found = search(problem, point.0, &limits)?;
        best.trials += found.trials;
        best.factorisations += found.factorisations;
        if largest(&found.cost) < largest(&best.cost) {
            best.theta = found.theta.clone();
            best.cost = found.cost.clone();
        }
        point = (found.theta, found.cost);
    }
    problem.emphasise(squares.iter().map(|l| vec![1.0; l.len()]).collect());
    Ok(best)
}

fn largest(cost: &Cost) -> f64 {
    cost.lines.iter().flatten().copied().fold(0.0, f64::max)
}

fn reweight(squares: &mut [Vec<f64>], cost: &Cost) {
    for (squares, residuals) in squares.iter_mut().zip(&cost.lines) {
        for (square, residual) in squares.iter_mut().zip(residuals) {
            *square *= residual.sqrt();
        }
    }
    let count: usize = squares.iter().map(Vec::len).sum();
    let mean = squares.iter().flatten().sum::<f64>() / count.max(1) as f64;
    for square in squares.iter_mut().flatten() {
        *square = (*square / mean.max(f64::MIN_POSITIVE)).max(LEAST);
    }
}
