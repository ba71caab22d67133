//! The least-squares problem over all positions: its cost, and what a step must keep.

mod curvature;
mod linearise;

use crate::candidate::{Candidate, Channel};
use crate::data::{FrozenData, Position};
use crate::frozen::{Closure, close};
use crate::lines::squared_residuals;
use crate::sampling::Sampling;
use crate::sampling::hold::Derivative;
use crate::shape::Shape;
use crate::structure::{Reach, Structure};
use crate::{FitError, indistinguishable};
use lpv_core::Frf;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use rayon::prelude::*;

pub(crate) use linearise::chain;

type C64 = Complex<f64>;

/// Poles this near to those of an integrator, relative to the largest pole, are what rounding makes of a double one.
const INTEGRATOR: f64 = 1e-5;

/// A candidate without the states that nothing moves, and the data without the response of those.
pub(crate) struct Problem<'a, K: Sampling> {
    whole: Candidate<K>,
    /// Rows and columns of the whole M that remain.
    rows: Vec<usize>,
    columns: Vec<usize>,
    shape: Shape,
    channels: Vec<Channel>,
    /// Free entries in the rows and columns that remain, in the order of the whole.
    pub(crate) free: Vec<(usize, usize)>,
    reach: Reach,
    data: &'a FrozenData,
    /// The data less the constant part, line after line, for each position.
    values: Vec<Vec<C64>>,
    /// A factor a line that only the cost and its linearisation know: how a minimax fit shifts the weight.
    emphasis: Vec<Vec<f64>>,
    /// What `Delta(p)` holds at each position.
    deltas: Vec<Vec<f64>>,
    /// What held at the start and must go on to hold.
    stable: Vec<bool>,
    positive: Vec<bool>,
    well_posed: bool,
}

/// Sums of squares at one point.
#[derive(Debug, Clone)]
pub(crate) struct Cost {
    pub(crate) total: f64,
    /// The square of each line's residual, for each position, without the emphasis that the total has.
    pub(crate) lines: Vec<Vec<f64>>,
}

/// `r + J dtheta`, compressed to a few rows a position by orthogonal transformations.
pub(crate) struct Linear {
    pub(crate) jacobian: DMatrix<f64>,
    pub(crate) residual: DVector<f64>,
    /// Factorisations of tall blocks that it took.
    pub(crate) factorisations: usize,
    /// Of every position, the sampled S and how its active entries move with the free ones; empty where there is none.
    pub(crate) chains: Vec<(DMatrix<f64>, DMatrix<f64>)>,
}

impl<'a, K: Sampling> Problem<'a, K> {
    pub(crate) fn new(candidate: &Candidate<K>, data: &'a FrozenData) -> Result<Self, FitError> {
        check(candidate, data)?;
        let structure = Structure::new(candidate);
        let whole_shape = candidate.shape();
        let (m, n) = (candidate.matrix(), whole_shape.states);
        let rows: Vec<usize> = structure.kept.iter().copied().chain(n..m.nrows()).collect();
        let columns: Vec<usize> = structure.kept.iter().copied().chain(n..m.ncols()).collect();
        let shape = Shape {
            states: structure.kept.len(),
            ..whole_shape
        };
        let free = DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
            candidate.free()[(rows[i], columns[j])]
        });
        let remaining = m.select_rows(&rows).select_columns(&columns);
        let reduced = Candidate::from_matrix(remaining, free, shape, candidate);
        let constant = constant_response(candidate, &structure.constant, data)?;
        let values = data
            .positions()
            .iter()
            .zip(&constant)
            .map(|(position, constant)| {
                let less = position.frf.values().iter().zip(constant.values());
                less.map(|(g, c)| g - c).collect()
            });
        let mut problem = Self {
            free: reduced.free_entries(),
            reach: Reach::new(&reduced),
            shape,
            channels: candidate.channels().to_vec(),
            values: values.collect(),
            emphasis: data.responses().map(|frf| vec![1.0; frf.len()]).collect(),
            deltas: data.scheduling().map(|p| candidate.deltas_at(p)).collect(),
            stable: vec![false; data.len()],
            positive: vec![true; data.len()],
            well_posed: false,
            whole: candidate.clone(),
            rows,
            columns,
            data,
        };
        problem.remember_start(candidate)?;
        Ok(problem)
    }

    /// The factor of each line of each position.
    pub(crate) fn emphasise(&mut self, emphasis: Vec<Vec<f64>>) {
        self.emphasis = emphasis;
    }

    /// What holds at the start must hold at every step.
    fn remember_start(&mut self, candidate: &Candidate<K>) -> Result<(), FitError> {
        let m = self.matrix(&self.theta(candidate));
        for (i, delta) in self.deltas.iter().enumerate() {
            let start = |problem| FitError::Start {
                p: self.data.positions()[i].p.clone(),
                problem,
            };
            let frozen = close(&m, self.shape, delta, Closure::Value)
                .ok_or_else(|| start("the LFR is not well-posed there"))?;
            self.positive[i] = frozen.positive;
            self.stable[i] = self.is_stable(&frozen.s);
        }
        self.well_posed = self.has_no_singular_delta(&m);
        Ok(())
    }

    /// The free entries of a candidate of the same structure.
    pub(crate) fn theta(&self, candidate: &Candidate<K>) -> DVector<f64> {
        let m = candidate.matrix();
        let entries = self.free.iter().map(|&(i, j)| m[(self.rows[i], self.columns[j])]);
        DVector::from_iterator(self.free.len(), entries)
    }

    /// The candidate with these free entries.
    pub(crate) fn candidate(&self, theta: &DVector<f64>) -> Candidate<K> {
        let mut m = self.whole.matrix().clone();
        for (&(i, j), v) in self.free.iter().zip(theta.iter()) {
            m[(self.rows[i], self.columns[j])] = *v;
        }
        self.whole.with_matrix(m)
    }

    fn matrix(&self, theta: &DVector<f64>) -> DMatrix<f64> {
        let mut m = self
            .whole
            .matrix()
            .select_rows(&self.rows)
            .select_columns(&self.columns);
        for (&at, v) in self.free.iter().zip(theta.iter()) {
            m[at] = *v;
        }
        m
    }

    /// Tangents of the changes of coordinates that leave every frozen response alone, one a column.
    pub(crate) fn indistinguishable(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        indistinguishable::tangents(&self.matrix(theta), self.shape, &self.channels, &self.free)
    }

    /// The cost; none where a response does not exist, or a property of the start is lost.
    pub(crate) fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        let m = self.matrix(theta);
        if self.well_posed && !self.has_no_singular_delta(&m) {
            return None;
        }
        let lines: Vec<Option<Vec<f64>>> = (0..self.deltas.len())
            .into_par_iter()
            .map(|i| {
                let frozen = close(&m, self.shape, &self.deltas[i], Closure::Value)?;
                if frozen.positive != self.positive[i] || (self.stable[i] && !self.is_stable(&frozen.s)) {
                    return None;
                }
                let sampled = self.sample(&frozen.s, Derivative::Skip)?;
                squared_residuals(&sampled.s, self.shape, &self.data.positions()[i], &self.values[i])
            })
            .collect();
        let lines = lines.into_iter().collect::<Option<Vec<_>>>()?;
        // Summed in the order of positions and lines, whatever thread computed them.
        let emphasised = lines.iter().zip(&self.emphasis);
        let total: f64 = emphasised
            .flat_map(|(squares, emphasis)| squares.iter().zip(emphasis))
            .map(|(square, emphasis)| square * emphasis * emphasis)
            .sum();
        total.is_finite().then_some(Cost { total, lines })
    }

    /// The cost that rounding of the data alone makes.
    pub(crate) fn rounding(&self) -> f64 {
        let all: f64 = self.data.positions().iter().map(Position::energy).sum();
        all * (8.0 * f64::EPSILON).powi(2)
    }

    /// Why a start has no cost.
    pub(crate) fn no_start(&self) -> FitError {
        FitError::Start {
            p: self.whole.range().centre(),
            problem: "a response of the model is infinite on a line of the data",
        }
    }

    fn sample(&self, s: &DMatrix<f64>, want: Derivative) -> Option<crate::sampling::hold::Sampled> {
        self.whole
            .clock()
            .sample(s, self.shape.states, self.data.clock(), want)
    }

    fn is_stable(&self, s: &DMatrix<f64>) -> bool {
        let moving = &self.reach.moving;
        let a = s.select_rows(moving).select_columns(moving);
        let clock = self.whole.clock();
        let integrator = if clock.nyquist_hz().is_infinite() {
            0.0
        } else {
            1.0
        };
        lpv_core::linalg::eigenvalues(&a).is_ok_and(|poles| {
            let largest = poles.iter().map(|p| p.norm()).fold(0.0, f64::max);
            let stays =
                |p: Complex<f64>| (p - integrator).norm() <= INTEGRATOR * largest || clock.is_stable_pole(p);
            poles.into_iter().all(stays)
        })
    }

    /// Whether no delta of [-1, 1] makes the loop singular. Decided for one parameter and no direct channels, by the
    /// real eigenvalues of D11; else the signs at the positions must do.
    fn has_no_singular_delta(&self, m: &DMatrix<f64>) -> bool {
        let one = self.channels.first();
        if one.is_none_or(|c| *c == Channel::Direct) || self.channels.iter().any(|c| Some(c) != one) {
            return true;
        }
        let nc = self.channels.len();
        let d11 = m
            .view((self.shape.rows(), self.shape.columns()), (nc, nc))
            .into_owned();
        lpv_core::linalg::eigenvalues(&d11).is_ok_and(|all| {
            all.into_iter()
                .all(|l| l.im.abs() > 1e-8 * l.norm() || l.re.abs() < 1.0)
        })
    }
}

/// Refuses data that the candidate has no place for.
fn check<K: Sampling>(candidate: &Candidate<K>, data: &FrozenData) -> Result<(), FitError> {
    candidate.clock().agrees(data.clock())?;
    for (what, expected, found) in [
        ("outputs", candidate.outputs(), data.outputs()),
        ("inputs", candidate.inputs(), data.inputs()),
    ] {
        if expected != found {
            return Err(FitError::Data {
                index: 0,
                what,
                expected,
                found,
            });
        }
    }
    for p in data.scheduling() {
        candidate.range().check(p)?;
    }
    Ok(())
}

/// The response of the states that nothing moves, on the lines of each position.
fn constant_response<K: Sampling>(
    candidate: &Candidate<K>,
    constant: &[usize],
    data: &FrozenData,
) -> Result<Vec<Frf>, FitError> {
    let (m, shape) = (candidate.matrix(), candidate.shape());
    let (n, n_c) = (shape.states, constant.len());
    let rows: Vec<usize> = constant.iter().copied().chain(n..shape.rows()).collect();
    let columns: Vec<usize> = constant.iter().copied().chain(n..shape.columns()).collect();
    let mut s = m.select_rows(&rows).select_columns(&columns);
    let (ny, nu) = (shape.outputs, shape.inputs);
    // D stays with the states that move.
    s.view_mut((n_c, n_c), (ny, nu)).fill(0.0);
    let sampled = candidate
        .clock()
        .sample(&s, n_c, data.clock(), Derivative::Skip)
        .ok_or_else(|| FitError::Start {
            p: candidate.range().centre(),
            problem: "the fixed states are too fast for the clock of the data",
        })?;
    let constant = Shape { states: n_c, ..shape };
    let system = constant.system(&sampled.s, data.clock())?;
    let responses = data
        .responses()
        .map(|frf| Ok(system.frequency_response(frf.frequencies_hz())?));
    responses.collect()
}

#[cfg(test)]
mod tests;
