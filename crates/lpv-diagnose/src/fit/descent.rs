//! The search for the parameters of the machine and of its effects.

use super::{Explained, Fitted, Grain, Problem, in_coordinates};
use crate::TraceError;
use lpv_numerics::least_squares::{
    AfterDescent, AfterRefusal, Damping, Quadratic, Search, StopReason, Trial, minimise,
};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

const DAMPING: Damping = Damping {
    start: 1e-4,
    least: 1e-9,
    most: f64::INFINITY,
    attempts: 6,
    after_descent: AfterDescent::Divide(10.0),
    after_refusal: AfterRefusal::Multiply(10.0),
};

/// Largest change of a logarithm in one step.
const MOST_STEP: f64 = 2.0;

/// Decrease of the objective that counts as none.
const SETTLED: f64 = 0.3;

/// Iterations that tell how fast a fit goes on.
const PACE: usize = 6;

impl Problem<'_> {
    /// Levenberg-Marquardt from a model. The machine's columns that are `known` from a neighbouring model serve for
    /// the first step.
    ///
    /// # Errors
    /// [`TraceError::Diverges`] if the start has no response.
    pub(crate) fn fit(
        &self,
        start: &Explained,
        iterations: usize,
        known: Option<&Fitted>,
    ) -> Result<Fitted, TraceError> {
        self.fit_towards(f64::INFINITY, start, iterations, known)
    }

    /// The same, which ends where it would not reach an objective in the iterations left at the pace of the last ones.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub(crate) fn fit_towards(
        &self,
        goal: f64,
        start: &Explained,
        iterations: usize,
        known: Option<&Fitted>,
    ) -> Result<Fitted, TraceError> {
        let own = start.base.coordinates().len();
        let mut descent = Descent {
            problem: self,
            iterations,
            goal,
            own,
            bounded: start.bounded(),
            steps: known.map_or(Vec::new(), |k| k.steps[..own].to_vec()),
            columns: known.map(|k| {
                let mut columns = k.columns().into_owned();
                self.weigh_columns(&mut columns, k.scale.recip());
                columns
            }),
            fresh: false,
        };
        let residual = self.residual(start).ok_or_else(|| self.diverges())?;
        let start = Point {
            objective: self.objective(&residual),
            model: start.clone(),
            residual,
        };
        let found = minimise(&mut descent, start, &DAMPING)?;
        let Linearised {
            quadratic,
            jacobian,
            scale,
            excess,
        } = found.linear.ok_or_else(|| self.diverges())?;
        let mut residual = found.point.residual;
        self.weigh(&mut residual, scale);
        Ok(Fitted {
            model: found.point.model,
            objective: found.point.objective,
            excess,
            scale,
            residual,
            factor: in_coordinates(&quadratic),
            jacobian,
            steps: descent.steps,
        })
    }

    fn diverges(&self) -> TraceError {
        TraceError::Diverges {
            record: self.tracks.first().map_or(String::new(), |t| t.name.clone()),
        }
    }
}

/// A fit on its way.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    iterations: usize,
    goal: f64,
    /// Coordinates of the machine, which come before those of the effects.
    own: usize,
    bounded: Vec<bool>,
    steps: Vec<f64>,
    /// Columns of the machine from a neighbouring model, for the next step.
    columns: Option<DMatrix<f64>>,
    /// Whether the last columns of the machine were those of the point.
    fresh: bool,
}

struct Point {
    model: Explained,
    residual: Vec<f64>,
    objective: f64,
}

struct Linearised {
    quadratic: Quadratic,
    /// Of all coordinates, the rows of the prior with their factor.
    jacobian: DMatrix<f64>,
    scale: f64,
    excess: f64,
}

impl Search for Descent<'_> {
    type Point = Point;
    type Linear = Linearised;
    type Error = TraceError;

    fn cost(&self, point: &Point) -> f64 {
        point.objective
    }

    fn ended(&mut self, point: &Point, history: &[f64], damping: &mut f64) -> Option<StopReason> {
        let [.., before, now] = history else {
            return None;
        };
        let left = (self.iterations + 1).saturating_sub(history.len());
        if left == 0 || is_out_of_reach(self.goal, history, left) {
            return Some(StopReason::IterationLimit);
        }
        if before - now < SETTLED {
            if self.fresh || self.own == point.model.coordinates().len() {
                return Some(StopReason::CostSettled);
            }
            *damping = DAMPING.start;
        }
        self.fresh = false;
        None
    }

    fn linearise(&mut self, point: &mut Point) -> Result<ControlFlow<StopReason, Linearised>, TraceError> {
        let (problem, own) = (self.problem, self.own);
        let (model, residual) = (&point.model, &point.residual);
        let all = model.coordinates().len();
        let diverges = || problem.diverges();
        let columns = match self.columns.take() {
            Some(columns) => columns,
            None => {
                self.fresh = true;
                let rough = problem.rough(model).ok_or_else(diverges)?;
                problem
                    .columns(model, (Grain::Rough, &rough), 0..own, &mut self.steps)
                    .ok_or_else(diverges)?
            }
        };
        let more = problem
            .columns(model, (Grain::Fine, residual), own..all, &mut self.steps)
            .ok_or_else(diverges)?;
        let mut jacobian = DMatrix::zeros(residual.len(), all);
        jacobian.columns_mut(0, own).copy_from(&columns);
        jacobian.columns_mut(own, all - own).copy_from(&more);
        let (excess, scale) = (problem.excess(residual), problem.scale(residual));
        problem.weigh_columns(&mut jacobian, scale);
        let mut weighed = DVector::from_column_slice(residual);
        problem.weigh(weighed.as_mut_slice(), scale);
        Ok(ControlFlow::Continue(Linearised {
            quadratic: Quadratic::new(&jacobian, &weighed, &DMatrix::zeros(all, 0)),
            jacobian,
            scale,
            excess,
        }))
    }

    fn trial(&mut self, point: &Point, linear: &Linearised, damping: f64) -> Trial<Point> {
        if self.iterations == 0 {
            return Trial::Stop(StopReason::IterationLimit);
        }
        let Some(step) = linear.quadratic.step(damping) else {
            return Trial::Refused;
        };
        let change = &linear.quadratic.map * &step.y;
        let bounded = |(s, bounded): (&f64, &bool)| match bounded {
            true => s.clamp(-MOST_STEP, MOST_STEP),
            false => *s,
        };
        let change = change.iter().zip(&self.bounded).map(bounded);
        let there: Vec<f64> = point
            .model
            .coordinates()
            .iter()
            .zip(change)
            .map(|(a, b)| a + b)
            .collect();
        let model = point.model.with(&there);
        self.problem
            .residual(&model)
            .map_or(Trial::Refused, |residual| Trial::To {
                point: Point {
                    objective: self.problem.objective(&residual),
                    model,
                    residual,
                },
                predicted: step.predicted,
            })
    }

    /// Columns of a neighbour may be the reason.
    fn stuck(&mut self) -> Option<StopReason> {
        None
    }
}

/// Whether an objective lies below the last one of a history by more than the iterations left take at the pace of the last ones.
fn is_out_of_reach(goal: f64, history: &[f64], left: usize) -> bool {
    let [.., now] = history else { return false };
    let earlier = history.iter().rev().nth(PACE);
    earlier.is_some_and(|earlier| now - goal > (earlier - now) / PACE as f64 * left as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A fit that falls by the same in every iteration reaches what lies above the line and nothing below it, in any unit; before it has a pace,
        /// it may reach all.
        #[test]
        fn an_even_fall_reaches_what_its_line_does(
            (start, exponent) in (-1e6..1e6_f64, -6.0..6.0_f64),
            (done, left) in (0_usize..30, 1_usize..40),
            part in 0.01..3.0_f64,
        ) {
            let fall = 10.0_f64.powf(exponent);
            let start = start * fall;
            let history: Vec<f64> = (0..=done).map(|k| start - k as f64 * fall).collect();
            let goal = history[done] - part * left as f64 * fall;
            prop_assume!((part - 1.0).abs() > 1e-3);
            prop_assert_eq!(is_out_of_reach(goal, &history, left), done >= PACE && part > 1.0);
            prop_assert!(!is_out_of_reach(f64::INFINITY, &history, left));
        }
    }
}
