//! Nonlinear least squares: the search of Levenberg and Marquardt and its damped step.
//!
//! [`minimise`] drives every search of the identification: it holds the damping and the account of a search. What a point, a
//! linearisation and a trial step are, and when to end, is the problem's, by [`Search`]. [`Quadratic`] is the linearised problem of a
//! residual whose Jacobian is at hand, in the directions that no change of coordinates makes.

use crate::dense::{complement, triangle_beside, triangle_of};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The cost reached the target.
    TargetReached,
    /// What a step can still win, or what the last iterations won, is below the tolerance.
    CostSettled,
    /// The residual is rounding: noise-free data, fitted exactly.
    ResidualAtRounding,
    /// No step lowers the cost.
    NoDescent,
    /// The iterations allowed were used up.
    IterationLimit,
    /// Nothing is free.
    NothingFree,
}

/// How the damping follows the steps of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damping {
    /// Of the first step.
    pub start: f64,
    /// Below it damping is rounding.
    pub least: f64,
    /// Above it a step is rounding, and the search ends.
    pub most: f64,
    /// Steps from one point after which it ends as well.
    pub attempts: usize,
    /// After a step that lowers the cost.
    pub after_descent: AfterDescent,
    /// After one that does not.
    pub after_refusal: AfterRefusal,
}

/// Change of the damping after a step that lowers the cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AfterDescent {
    /// One over this factor.
    Divide(f64),
    /// Nielsen's rule, `1 - (2 g - 1)^3` between a fifth and two, with g the decrease over the predicted one.
    Nielsen,
}

/// Change of the damping after a step that is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AfterRefusal {
    /// This factor.
    Multiply(f64),
    /// Two, then four, then eight, as long as steps from one point are refused.
    Doubling,
}

/// A step from a point.
pub enum Trial<P> {
    /// Somewhere.
    To {
        /// Where it leads.
        point: P,
        /// Decrease of the cost that the linearisation predicts; used by [`AfterDescent::Nielsen`] alone.
        predicted: f64,
    },
    /// Nowhere: no model is there.
    Refused,
    /// No step is worth its work.
    Stop(StopReason),
}

/// A problem of nonlinear least squares.
pub trait Search {
    /// A point with its cost.
    type Point;
    /// What a step is made of.
    type Linear;
    /// Why no search is possible.
    type Error;

    /// The cost of a point.
    fn cost(&self, point: &Self::Point) -> f64;

    /// Whether the search ends before the next iteration. `history` is the cost before the first and after every iteration.
    fn ended(&mut self, point: &Self::Point, history: &[f64], damping: &mut f64) -> Option<StopReason>;

    /// The linearisation at a point, which may be written in other coordinates first.
    ///
    /// # Errors
    /// Those of the problem, which end the search without a result.
    fn linearise(
        &mut self,
        point: &mut Self::Point,
    ) -> Result<ControlFlow<StopReason, Self::Linear>, Self::Error>;

    /// The damped step.
    fn trial(&mut self, point: &Self::Point, linear: &Self::Linear, damping: f64) -> Trial<Self::Point>;

    /// Why it ends where no step lowers the cost; none to linearise anew.
    fn stuck(&mut self) -> Option<StopReason> {
        Some(StopReason::NoDescent)
    }
}

/// Where a search ended, and the work it took.
pub struct Found<P, L> {
    /// The point.
    pub point: P,
    /// Why it ended.
    pub stop: StopReason,
    /// The cost before the first and after every iteration.
    pub history: Vec<f64>,
    /// Steps tried, those refused too.
    pub trials: usize,
    /// At the end.
    pub damping: f64,
    /// At the last point that was linearised.
    pub linear: Option<L>,
}

/// Steps of Levenberg and Marquardt until the problem says that they end.
///
/// # Errors
/// Those of [`Search::linearise`].
pub fn minimise<S: Search>(
    search: &mut S,
    start: S::Point,
    rule: &Damping,
) -> Result<Found<S::Point, S::Linear>, S::Error> {
    let mut found = Found {
        history: vec![search.cost(&start)],
        point: start,
        stop: StopReason::NothingFree,
        trials: 0,
        damping: rule.start,
        linear: None,
    };
    loop {
        let iterations = found.history.len() - 1;
        if let Some(stop) = search.ended(&found.point, &found.history, &mut found.damping) {
            found.stop = stop;
            return Ok(found);
        }
        let linear = match search.linearise(&mut found.point)? {
            ControlFlow::Continue(linear) => linear,
            ControlFlow::Break(stop) => {
                found.stop = stop;
                return Ok(found);
            }
        };
        found.history[iterations] = search.cost(&found.point);
        let stop = descend(search, &mut found, &linear, rule);
        found.linear = Some(linear);
        if let Some(stop) = stop {
            found.stop = stop;
            return Ok(found);
        }
    }
}

/// One iteration: steps from a point, until one lowers the cost.
fn descend<S: Search>(
    search: &mut S,
    found: &mut Found<S::Point, S::Linear>,
    linear: &S::Linear,
    rule: &Damping,
) -> Option<StopReason> {
    let cost = search.cost(&found.point);
    let mut growth = 2.0;
    for _ in 0..rule.attempts {
        if found.damping > rule.most {
            break;
        }
        let trial = search.trial(&found.point, linear, found.damping);
        found.trials += 1;
        match trial {
            Trial::To { point, predicted } if search.cost(&point) < cost => {
                let lower = search.cost(&point);
                let factor = match rule.after_descent {
                    AfterDescent::Divide(by) => by.recip(),
                    AfterDescent::Nielsen => {
                        let gain = (cost - lower) / predicted;
                        (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 5.0, 2.0)
                    }
                };
                found.damping = (found.damping * factor).max(rule.least);
                found.history.push(lower);
                found.point = point;
                return None;
            }
            Trial::To { .. } | Trial::Refused => (),
            Trial::Stop(stop) => {
                found.trials -= 1;
                return Some(stop);
            }
        }
        found.damping *= match rule.after_refusal {
            AfterRefusal::Multiply(by) => by,
            AfterRefusal::Doubling => growth,
        };
        growth *= 2.0;
    }
    let stop = search.stuck();
    if stop.is_none() {
        found.history.push(cost);
    }
    stop
}

/// Tangents of a change of coordinates that depend on others up to this are dropped: a direction too many would be lost to the
/// search, one too few costs a direction without slope, which the damping holds.
const DEPENDENT: f64 = 1e-8;

/// The linearised problem in the coordinates that a step is taken in: `theta + map y`, residual `b + R y`.
pub struct Quadratic {
    /// `n_theta x m`: the inverse scale times an orthonormal basis of the complement of the scaled tangents.
    pub map: DMatrix<f64>,
    /// `m x m`, upper triangular.
    pub r: DMatrix<f64>,
    /// m.
    pub b: DVector<f64>,
}

impl Quadratic {
    /// Every entry is scaled to a column of length one (Marquardt). A step in the complement of the tangents, one a column, is the
    /// damped step of all entries in the limit of no damping along the tangents. The Jacobian has n_theta columns and as many rows as
    /// the residual.
    #[must_use]
    pub fn new(jacobian: &DMatrix<f64>, residual: &DVector<f64>, tangents: &DMatrix<f64>) -> Self {
        let scale = lengths(jacobian);
        let mut scaled = tangents.clone();
        for mut column in scaled.column_iter_mut() {
            column.component_mul_assign(&scale);
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
        }
        let mut map = complement(&scaled, DEPENDENT);
        for mut column in map.column_iter_mut() {
            column.component_div_assign(&scale);
        }
        let size = map.ncols();
        let factor = triangle_beside(&(jacobian * &map), residual);
        Self {
            r: factor.view((0, 0), (size, size)).into_owned(),
            b: factor.view((0, size), (size, 1)).column(0).into_owned(),
            map,
        }
    }

    /// What a full step of Gauss and Newton takes off the sum of squares, if it does what it promises.
    #[must_use]
    pub fn decrease(&self) -> f64 {
        self.b.norm_squared()
    }

    /// The minimiser of `||b + R y||^2 + damping ||y||^2`; none where it is not finite.
    #[must_use]
    pub fn step(&self, damping: f64) -> Option<DampedStep> {
        let size = self.b.len();
        let mut top = DMatrix::zeros(size, size + 1);
        top.columns_mut(0, size).copy_from(&self.r);
        top.column_mut(size).copy_from(&self.b);
        let mut bottom = DMatrix::zeros(size, size + 1);
        bottom.fill_diagonal(damping.sqrt());
        let factor = triangle_of(size + 1, [&top, &bottom].into_iter());
        let r = factor.view((0, 0), (size, size));
        let y = -r.solve_upper_triangular(&factor.view((0, size), (size, 1)).column(0))?;
        let rest = &self.b + &self.r * &y;
        y.iter().all(|v| v.is_finite()).then(|| DampedStep {
            predicted: self.b.norm_squared() - rest.norm_squared(),
            triangle: r.into_owned(),
            y,
        })
    }
}

/// Lengths of columns, one for zero.
fn lengths(m: &DMatrix<f64>) -> DVector<f64> {
    let norms = m.column_iter().map(|c| c.norm());
    DVector::from_iterator(m.ncols(), norms.map(|norm| if norm > 0.0 { norm } else { 1.0 }))
}

/// A damped step.
pub struct DampedStep {
    /// In the coordinates of the [`Quadratic`].
    pub y: DVector<f64>,
    /// The decrease of the cost, if the residuals were straight.
    pub predicted: f64,
    /// `F^T F = R^T R + damping I`.
    triangle: DMatrix<f64>,
}

impl DampedStep {
    /// What the step lacks to follow residuals that bend, `-1/2 (F^T F)^-1 c` with `c = (J map)^T r''` (Transtrum and Sethna 2012,
    /// geodesic acceleration).
    #[must_use]
    pub fn correction(&self, curvature: &DVector<f64>) -> Option<DVector<f64>> {
        let half = self.triangle.tr_solve_upper_triangular(curvature)?;
        Some(self.triangle.solve_upper_triangular(&half)? * -0.5)
    }
}

#[cfg(test)]
mod tests;
