//! Derivatives of the response of a filter, as parts of orthonormal functions.

use super::cascade::Cascade;
use crate::predictor::Predictor;
use nalgebra::{DMatrix, DVector};

/// What the derivatives along some directions have in common for all runs.
///
/// With `(z - A)^-1 = sum_k Z_k F_k` the filter from w to the states is `sum_k Z_k B F_k`, and along `dA` it changes the
/// outputs by `C (z - A)^-1 dA (z - A)^-1 B = sum_lk C Z_l dA Z_k B F_l F_k`.
pub(super) struct Tangents {
    /// For each simple function l the matrix `C Z_l`, one column a state.
    see: Vec<DMatrix<f64>>,
    resolvent: Vec<DMatrix<f64>>,
    products: Vec<DMatrix<f64>>,
}

impl Tangents {
    pub(super) fn new(cascade: &Cascade, predictor: &Predictor) -> Option<Self> {
        let resolvent = cascade.resolvent(&predictor.a().into_owned())?;
        Some(Self {
            see: resolvent.iter().map(|z| predictor.c() * z).collect(),
            products: cascade.products(),
            resolvent,
        })
    }

    /// For each output a matrix whose column is the derivative along a direction, or after all directions along an
    /// entry of the initial state if `free`, and whose rows are the parts of the signals of [`super::moments::Moments`].
    pub(super) fn of_outputs(
        &self,
        predictor: &Predictor,
        initial: &DVector<f64>,
        directions: &DMatrix<f64>,
        free: usize,
    ) -> Vec<DMatrix<f64>> {
        let (n, ny, nw) = (predictor.states, predictor.outputs(), predictor.inputs());
        let (rows, p) = (n + ny, directions.ncols());
        let simple = self.resolvent.len();
        let (size, inputs) = (2 * simple, nw + 1);
        let mut drive = predictor.b().into_owned().resize_horizontally(inputs, 0.0);
        drive.set_column(nw, initial);
        // Parts of the states, `Z_k [B x_0]`.
        let states: Vec<_> = self.resolvent.iter().map(|z| z * &drive).collect();
        let mut all = vec![DMatrix::zeros(inputs * size + inputs, p + free); ny];
        let of_a: Vec<usize> = (0..n * n).map(|e| (e / n) * rows + e % n).collect();
        let along_a = directions.select_rows(&of_a);
        if along_a.iter().any(|v| *v != 0.0) {
            for (i, units) in self.units(&states, ny).iter().enumerate() {
                all[i]
                    .view_mut((0, 0), (inputs * size, p))
                    .gemm(1.0, units, &along_a, 0.0);
            }
        }
        for (i, own) in all.iter_mut().enumerate() {
            let see = DMatrix::from_fn(simple, n, |k, a| self.see[k][(i, a)]);
            for j in 0..inputs {
                let mut top = own.view_mut((j * size, 0), (simple, p + free));
                let reach = DMatrix::from_fn(simple, n, |k, b| states[k][(b, j)]);
                let of_c: Vec<usize> = (0..n).map(|b| b * rows + n + i).collect();
                top.columns_mut(0, p)
                    .gemm(1.0, &reach, &directions.select_rows(&of_c), 1.0);
                if j < nw {
                    let of_b = directions.rows((n + j) * rows, n);
                    top.columns_mut(0, p).gemm(1.0, &see, &of_b, 1.0);
                } else if free > 0 {
                    top.columns_mut(p, free).copy_from(&see);
                }
                // D, and d after it.
                own.view_mut((inputs * size + j, 0), (1, p))
                    .copy_from(&directions.row((n + j) * rows + n + i));
            }
        }
        all
    }

    /// For each output: along each entry of A, by columns.
    fn units(&self, states: &[DMatrix<f64>], outputs: usize) -> Vec<DMatrix<f64>> {
        let (n, inputs) = states[0].shape();
        let simple = states.len();
        let rows = 2 * simple * inputs;
        let mut units = vec![DMatrix::zeros(rows, n * n); outputs];
        // Row r, column k: the part of F_r in F_l F_k.
        let of_l: Vec<_> = (0..simple)
            .map(|l| DMatrix::from_fn(2 * simple, simple, |r, k| self.products[k][(l, r)]))
            .collect();
        let see: Vec<_> = (0..outputs)
            .map(|i| DMatrix::from_fn(simple, n, |l, a| self.see[l][(i, a)]))
            .collect();
        for b in 0..n {
            let reach = DMatrix::from_fn(simple, inputs, |k, j| states[k][(b, j)]);
            let mut driven = DMatrix::zeros(rows, simple);
            for (l, products) in of_l.iter().enumerate() {
                driven
                    .column_mut(l)
                    .copy_from_slice((products * &reach).as_slice());
            }
            for (units, see) in units.iter_mut().zip(&see) {
                units.columns_mut(b * n, n).gemm(1.0, &driven, see, 0.0);
            }
        }
        units
    }
}
