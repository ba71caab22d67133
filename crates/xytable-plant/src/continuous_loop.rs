//! The continuous closed loop at constant p: the controller never stops, only r and v are held between samples.

use crate::controller::{closed_loop_matrix, diagonal};
use crate::digital_loop::ExperimentSignals;
use crate::{PlantError, VerifiedController};
use lpv_core::linalg::{eigenvalues, from_blocks};
use lpv_core::{Continuous, Discrete, StateSpace};
use nalgebra::{DMatrix, DVector, Vector2};

/// The loop from `w = r - v` (held) to the outputs and inputs at the sample instants; exact by one exponential.
pub(crate) struct ContinuousLoop {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    /// `y'` from the state.
    c: DMatrix<f64>,
    /// `u'` from the state and from `w`.
    f: DMatrix<f64>,
    g: DMatrix<f64>,
}

impl ContinuousLoop {
    pub(crate) fn new(
        plant: &StateSpace<Continuous>,
        controller: &VerifiedController,
        clock: Discrete,
        position: f64,
    ) -> Result<Self, PlantError> {
        let k = diagonal(controller.continuous())?;
        let a = closed_loop_matrix(plant, &k)?;
        let b = from_blocks(&[&[&(plant.b() * k.d())], &[k.b()]])?;
        let c = from_blocks(&[&[plant.c(), &DMatrix::zeros(2, k.states())]])?;
        let held = StateSpace::new(a, b, c, DMatrix::zeros(2, 2), Continuous)?.zero_order_hold(clock)?;
        // The sampled loop was verified, this one was not.
        let spectral_radius = eigenvalues(held.a())?
            .iter()
            .map(|z| z.norm())
            .fold(0.0, f64::max);
        if spectral_radius >= 1.0 {
            return Err(PlantError::NotStable {
                position,
                spectral_radius,
            });
        }
        Ok(Self {
            a: held.a().clone(),
            b: held.b().clone(),
            c: held.c().clone(),
            f: from_blocks(&[&[&(-k.d() * plant.c()), k.c()]])?,
            g: k.d().clone(),
        })
    }

    /// The state at rest.
    pub(crate) fn rest(&self) -> DVector<f64> {
        DVector::zeros(self.a.nrows())
    }

    /// Advances one experiment over one period; the signals are used as by the digital loop.
    pub(crate) fn run(&self, x: &mut DVector<f64>, signals: &mut ExperimentSignals<'_>) {
        let mut next = x.clone();
        for k in 0..signals.references[0].len() {
            let noise = Vector2::new(signals.outputs[0][k], signals.outputs[1][k]);
            let r = Vector2::new(signals.references[0][k], signals.references[1][k]);
            let w = r - noise;
            let measured = &self.c * &*x + noise;
            let u = &self.f * &*x + &self.g * w;
            for i in 0..2 {
                signals.outputs[i][k] = measured[i];
                signals.inputs[i][k] = u[i];
            }
            next.gemv(1.0, &self.a, x, 0.0);
            next.gemv(1.0, &self.b, &w, 1.0);
            std::mem::swap(x, &mut next);
        }
    }
}
