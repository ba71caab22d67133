//! Normal equations of the whitened residuals of one run.

mod cascade;
mod moments;
mod plain;
mod tangents;

use crate::problem::{InitialStates, Point, Run};
use cascade::Cascade;
use moments::Moments;
use nalgebra::{DMatrix, DVector};
use tangents::Tangents;

/// Functions of poles that decay by less than this over a run look alike to it.
const SLOWEST: f64 = 0.01;

/// `J' J` and `J' r` of a run, initial states after the directions. All runs share what is kept here.
pub(crate) struct Sensitivities<'a> {
    point: &'a Point,
    directions: &'a DMatrix<f64>,
    /// Initial states that are free: all or none.
    free: usize,
    whiten: DMatrix<f64>,
    fast: Option<(Cascade, Tangents)>,
}

impl<'a> Sensitivities<'a> {
    pub(crate) fn new(
        point: &'a Point,
        directions: &'a DMatrix<f64>,
        initial: InitialStates,
    ) -> Option<Self> {
        let predictor = &point.predictor;
        let fast = || {
            let cascade = Cascade::new(&predictor.a().into_owned()).ok()?;
            let tangents = Tangents::new(&cascade, predictor)?;
            Some((cascade, tangents))
        };
        Some(Self {
            free: match initial {
                InitialStates::Estimated => predictor.states,
                InitialStates::Held => 0,
            },
            whiten: point.factor.clone().try_inverse()?,
            fast: fast(),
            point,
            directions,
        })
    }

    /// [`Self::by_moments`], or [`Self::by_simulation`] for a run with fewer samples than there are functions for all
    /// inputs: the work of the first hardly depends on the samples.
    pub(crate) fn sum(
        &self,
        run: &Run,
        initial: &DVector<f64>,
        residual: &DMatrix<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let samples = residual.ncols();
        let is_long = |cascade: &Cascade| {
            samples >= cascade.b.len() * (run.known.nrows() + 1)
                && (1.0 - cascade.radius) * samples as f64 > SLOWEST
        };
        match &self.fast {
            Some((cascade, tangents)) if is_long(cascade) => {
                self.by_moments(cascade, tangents, run, initial, residual)
            }
            _ => self.by_simulation(run, initial, residual),
        }
    }

    /// All derivatives of the outputs are sums of the responses of a few orthonormal functions to the known signals: sums
    /// over the samples of these responses' products are what `J' J` is made of. The oracle of the tests is
    /// [`Self::by_simulation`].
    fn by_moments(
        &self,
        cascade: &Cascade,
        tangents: &Tangents,
        run: &Run,
        initial: &DVector<f64>,
        residual: &DMatrix<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let moments = Moments::new(cascade, run, &(&self.whiten * residual));
        let outputs = tangents.of_outputs(&self.point.predictor, initial, self.directions, self.free);
        let columns = self.directions.ncols() + self.free;
        let (mut h, mut g) = (DMatrix::zeros(columns, columns), DVector::zeros(columns));
        for i in 0..outputs.len() {
            // The inverse of a lower triangular factor.
            let mut whitened = &outputs[0] * self.whiten[(i, 0)];
            for l in 1..=i {
                whitened += &outputs[l] * self.whiten[(i, l)];
            }
            h.gemm(1.0, &whitened.transpose(), &(&moments.gram * &whitened), 1.0);
            g.gemv_tr(1.0, &whitened, &moments.residuals.column(i), 1.0);
        }
        // Rounding must not leave it unsymmetric.
        let h = (&h + h.transpose()) * 0.5;
        (h, g)
    }
}

#[cfg(test)]
mod tests;
