//! Residuals, their covariance, and the normal equations of a step.

use crate::Offset;
use crate::predictor::{Predictor, Region};
use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, Dyn};
use rayon::prelude::*;

/// Samples whose sensitivities are held at a time.
const BLOCK: usize = 64;

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
        let residual = |(run, x): (&Run, &DVector<f64>)| &run.outputs - predictor.simulate(x, &run.known).0;
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
        let whiten = point.factor.clone().try_inverse()?;
        let stacked = stacked(&point.predictor, directions);
        let p = directions.ncols();
        let sum = |(i, run): (usize, &Run)| {
            Sensitivities {
                predictor: &point.predictor,
                stacked: &stacked,
                directions: p,
                free: if initial == InitialStates::Estimated {
                    point.predictor.states
                } else {
                    0
                },
                whiten: &whiten,
            }
            .sum(run, &point.initial[i], &point.residuals[i])
        };
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

/// Directions one below the other, each `(n + n_y) x (n + n_w + 1)`: their product with `[x; w; 1]` drives all sensitivities.
fn stacked(predictor: &Predictor, directions: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = predictor.matrix.shape();
    DMatrix::from_fn(rows * directions.ncols(), columns, |i, j| {
        directions[(j * rows + i % rows, i / rows)]
    })
}

struct Sensitivities<'a> {
    predictor: &'a Predictor,
    stacked: &'a DMatrix<f64>,
    directions: usize,
    /// Initial states that are free: all or none.
    free: usize,
    whiten: &'a DMatrix<f64>,
}

impl Sensitivities<'_> {
    /// `J' J` and `J' r` of one run. Sensitivities `Z = [dx/dtheta, dx/dx_0]` follow `Z+ = A Z + dM [x; w; 1]`, and
    /// the rows of J are `C Z + dM [x; w; 1]`.
    fn sum(
        &self,
        run: &Run,
        initial: &DVector<f64>,
        residual: &DMatrix<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let (n, ny) = (self.predictor.states, self.predictor.outputs());
        let (p, columns) = (self.directions, self.directions + self.free);
        let states = self.predictor.simulate(initial, &run.known).1;
        let left = self.predictor.matrix.columns(0, n);
        let whitened = self.whiten * residual;
        let mut z = DMatrix::zeros(n, columns);
        z.view_mut((0, p), (self.free, self.free)).fill_with_identity();
        let mut out = DMatrix::zeros(n + ny, columns);
        let mut h = DMatrix::zeros(columns, columns);
        let mut g = DVector::zeros(columns);
        for from in (0..residual.ncols()).step_by(BLOCK) {
            let samples = BLOCK.min(residual.ncols() - from);
            let forces = self.forces(&states, &run.known, from, samples);
            let mut jacobian = DMatrix::zeros(columns, ny * samples);
            for k in 0..samples {
                out.gemm(1.0, &left, &z, 0.0);
                let force = forces.column(k);
                for (v, f) in out.as_mut_slice().iter_mut().zip(force.as_slice()) {
                    *v += f;
                }
                z.copy_from(&out.rows(0, n));
                let rows = self.whiten * out.rows(n, ny);
                jacobian.columns_mut(ny * k, ny).copy_from(&rows.transpose());
            }
            let r = whitened.columns(from, samples);
            g.gemv(
                1.0,
                &jacobian,
                &DVector::from_iterator(ny * samples, r.iter().copied()),
                1.0,
            );
            h.gemm(1.0, &jacobian, &jacobian.transpose(), 1.0);
        }
        (h, g)
    }

    fn forces(
        &self,
        states: &DMatrix<f64>,
        known: &DMatrix<f64>,
        from: usize,
        samples: usize,
    ) -> DMatrix<f64> {
        let n = states.nrows();
        let mut both = DMatrix::from_element(n + known.nrows() + 1, samples, 1.0);
        both.rows_mut(0, n).copy_from(&states.columns(from, samples));
        both.rows_mut(n, known.nrows())
            .copy_from(&known.columns(from, samples));
        self.stacked * both
    }
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
