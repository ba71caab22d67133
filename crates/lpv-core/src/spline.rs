//! The not-a-knot cubic spline through given knots, as a linear map of the knot values.

use crate::CoreError;
use nalgebra::DMatrix;

/// Knots and the map from knot values to second derivatives at the knots (de Boor, A Practical Guide to Splines, IV).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CubicSpline {
    knots: Vec<f64>,
    curvature: DMatrix<f64>,
}

impl CubicSpline {
    /// `knots`: strictly increasing, at least two. Two give a line, three a parabola.
    pub(crate) fn new(knots: &[f64]) -> Result<Self, CoreError> {
        let n = knots.len();
        let h: Vec<f64> = knots.windows(2).map(|k| k[1] - k[0]).collect();
        if let Some(i) = h.iter().position(|h| !(h * h).is_finite()) {
            return Err(CoreError::Knots {
                index: i + 1,
                problem: "too far from the knot before it",
            });
        }
        // left * curvature = right * values
        let mut left = DMatrix::<f64>::identity(n, n);
        let mut right = DMatrix::<f64>::zeros(n, n);
        for i in 1..n.saturating_sub(1) {
            left[(i, i - 1)] = h[i - 1];
            left[(i, i)] = 2.0 * (h[i - 1] + h[i]);
            left[(i, i + 1)] = h[i];
            right[(i, i - 1)] = 6.0 / h[i - 1];
            right[(i, i)] = -6.0 / h[i - 1] - 6.0 / h[i];
            right[(i, i + 1)] = 6.0 / h[i];
        }
        if n == 3 {
            // One parabola: the second derivative is constant.
            left[(0, 1)] = -1.0;
            left[(2, 1)] = -1.0;
        } else if n > 3 {
            // The third derivative is continuous at the second and the last but one knot.
            (left[(0, 0)], left[(0, 1)], left[(0, 2)]) = (h[1], -(h[0] + h[1]), h[0]);
            let (a, b) = (h[n - 3], h[n - 2]);
            (left[(n - 1, n - 3)], left[(n - 1, n - 2)], left[(n - 1, n - 1)]) = (b, -(a + b), a);
        }
        let curvature = left.lu().solve(&right).ok_or(CoreError::Knots {
            index: 0,
            problem: "the spline equations are singular; spread the knots more evenly",
        })?;
        if curvature.iter().any(|v| !v.is_finite()) {
            return Err(CoreError::Knots {
                index: 0,
                problem: "spacing of the knots overflows",
            });
        }
        Ok(Self {
            knots: knots.to_vec(),
            curvature,
        })
    }

    /// The cardinal functions at `x`: the weight of each knot value.
    pub(crate) fn cardinals_into(&self, x: f64, out: &mut Vec<f64>) {
        let i = interval(&self.knots, x);
        let h = self.knots[i + 1] - self.knots[i];
        let b = (x - self.knots[i]) / h;
        let a = 1.0 - b;
        let (ca, cb) = ((a * a * a - a) * h * h / 6.0, (b * b * b - b) * h * h / 6.0);
        out.extend(
            (0..self.knots.len()).map(|j| ca * self.curvature[(i, j)] + cb * self.curvature[(i + 1, j)]),
        );
        out[i] += a;
        out[i + 1] += b;
    }
}

/// Index of the interval of `knots` (at least two) that holds `x`, the outer ones continued.
pub(crate) fn interval(knots: &[f64], x: f64) -> usize {
    knots.partition_point(|&k| k <= x).clamp(1, knots.len() - 1) - 1
}
