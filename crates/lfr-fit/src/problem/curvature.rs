//! How the residuals bend along a step.

use super::{C64, Linear, Problem};
use crate::frozen::{Closure, close};
use crate::lines::{Chunk, residuals};
use crate::sampling::Sampling;
use crate::sampling::hold::Derivative;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Part of a step over which second differences are taken.
const PART: f64 = 0.1;

impl<K: Sampling> Problem<'_, K> {
    /// `J^T r''`, r'' the second derivative of the residuals along `direction`, by central differences. `linear`: the
    /// linearisation at `theta`. None where a response does not exist on the way.
    pub(crate) fn curvature(
        &self,
        theta: &DVector<f64>,
        linear: &Linear,
        direction: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let at = |part: f64| self.matrix(&(theta + direction * part));
        let (before, after) = (at(-PART), at(PART));
        let parts: Vec<Option<DVector<f64>>> = (0..self.deltas.len())
            .into_par_iter()
            .map(|i| {
                let there = |m: &DMatrix<f64>| {
                    let frozen = close(m, self.shape, &self.deltas[i], Closure::Value)?;
                    let sampled = self.sample(&frozen.s, Derivative::Skip)?;
                    residuals(&sampled.s, self.shape, &self.data.positions()[i], &self.values[i])
                };
                let (minus, plus) = (there(&before)?, there(&after)?);
                self.against(linear.chains.get(i)?, i, &minus, &plus)
            })
            .collect();
        let parts = parts.into_iter().collect::<Option<Vec<_>>>()?;
        Some(
            parts
                .into_iter()
                .fold(DVector::zeros(self.free.len()), |sum, part| sum + part),
        )
    }

    /// The part of one position, from its residuals on both sides.
    fn against(
        &self,
        (sampled, chain): &(DMatrix<f64>, DMatrix<f64>),
        i: usize,
        minus: &[C64],
        plus: &[C64],
    ) -> Option<DVector<f64>> {
        let (position, size) = (&self.data.positions()[i], self.shape.outputs * self.shape.inputs);
        let (values, emphasis) = (&self.values[i], &self.emphasis[i]);
        let mut on_active = DVector::zeros(self.reach.active.len());
        for first in (0..position.frf.len()).step_by(LINES) {
            let range = first..(first + LINES).min(position.frf.len());
            let n = range.len();
            let chunk = Chunk::new(sampled, self.shape, position, (values, emphasis), range.clone())?;
            let mut second = chunk.residual();
            for (channel, rows) in second.as_mut_slice().chunks_exact_mut(2 * n).enumerate() {
                for (at, k) in range.clone().enumerate() {
                    let sum = (minus[k * size + channel] + plus[k * size + channel]) * emphasis[k];
                    rows[at] = (sum.re - 2.0 * rows[at]) / (PART * PART);
                    rows[n + at] = (sum.im - 2.0 * rows[n + at]) / (PART * PART);
                }
            }
            on_active += chunk.jacobian(&self.reach.active).tr_mul(&second);
        }
        Some(chain.tr_mul(&on_active))
    }
}

/// Lines of one block.
const LINES: usize = 256;
