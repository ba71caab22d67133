//! The scheduling space: a box in R^np.

use crate::CoreError;
use serde::{Deserialize, Serialize};

/// The box `lower_i <= p_i <= upper_i` that a model is made for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Bounds", into = "Bounds")]
pub struct SchedulingRange {
    bounds: Vec<[f64; 2]>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
struct Bounds(Vec<[f64; 2]>);

impl SchedulingRange {
    /// One `[lower, upper]` a parameter.
    ///
    /// # Errors
    /// [`CoreError::EmptyRange`] unless all bounds are finite and lower < upper by more than rounding (`1e-12` of the
    /// larger bound).
    pub fn new(bounds: Vec<[f64; 2]>) -> Result<Self, CoreError> {
        for (parameter, &[lower, upper]) in bounds.iter().enumerate() {
            let (width, largest) = (upper - lower, lower.abs().max(upper.abs()));
            if !(width.is_normal() && width > 1e-12 * largest && (0.5 * width).is_normal()) {
                return Err(CoreError::EmptyRange {
                    parameter,
                    lower,
                    upper,
                });
            }
        }
        Ok(Self { bounds })
    }

    /// One parameter.
    ///
    /// # Errors
    /// As [`SchedulingRange::new`].
    pub fn interval(lower: f64, upper: f64) -> Result<Self, CoreError> {
        Self::new(vec![[lower, upper]])
    }

    /// `[lower, upper]` of each parameter.
    pub fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }
    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.bounds.len()
    }
    /// Middle of the box.
    pub fn centre(&self) -> Vec<f64> {
        self.bounds.iter().map(|&b| middle(b)).collect()
    }
    /// Half the width of the box along each parameter.
    pub fn half_width(&self) -> Vec<f64> {
        self.bounds.iter().map(|[l, u]| 0.5 * (u - l)).collect()
    }

    /// Equidistant grid with `points` values along each parameter (at least two), corners included; the first
    /// parameter varies fastest.
    pub fn grid(&self, points: usize) -> Vec<Vec<f64>> {
        let points = points.max(2);
        let at = |[l, u]: [f64; 2], i: usize| l + (u - l) * i as f64 / (points - 1) as f64;
        self.bounds.iter().fold(vec![Vec::new()], |grid, &bound| {
            (0..points)
                .flat_map(|i| grid.iter().map(move |g| [g.as_slice(), &[at(bound, i)]].concat()))
                .collect()
        })
    }

    /// Refuses what is not inside, up to what a sensor of the scheduling scatters (a thousandth of the width): records at the ends of the range
    /// that they tell lie on both sides of it.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::OutsideRange`]; NaN is outside.
    pub fn check(&self, p: &[f64]) -> Result<(), CoreError> {
        crate::linalg::dimension("scheduling: number of parameters", self.parameters(), p.len())?;
        for (parameter, (&value, &[lower, upper])) in p.iter().zip(&self.bounds).enumerate() {
            let slack = 1e-3 * (upper - lower);
            if !(value >= lower - slack && value <= upper + slack) {
                return Err(CoreError::OutsideRange {
                    parameter,
                    value,
                    lower,
                    upper,
                });
            }
        }
        Ok(())
    }

    /// `(p - centre) / half_width`, one value a parameter, in `[-1, 1]` inside the box.
    pub fn normalise(&self, p: &[f64]) -> Vec<f64> {
        p.iter()
            .zip(&self.bounds)
            .map(|(&v, &[l, u])| (v - middle([l, u])) / (0.5 * (u - l)))
            .collect()
    }
}

/// Halved before they are added, so that large bounds do not overflow.
fn middle([lower, upper]: [f64; 2]) -> f64 {
    0.5 * lower + 0.5 * upper
}

impl TryFrom<Bounds> for SchedulingRange {
    type Error = CoreError;
    fn try_from(Bounds(bounds): Bounds) -> Result<Self, CoreError> {
        Self::new(bounds)
    }
}

impl From<SchedulingRange> for Bounds {
    fn from(range: SchedulingRange) -> Self {
        Self(range.bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::SchedulingRange;

    /// Ranges over six decades, and far from zero: half a thousandth of the width is the scatter of a sensor, two are not.
    #[test]
    fn what_a_sensor_scatters_is_inside() {
        for (low, width) in [(0.0, 1e-3), (-0.1, 0.3), (1e3, 5.0), (-2.0, 1e3)] {
            let range = SchedulingRange::interval(low, low + width).unwrap();
            for (part, is_inside) in [(5e-4, true), (2e-3, false)] {
                for p in [low - part * width, low + (1.0 + part) * width] {
                    assert_eq!(range.check(&[p]).is_ok(), is_inside, "{p} of {range:?}");
                }
            }
        }
    }
}
