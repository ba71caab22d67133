//! Levenberg-Marquardt on poles and factors together, by normal equations over blocks of lines.

use crate::ModalFitError;
use crate::model::{Modal, Parameter};
use crate::whiten::Factors;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};
use lpv_core::num_complex::Complex;
use lpv_core::{CoreError, Discrete, Frf};
use lpv_numerics::least_squares::{AfterDescent, AfterRefusal, Damping, Search, StopReason, Trial};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use std::ops::ControlFlow;

type C64 = Complex<f64>;

pub(crate) const DAMPING: Damping = Damping {
    start: 1e-4,
    least: 1e-12,
    most: 1e8,
    attempts: 12,
    after_descent: AfterDescent::Divide(10.0),
    after_refusal: AfterRefusal::Multiply(10.0),
};

/// A decrease of the sum of squares below this is none: a tenth of what one standard deviation of one parameter is worth.
const SETTLED: f64 = 0.1;

/// Lines of one product.
const BLOCK: usize = 8;

/// Parts of the lines that threads take: fixed, so that their number changes no bit.
const PARTS: usize = 8;

pub(crate) struct Point {
    pub(crate) modal: Modal,
    pub(crate) cost: f64,
}

pub(crate) struct Descent<'a> {
    pub(crate) z: Vec<C64>,
    pub(crate) factors: Vec<Factors>,
    pub(crate) frf: &'a Frf,
    pub(crate) clock: Discrete,
    pub(crate) most: usize,
}

/// Normal equations `J^T J`, `J^T r`.
pub(crate) struct Normal {
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
}

impl Descent<'_> {
    pub(crate) fn equations(&self) -> usize {
        2 * self.z.len() * self.frf.outputs() * self.frf.inputs()
    }

    fn residual(&self, modal: &Modal, k: usize) -> DMatrix<C64> {
        let own = &self.factors[k];
        &own.left * (modal.response(self.z[k], self.clock) - self.frf.line(k)) * &own.right
    }

    /// None where it has no finite cost, or a pole has left the upper half.
    pub(crate) fn point(&self, modal: Modal) -> Option<Point> {
        let costs: Vec<f64> = (0..self.z.len())
            .into_par_iter()
            .map(|k| self.residual(&modal, k).norm_squared())
            .collect();
        let cost: f64 = costs.iter().sum();
        let whole = modal.sections.iter().all(|s| s.pole.im >= 0.0);
        (cost.is_finite() && whole).then_some(Point { modal, cost })
    }

    pub(crate) fn normal(&self, modal: &Modal, parameters: &[Parameter]) -> Normal {
        let part = self.z.len().div_ceil(PARTS).max(1);
        let starts: Vec<usize> = (0..self.z.len()).step_by(part).collect();
        let sums: Vec<DMatrix<f64>> = starts
            .into_par_iter()
            .map(|from| self.products(modal, parameters, from..(from + part).min(self.z.len())))
            .collect();
        let n = parameters.len();
        let mut sum = DMatrix::zeros(n + 1, n + 1);
        for part in sums {
            sum += part;
        }
        sum.fill_upper_triangle_with_lower_triangle();
        Normal {
            parameters: parameters.to_vec(),
            gradient: sum.view((0, n), (n, 1)).column(0).into_owned(),
            matrix: sum.view((0, 0), (n, n)).into_owned(),
        }
    }

    /// Lower triangle of `[J, r]^T [J, r]` over some lines.
    fn products(
        &self,
        modal: &Modal,
        parameters: &[Parameter],
        lines: std::ops::Range<usize>,
    ) -> DMatrix<f64> {
        let (n, size) = (parameters.len(), self.frf.outputs() * self.frf.inputs());
        let mut sum = DMatrix::zeros(n + 1, n + 1);
        let mut derivatives = vec![C64::from(0.0); n * size];
        let rows = 2 * size * BLOCK;
        let mut block = DMatrix::<f64>::zeros(rows, n + 1);
        for first in lines.clone().step_by(BLOCK) {
            let count = BLOCK.min(lines.end - first);
            if count < BLOCK {
                block.fill(0.0);
            }
            for (at, k) in (first..first + count).enumerate() {
                let own = &self.factors[k];
                modal.derivatives(
                    parameters,
                    self.z[k],
                    self.clock,
                    (&own.left, &own.right),
                    &mut derivatives,
                );
                let residual = self.residual(modal, k);
                let all = derivatives
                    .chunks_exact(size)
                    .chain(std::iter::once(residual.as_slice()));
                for (values, mut column) in all.zip(block.column_iter_mut()) {
                    for (i, v) in values.iter().enumerate() {
                        column[(at * size + i) * 2] = v.re;
                        column[(at * size + i) * 2 + 1] = v.im;
                    }
                }
            }
            let tall = MatRef::from_column_major_slice(block.as_slice(), rows, n + 1);
            matmul(
                MatMut::from_column_major_slice_mut(sum.as_mut_slice(), n + 1, n + 1),
                BlockStructure::TriangularLower,
                Accum::Add,
                tall.transpose(),
                BlockStructure::Rectangular,
                tall,
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
        }
        sum
    }
}

impl Normal {
    fn scale(&self) -> DVector<f64> {
        self.matrix
            .diagonal()
            .map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 })
    }

    fn scaled(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let scale = self.scale();
        let mut m = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            self.matrix[(i, j)] * scale[i] * scale[j]
        });
        for i in 0..scale.len() {
            m[(i, i)] += damping;
        }
        (m, scale)
    }

    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let (m, scale) = self.scaled(damping);
        let right = -self.gradient.component_mul(&scale);
        let step = Cholesky::new(m)?.solve(&right).component_mul(&scale);
        step.iter()
            .all(|v| v.is_finite())
            .then(|| step.as_slice().to_vec())
    }

    /// Covariance of the parameters: the residual has variance one in real and imaginary parts.
    pub(crate) fn inverse(&self) -> Result<DMatrix<f64>, ModalFitError> {
        let (m, scale) = self.scaled(1e-13);
        let factor = Cholesky::new(m).ok_or(CoreError::Singular {
            operation: "the covariance of the modes",
        })?;
        let mut inverse = factor.inverse();
        for j in 0..scale.len() {
            for i in 0..scale.len() {
                inverse[(i, j)] *= scale[i] * scale[j];
            }
        }
        Ok(inverse)
    }
}

impl Search for Descent<'_> {
    type Point = Point;
    type Linear = Normal;
    type Error = ModalFitError;

    fn cost(&self, point: &Point) -> f64 {
        point.cost
    }

    fn ended(&mut self, point: &Point, history: &[f64], _damping: &mut f64) -> Option<StopReason> {
        let iterations = history.len() - 1;
        // Noise-free data end far below one deviation: there the relative decrease counts.
        let enough = |before: f64, after: f64| {
            let noise = after > 0.01 * self.equations() as f64;
            before - after < if noise { SETTLED } else { 1e-3 * after }
        };
        let last = iterations.checked_sub(1).map(|i| history[i]);
        if last.is_some_and(|before| enough(before, point.cost)) {
            return Some(StopReason::CostSettled);
        }
        (iterations >= self.most).then_some(StopReason::IterationLimit)
    }

    fn linearise(&mut self, point: &mut Point) -> Result<ControlFlow<StopReason, Normal>, ModalFitError> {
        let parameters = point.modal.parameters();
        Ok(ControlFlow::Continue(self.normal(&point.modal, &parameters)))
    }

    fn trial(&mut self, point: &Point, linear: &Normal, damping: f64) -> Trial<Point> {
        let Some(step) = linear.step(damping) else {
            return Trial::Refused;
        };
        match self.point(point.modal.moved(&linear.parameters, &step)) {
            Some(point) => Trial::To {
                point,
                predicted: 0.0,
            },
            None => Trial::Refused,
        }
    }
}
