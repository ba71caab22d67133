//! Residuals, their covariance, and the normal equations of a step.

use crate::Offset;
use crate::predictor::{Predictor, Region};
use crate::sensitivity::Sensitivities;
use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, Dyn};
use rayon::prelude::*;

/// Smallest variance of a residual of signals of unit deviation: below it are rounding errors.
const FLOOR: f64 = 1e-24;

/// One run without gaps: known signals `n_w x N` and outputs `n_y x N`.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) known: DMatrix<f64>,
    pub(crate) outputs: DMatrix<f64>,
}

impl Run {
    /// Samples from the middle, so that it does not matter whether the run begins or ends at rest.
    fn middle(&self, samples: usize) -> Self {
        let samples = samples.min(self.outputs.ncols());
        let from = (self.outputs.ncols() - samples) / 2;
        Self {
            known: self.known.columns(from, samples).into_owned(),
            outputs: self.outputs.columns(from, samples).into_owned(),
        }
    }
}

/// What a predictor is fitted to.
#[derive(Debug, Clone)]
pub(crate) struct Problem {
    pub(crate) runs: Vec<Run>,
    /// The first columns of D that are free; the others are zero.
    pub(crate) direct: usize,
    /// Whether d is free; else it is zero.
    pub(crate) offset: Offset,
    /// Where eigenvalues of A may be.
    pub(crate) region: Region,
}

/// Samples of the longest run.
pub(crate) fn longest(runs: &[Run]) -> usize {
    runs.iter().map(|r| r.outputs.ncols()).max().unwrap_or(0)
}

/// A predictor with its initial states and what they give.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) predictor: Predictor,
    pub(crate) initial: Vec<DVector<f64>>,
    /// Residuals of each run, `n_y x N`.
    pub(crate) residuals: Vec<DMatrix<f64>>,
    /// Lower Cholesky factor of the residuals' covariance.
    pub(crate) factor: DMatrix<f64>,
    /// `ln det` of that covariance.
    pub(crate) cost: f64,
}

impl Problem {
    pub(crate) fn known(&self) -> usize {
        self.runs.first().map_or(0, |r| r.known.nrows())
    }
    pub(crate) fn outputs(&self) -> usize {
        self.runs.first().map_or(0, |r| r.outputs.nrows())
    }
    pub(crate) fn samples(&self) -> usize {
        self.runs.iter().map(|r| r.outputs.ncols()).sum()
    }

    /// About as many samples as asked for, the same part of each run; `None` if there are no more than that.
    pub(crate) fn part(&self, samples: usize) -> Option<Self> {
        let all = self.samples();
        let share = |r: &Run| r.middle((r.outputs.ncols() * samples).div_ceil(all));
        (all > samples).then(|| {
            let runs: Vec<Run> = self.runs.iter().map(share).collect();
            let region = Region::for_samples(longest(&runs), self.offset);
            Self {
                runs,
                region,
                ..*self
            }
        })
    }

    /// The free entries of `[D d]` of a filter with some states.
    pub(crate) fn feedthrough(&self, states: usize) -> [Block; 2] {
        let ny = self.outputs();
        let constant = match self.offset {
            Offset::Estimated => 1,
            Offset::Zero => 0,
        };
        [
            ((states, states), (ny, self.direct)),
            ((states, states + self.known()), (ny, constant)),
        ]
    }

    /// `None` for an unstable predictor or a cost that is not finite.
    pub(crate) fn point(&self, predictor: Predictor, initial: Vec<DVector<f64>>) -> Option<Point> {
        if !predictor.is_within(self.region) {
            return None;
        }
        let residual = |(run, x): (&Run, &DVector<f64>)| &run.outputs - predictor.predictions(x, &run.known);
        let residuals: Vec<_> = self.runs.iter().zip(&initial).map(residual).collect();
        let factor = covariance(&residuals).cholesky()?.unpack();
        let cost = 2.0 * factor.diagonal().map(f64::ln).sum();
        cost.is_finite().then_some(Point {
            predictor,
            initial,
            residuals,
            factor,
            cost,
        })
    }
}

/// Covariance of residuals about zero.
pub(crate) fn covariance(residuals: &[DMatrix<f64>]) -> DMatrix<f64> {
    let ny = residuals.first().map_or(0, DMatrix::nrows);
    let samples: usize = residuals.iter().map(DMatrix::ncols).sum();
    let sum = residuals
        .iter()
        .fold(DMatrix::zeros(ny, ny), |sum, r| sum + r * r.transpose());
    sum / samples.max(1) as f64 + DMatrix::identity(ny, ny) * FLOOR
}

/// Whether the initial states take part in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum InitialStates {
    Estimated,
    Held,
}

/// Normal equations of the whitened residuals, for directions in the space of `[A B 0; C D d]` and the initial
/// state of each run.
pub(crate) struct Equations {
    common: DMatrix<f64>,
    gradient: DVector<f64>,
    runs: Vec<Own>,
}

/// The part of one run that concerns its own initial state.
struct Own {
    cross: DMatrix<f64>,
    own: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// A change of the directions' coefficients and of the initial states.
pub(crate) struct Step {
    pub(crate) coefficients: DVector<f64>,
    pub(crate) initial: Vec<DVector<f64>>,
}

impl Equations {
    /// Column k of `directions` is `vec` of a change of `[A B 0; C D d]`.
    pub(crate) fn new(
        problem: &Problem,
        point: &Point,
        directions: &DMatrix<f64>,
        initial: InitialStates,
    ) -> Option<Self> {
        let p = directions.ncols();
        let sensitivities = Sensitivities::new(point, directions, initial)?;
        let sum = |(i, run): (usize, &Run)| sensitivities.sum(run, &point.initial[i], &point.residuals[i]);
        let sums: Vec<_> = problem.runs.par_iter().enumerate().map(sum).collect();
        let mut equations = Self {
            common: DMatrix::zeros(p, p),
            gradient: DVector::zeros(p),
            runs: Vec::new(),
        };
        for (h, g) in sums {
            let n = g.len() - p;
            equations.common += h.view((0, 0), (p, p));
            equations.gradient += g.rows(0, p);
            equations.runs.push(Own {
                cross: h.view((0, p), (p, n)).into_owned(),
                own: h.view((p, p), (n, n)).into_owned(),
                gradient: g.rows(p, n).into_owned(),
            });
        }
        Some(equations)
    }

    /// The step of Levenberg and Marquardt: diagonals are raised by the part `damping`. Initial states are eliminated
    /// run by run.
    pub(crate) fn step(&self, damping: f64) -> Option<Step> {
        let mut schur = damped(&self.common, damping);
        let mut gradient = self.gradient.clone();
        let mut solved: Vec<(Cholesky<f64, Dyn>, &Own)> = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            let own = damped(&run.own, damping).cholesky()?;
            let cross_t = run.cross.transpose();
            schur -= &run.cross * own.solve(&cross_t);
            gradient -= &run.cross * own.solve(&run.gradient);
            solved.push((own, run));
        }
        let coefficients = schur.cholesky()?.solve(&gradient);
        let initial = solved
            .iter()
            .map(|(own, run)| own.solve(&(&run.gradient - run.cross.tr_mul(&coefficients))))
            .collect();
        Some(Step {
            coefficients,
            initial,
        })
    }
}

fn damped(m: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut m = m.clone();
    let least = 1e-12 * m.diagonal().amax() + f64::MIN_POSITIVE;
    for i in 0..m.nrows() {
        m[(i, i)] += damping * m[(i, i)] + least;
    }
    m
}

/// Row and column of the first entry of a block, and its shape.
pub(crate) type Block = ((usize, usize), (usize, usize));

/// One direction for each entry of some blocks of a matrix, as its `vec`.
pub(crate) fn unit_directions(shape: (usize, usize), blocks: &[Block]) -> DMatrix<f64> {
    let count: usize = blocks.iter().map(|(_, (r, c))| r * c).sum();
    let mut directions = DMatrix::zeros(shape.0 * shape.1, count);
    let mut column = 0;
    for &((top, left), (rows, columns)) in blocks {
        for j in left..left + columns {
            for i in top..top + rows {
                directions[(j * shape.0 + i, column)] = 1.0;
                column += 1;
            }
        }
    }
    directions
}

/// The matrix whose `vec` is a slice.
pub(crate) fn unvec(shape: (usize, usize), v: &DVector<f64>) -> DMatrix<f64> {
    DMatrixView::from_slice(v.as_slice(), shape.0, shape.1).into_owned()
}

#[cfg(test)]
mod tests;
