//! Sensitivities by simulation, one sample after the other.

use super::Sensitivities;
use crate::problem::Run;
use nalgebra::{DMatrix, DVector};

/// Samples whose sensitivities are held at a time.
const BLOCK: usize = 64;

impl Sensitivities<'_> {
    /// Sensitivities `Z = [dx/dtheta, dx/dx_0]` follow `Z+ = A Z + dM [x; w; 1]`, and the rows of J are
    /// `C Z + dM [x; w; 1]`.
    pub(super) fn by_simulation(
        &self,
        run: &Run,
        initial: &DVector<f64>,
        residual: &DMatrix<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let predictor = &self.point.predictor;
        let (n, ny) = (predictor.states, predictor.outputs());
        let p = self.directions.ncols();
        let columns = p + self.free;
        let states = predictor.simulate(initial, &run.known).1;
        let left = predictor.matrix.columns(0, n);
        let stacked = stacked(self.directions, n + ny);
        let whitened = &self.whiten * residual;
        let mut z = DMatrix::zeros(n, columns);
        z.view_mut((0, p), (self.free, self.free)).fill_with_identity();
        let mut out = DMatrix::zeros(n + ny, columns);
        let mut h = DMatrix::zeros(columns, columns);
        let mut g = DVector::zeros(columns);
        for from in (0..residual.ncols()).step_by(BLOCK) {
            let samples = BLOCK.min(residual.ncols() - from);
            let forces = forces(&stacked, &states, &run.known, from, samples);
            let mut jacobian = DMatrix::zeros(columns, ny * samples);
            for k in 0..samples {
                out.gemm(1.0, &left, &z, 0.0);
                let force = forces.column(k);
                for (v, f) in out.as_mut_slice().iter_mut().zip(force.as_slice()) {
                    *v += f;
                }
                z.copy_from(&out.rows(0, n));
                let rows = &self.whiten * out.rows(n, ny);
                jacobian.columns_mut(ny * k, ny).copy_from(&rows.transpose());
            }
            let r = whitened.columns(from, samples);
            g.gemv(
                1.0,
                &jacobian,
                &DVector::from_iterator(ny * samples, r.iter().copied()),
                1.0,
            );
            h.gemm(1.0, &jacobian, &jacobian.transpose(), 1.0);
        }
        (h, g)
    }
}

/// Directions one below the other, each `(n + n_y) x (n + n_w + 1)`: their product with `[x; w; 1]` drives all
/// sensitivities.
fn stacked(directions: &DMatrix<f64>, rows: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows * directions.ncols(), directions.nrows() / rows, |i, j| {
        directions[(j * rows + i % rows, i / rows)]
    })
}

/// What drives the sensitivities at some samples, one column a sample.
fn forces(
    stacked: &DMatrix<f64>,
    states: &DMatrix<f64>,
    known: &DMatrix<f64>,
    from: usize,
    samples: usize,
) -> DMatrix<f64> {
    let n = states.nrows();
    let mut both = DMatrix::from_element(n + known.nrows() + 1, samples, 1.0);
    both.rows_mut(0, n).copy_from(&states.columns(from, samples));
    both.rows_mut(n, known.nrows())
        .copy_from(&known.columns(from, samples));
    stacked * both
}
