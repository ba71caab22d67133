//! Levenberg-Marquardt on a residual of moderate size.

use super::{in_coordinates, squares};
use lpv_numerics::least_squares::{
    AfterDescent, AfterRefusal, Damping, Quadratic, Search, StopReason, Trial, minimise,
};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// Where it ended.
pub(crate) struct Minimum {
    pub(crate) at: Vec<f64>,
    /// Sum of squares of the residual.
    pub(crate) cost: f64,
    /// Rows of the residual.
    pub(crate) rows: usize,
    /// Upper triangle with `R^T R = J^T J`.
    pub(crate) factor: DMatrix<f64>,
}

/// Minimises the squares of a residual, with forward differences; steps are at most one in every coordinate that is a logarithm,
/// the others have units. None where the start or one of its neighbours has no residual.
pub(crate) fn minimum(
    at: Vec<f64>,
    logarithms: &[bool],
    iterations: usize,
    residual: impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<Minimum> {
    let error = residual(&at)?;
    let mut descent = Descent {
        residual,
        logarithms,
        iterations,
    };
    let found = minimise(&mut descent, (at, error), &DAMPING).ok()?;
    Some(Minimum {
        cost: squares(&found.point.1),
        at: found.point.0,
        rows: found.point.1.len(),
        factor: in_coordinates(&found.linear?),
    })
}

const DAMPING: Damping = Damping {
    start: 1e-3,
    least: 1e-9,
    most: f64::INFINITY,
    attempts: 8,
    after_descent: AfterDescent::Divide(10.0),
    after_refusal: AfterRefusal::Multiply(10.0),
};

/// Part of the cost that counts as no decrease.
const SETTLED: f64 = 1e-5;

struct Descent<'a, F> {
    residual: F,
    logarithms: &'a [bool],
    iterations: usize,
}

/// A neighbour has no residual.
struct NoNeighbour;

impl<F: Fn(&[f64]) -> Option<Vec<f64>>> Search for Descent<'_, F> {
    /// Coordinates and residual.
    type Point = (Vec<f64>, Vec<f64>);
    type Linear = Quadratic;
    type Error = NoNeighbour;

    fn cost(&self, point: &Self::Point) -> f64 {
        squares(&point.1)
    }

    fn ended(&mut self, _: &Self::Point, history: &[f64], _: &mut f64) -> Option<StopReason> {
        let [.., before, now] = history else {
            return None;
        };
        if before - now < SETTLED * now {
            return Some(StopReason::CostSettled);
        }
        (history.len() > self.iterations + 1).then_some(StopReason::IterationLimit)
    }

    fn linearise(
        &mut self,
        (at, error): &mut Self::Point,
    ) -> Result<ControlFlow<StopReason, Quadratic>, NoNeighbour> {
        let mut jacobian = DMatrix::zeros(error.len(), at.len());
        for j in 0..at.len() {
            let found = difference(at, j, self.logarithms, error, &self.residual);
            let (step, moved) = found.ok_or(NoNeighbour)?;
            let column = moved.iter().zip(error.iter()).map(|(a, b)| (a - b) / step);
            jacobian.set_column(j, &DVector::from_iterator(error.len(), column));
        }
        let residual = DVector::from_column_slice(error);
        let none = DMatrix::zeros(at.len(), 0);
        Ok(ControlFlow::Continue(Quadratic::new(&jacobian, &residual, &none)))
    }

    fn trial(&mut self, (at, _): &Self::Point, near: &Quadratic, damping: f64) -> Trial<Self::Point> {
        let Some(step) = near.step(damping) else {
            return Trial::Refused;
        };
        let change = &near.map * &step.y;
        let there: Vec<f64> = at
            .iter()
            .zip(change.iter())
            .zip(self.logarithms)
            .map(|((a, s), log)| a + if *log { s.clamp(-1.0, 1.0) } else { *s })
            .collect();
        (self.residual)(&there).map_or(Trial::Refused, |error| Trial::To {
            point: (there, error),
            predicted: step.predicted,
        })
    }
}

/// A step of one coordinate that moves the residual a little, and the residual there.
fn difference(
    at: &[f64],
    j: usize,
    logarithms: &[bool],
    error: &[f64],
    residual: &impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<(f64, Vec<f64>)> {
    /// Of the coordinate.
    const PART: f64 = 1e-6;
    /// Of the residual, which a step from zero moves by so much at least.
    const SEEN: f64 = 1e-7;
    /// The first step from zero, in any unit, and the growth of the next ones.
    const NEXT: (f64, f64) = (1e-40, 1e3);
    let moved = |step: f64| {
        let mut there = at.to_vec();
        there[j] += step;
        residual(&there)
    };
    if logarithms.get(j) == Some(&true) || at[j] != 0.0 {
        let step = if logarithms.get(j) == Some(&true) {
            PART
        } else {
            PART * at[j].abs()
        };
        return Some((step, moved(step)?));
    }
    let least = SEEN * SEEN * squares(error);
    let mut step = NEXT.0;
    let mut last = (step, moved(step)?);
    loop {
        let Some(there) = moved(step) else {
            return Some(last);
        };
        let by: f64 = there.iter().zip(error).map(|(a, b)| (a - b).powi(2)).sum();
        if by > least || step > NEXT.0.recip() {
            return Some((step, there));
        }
        last = (step, there);
        step *= NEXT.1;
    }
}
