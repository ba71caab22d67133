//! The interpolation chosen by leave-one-out.

use crate::interpolation::terms;
use crate::regression::LocalFits;
use crate::{IdentError, Interpolation};
use lpv_core::Position;
use nalgebra::DVector;
use rayon::prelude::*;

/// What leaving out each inner position in turn says of one interpolation.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// The interpolation.
    pub interpolation: Interpolation,
    /// Increase of the weighted sum of squares at the positions left out, per real equation: with covariance weights, 1
    /// says that the interpolation adds as much error as the noise.
    pub cost: f64,
    /// The largest of the single positions' increases, per equation, and where.
    pub worst: (f64, Position),
}

impl LocalFits {
    /// Leaves out every position that is not the only one at an end of the range, predicts its coefficients from the others, and counts the
    /// misfit in the metric of the regression. Candidates that the positions cannot carry are left out of the table.
    ///
    /// # Errors
    /// [`IdentError::TooFewPositions`] if there are fewer than four positions.
    pub fn leave_one_out(&self, candidates: &[Interpolation]) -> Result<Vec<LeaveOneOut>, IdentError> {
        let positions = self.positions();
        let n = positions.len();
        if n < 4 {
            return Err(IdentError::TooFewPositions {
                what: "leave-one-out",
                needed: 4,
                found: n,
            });
        }
        let others = |left_out: usize| (0..n).filter(move |&q| q != left_out);
        let inner = inner(&positions);
        let entries: Vec<Option<LeaveOneOut>> = candidates
            .par_iter()
            .map(|&interpolation| {
                let mut total = 0.0;
                let mut equations = 0.0;
                let mut worst = (0.0, positions[0].clone());
                for &left_out in &inner {
                    let kept: Vec<Position> = others(left_out).map(|q| positions[q].clone()).collect();
                    let operator = interpolation.operator(&kept).ok()?;
                    let cardinals = operator.cardinals(&positions[left_out]);
                    let fit = &self.fits[left_out];
                    let others = others(left_out).map(|q| self.stacked(q));
                    let predicted = cardinals
                        .iter()
                        .zip(others)
                        .fold(-self.stacked(left_out), |s, (&l, w)| s + w * l);
                    let increase = (&fit.r11 * predicted).norm_squared();
                    total += increase;
                    equations += fit.equations as f64;
                    if increase / fit.equations as f64 > worst.0 {
                        worst = (increase / fit.equations as f64, fit.position.clone());
                    }
                }
                Some(LeaveOneOut {
                    interpolation,
                    cost: total / equations,
                    worst,
                })
            })
            .collect();
        Ok(entries.into_iter().flatten().collect())
    }

    /// The coefficients at one position in the order of the regression's unknowns.
    fn stacked(&self, position: usize) -> DVector<f64> {
        let (ny, nu, ng) = (self.outputs, self.inputs, self.functions());
        let w = &self.fits[position].weights;
        DVector::from_fn(ny * nu * ng, |k, _| {
            let (i, ab) = (k % ng, k / ng);
            w[(ab % ny, i * nu + ab / ny)]
        })
    }

    /// The candidates worth trying at these positions: of several scheduling signals polynomials, of one polynomials and Chebyshev
    /// interpolants of every order up to `most`, spline, lines, Gaussian processes with lengths of one to sixteen grid spacings.
    pub fn candidates(&self, most: usize) -> Vec<Interpolation> {
        let positions = self.positions();
        let n = positions.len();
        let (Some(first), Some(last)) = (positions.first(), positions.last()) else {
            return Vec::new();
        };
        let fewer = |order: &usize| terms(first.len(), *order) < n;
        let polynomials = (0..=most)
            .take_while(fewer)
            .map(|order| Interpolation::Polynomial { order });
        let (Some(first), Some(last)) = (first.single(), last.single()) else {
            return polynomials.collect();
        };
        let spacing = (last - first) / (n.max(2) - 1) as f64;
        let chebyshev = (2..=most.max(2)).map(|order| Interpolation::Chebyshev { order });
        let processes = [1.0, 2.0, 4.0, 8.0, 16.0]
            .into_iter()
            .map(|k| Interpolation::GaussianProcess {
                length_scale: k * spacing,
            });
        polynomials
            .chain(chebyshev)
            .chain([Interpolation::Spline, Interpolation::Linear])
            .chain(processes)
            .collect()
    }
}

/// The positions that are not alone at an end of the range of a scheduling signal.
fn inner(positions: &[Position]) -> Vec<usize> {
    let within = |q: &usize| {
        (0..positions[*q].len()).all(|i| {
            let own = positions[*q][i];
            let mut others = positions.iter().enumerate().filter(|(k, _)| k != q);
            let (mut below, mut above) = (false, false);
            others.any(|(_, other)| {
                below |= other[i] <= own;
                above |= other[i] >= own;
                below && above
            })
        })
    };
    (0..positions.len()).filter(within).collect()
}

/// The entry to recommend: the smallest leave-one-out cost; among those within `slack` of it (a factor, at least one),
/// the first in the order of the table, which stands simple ones first.
pub fn recommend(table: &[LeaveOneOut], slack: f64) -> Option<&LeaveOneOut> {
    let best = table
        .iter()
        .map(|e| e.cost)
        .filter(|c| c.is_finite())
        .fold(f64::INFINITY, f64::min);
    table.iter().find(|e| e.cost <= best * slack.max(1.0))
}
