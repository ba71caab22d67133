//! The parameter-dependent state transformation T(p) of a frozen model, by its rate `-T^-1 dT/dp`.

use super::along::{Dynamics, Transition};
use super::data::{MovingData, MovingRecord};
use super::flow::{Flow, Want};
use crate::{FitError, MechanicalForm};
use lpv_core::Discrete;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// `dx~/dt = (A(p) + dp/dt G(p)) x~ + B(p) u` with `G(p) = sum_j G_j T_j(delta)` in Chebyshev polynomials of the
/// normalised p.
///
/// If the machine's state is `x = T(p) x~`, then `G = -T^-1 dT/dp`: what constant positions cannot show. Entries of G
/// that are listed together share one number.
#[derive(Debug, Clone, PartialEq)]
pub struct StateTransformation {
    /// Entries (row, column) of G that share a number.
    pub(crate) directions: Vec<Vec<(usize, usize)>>,
    /// One row a direction, one column a Chebyshev polynomial.
    pub(crate) coefficients: DMatrix<f64>,
    pub(crate) states: usize,
}

impl StateTransformation {
    /// Zero, with the positions and the rates of every second-order pair transformed alike: states `[q; v]`, and
    /// `G = diag(g, g)`. `degree` is that of the polynomials.
    pub(crate) fn of_pairs(states: usize, degree: usize) -> Self {
        let half = states / 2;
        let pair = |a: usize, b: usize| vec![(a, b), (half + a, half + b)];
        let directions: Vec<_> = (0..half)
            .flat_map(|b| (0..half).map(move |a| pair(a, b)))
            .collect();
        Self {
            coefficients: DMatrix::zeros(directions.len(), degree + 1),
            directions,
            states,
        }
    }

    /// `G(p)` at the normalised p, in its unit: per unit of `delta`.
    pub fn at(&self, delta: f64) -> DMatrix<f64> {
        let weights = chebyshev(delta, self.coefficients.ncols());
        let values = &self.coefficients * weights;
        let mut g = DMatrix::zeros(self.states, self.states);
        for (entries, value) in self.directions.iter().zip(values.iter()) {
            for &at in entries {
                g[at] += value;
            }
        }
        g
    }

    /// `T(p)` with `T = I` at the centre of the range: the solution of `dT/d delta = -T G`, by Runge-Kutta steps.
    pub fn basis(&self, delta: f64) -> DMatrix<f64> {
        const STEPS: usize = 200;
        let h = delta / STEPS as f64;
        let rate = |t: &DMatrix<f64>, at: f64| -(t * self.at(at));
        (0..STEPS).fold(DMatrix::identity(self.states, self.states), |t, i| {
            let at = h * i as f64;
            let k1 = rate(&t, at);
            let k2 = rate(&(&t + &k1 * (0.5 * h)), at + 0.5 * h);
            let k3 = rate(&(&t + &k2 * (0.5 * h)), at + 0.5 * h);
            let k4 = rate(&(&t + &k3 * h), at + h);
            t + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)
        })
    }

    pub(crate) fn with(&self, theta: &DVector<f64>) -> Self {
        let mut transformed = self.clone();
        transformed.coefficients.copy_from_slice(theta.as_slice());
        transformed
    }
    pub(crate) fn theta(&self) -> DVector<f64> {
        DVector::from_column_slice(self.coefficients.as_slice())
    }
}

pub(crate) fn chebyshev(delta: f64, count: usize) -> DVector<f64> {
    let mut values = DVector::zeros(count);
    for j in 0..count {
        values[j] = match j {
            0 => 1.0,
            1 => delta,
            _ => 2.0 * delta * values[j - 1] - values[j - 2],
        };
    }
    values
}

/// The frozen matrices along every record, computed once: only G is fitted.
pub(crate) struct Frozen {
    /// `[A B] T` at the middle of each interval.
    rows: Vec<DMatrix<f64>>,
    c: Vec<DMatrix<f64>>,
    /// Normalised middle and step of p.
    middles: Vec<(f64, f64)>,
}

/// A frozen model with a parameter-dependent state transformation; the coefficients of G are its parameters.
pub(crate) struct Transformed<'a> {
    pub(crate) transformation: StateTransformation,
    pub(crate) records: &'a [Frozen],
}

pub(crate) fn freeze(form: &MechanicalForm, data: &MovingData) -> Result<Vec<Frozen>, FitError> {
    let clock: Discrete = data.clock();
    let (centre, half) = (form.range().centre()[0], form.range().half_width()[0]);
    data.records()
        .par_iter()
        .map(|record| {
            let mut frozen = Frozen {
                rows: Vec::with_capacity(record.len()),
                c: Vec::with_capacity(record.len()),
                middles: Vec::with_capacity(record.len()),
            };
            for k in 0..record.len() {
                let (middle, step) = record.middle(k);
                let system = form.frozen(middle.as_slice())?;
                let (n, nu) = (system.states(), system.inputs());
                let mut rows = DMatrix::zeros(n, n + nu);
                rows.columns_mut(0, n).copy_from(system.a());
                rows.columns_mut(n, nu).copy_from(system.b());
                frozen.rows.push(rows * clock.sample_time());
                let here = form.frozen(record.scheduling.column(k).as_slice())?;
                frozen.c.push(here.c().clone());
                frozen.middles.push(((middle[0] - centre) / half, step[0] / half));
            }
            Ok(frozen)
        })
        .collect()
}

pub(crate) struct TransformedStep {
    transition: Transition,
    flow: Flow,
    rows: DMatrix<f64>,
    /// Step of the normalised p times the polynomials.
    weights: DVector<f64>,
    seen: DVector<f64>,
    moved: DMatrix<f64>,
}

impl AsRef<Transition> for TransformedStep {
    fn as_ref(&self) -> &Transition {
        &self.transition
    }
}

impl Dynamics for Transformed<'_> {
    type Step = TransformedStep;

    fn states(&self) -> usize {
        self.transformation.states
    }
    fn parameters(&self) -> usize {
        self.transformation.coefficients.len()
    }
    fn storage(&self, record: &MovingRecord) -> TransformedStep {
        let (n, nu, ny) = (self.states(), record.inputs.nrows(), record.outputs.nrows());
        TransformedStep {
            transition: Transition {
                ab: DMatrix::zeros(n, n + nu),
                c: DMatrix::zeros(ny, n),
            },
            flow: Flow::default(),
            rows: DMatrix::zeros(n, n + nu),
            weights: DVector::zeros(self.transformation.coefficients.ncols()),
            seen: DVector::zeros(n),
            moved: DMatrix::zeros(n, self.transformation.directions.len()),
        }
    }

    fn step(&self, record: &MovingRecord, k: usize, want: Want, step: &mut TransformedStep) -> Option<()> {
        let frozen = &self.records[record.index];
        let (delta, length) = frozen.middles[k];
        step.weights = chebyshev(delta, self.transformation.coefficients.ncols()) * length;
        step.rows.copy_from(&frozen.rows[k]);
        for (entries, row) in self
            .transformation
            .directions
            .iter()
            .zip(self.transformation.coefficients.row_iter())
        {
            let value = row
                .iter()
                .zip(step.weights.iter())
                .map(|(c, w)| c * w)
                .sum::<f64>();
            for &at in entries {
                step.rows[at] += value;
            }
        }
        step.flow.update(&step.rows, want)?;
        step.transition.ab.copy_from(&step.flow.whole);
        step.transition.c.copy_from(&frozen.c[k]);
        Some(())
    }

    fn add_output(&self, _: &TransformedStep, _: &DVector<f64>, _: &mut DMatrix<f64>) {}

    fn force(&self, step: &mut TransformedStep, signal: &DVector<f64>, sensitivity: &mut DMatrix<f64>) {
        let n = self.states();
        step.moved.fill(0.0);
        for product in step.flow.products() {
            step.seen.gemv(product.weight, &product.before, signal, 0.0);
            let after = product.after.as_slice();
            let columns = step.moved.as_mut_slice().chunks_exact_mut(n);
            for (column, entries) in columns.zip(&self.transformation.directions) {
                for &(a, b) in entries {
                    let seen = step.seen[b];
                    for (out, l) in column.iter_mut().zip(&after[a * n..(a + 1) * n]) {
                        *out += seen * l;
                    }
                }
            }
        }
        let size = step.moved.len();
        for (part, weight) in sensitivity
            .as_mut_slice()
            .chunks_exact_mut(size)
            .zip(step.weights.iter())
        {
            for (out, m) in part.iter_mut().zip(step.moved.as_slice()) {
                *out += weight * m;
            }
        }
    }
}

mod fit;
#[cfg(test)]
mod tests;

pub use fit::{TransformationAccount, TransformationFit, fit_transformation};
