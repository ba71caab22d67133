//! Sums over the samples of a run of products of all signals that sensitivities are made of.

use super::cascade::{Cascade, LANES};
use crate::problem::Run;
use nalgebra::DMatrix;

/// Samples that are held at a time.
const BLOCK: usize = 128;

/// Sums of products of the signals `[f_1; ...; f_m; w; 1]`. `f_j` are the responses of all functions of a [`Cascade`] to
/// the known signal j, and the last of them those to an impulse one sample before the first: an initial state.
pub(super) struct Moments {
    /// With each other.
    pub(super) gram: DMatrix<f64>,
    /// With the residuals, one column an output.
    pub(super) residuals: DMatrix<f64>,
}

impl Moments {
    /// A sample takes as many operations as there are signals, not their square: a state `f+ = A f + b w` has
    /// `sum f f' = A (sum f f') A' + ...`, where all else are sums with w and what is there at both ends.
    pub(super) fn new(cascade: &Cascade, run: &Run, residuals: &DMatrix<f64>) -> Self {
        let (nw, ny) = (run.known.nrows(), residuals.nrows());
        let (size, inputs) = (cascade.b.len(), nw + 1);
        let mut others = DMatrix::from_element(inputs + ny, run.known.ncols(), 1.0);
        others.rows_mut(0, nw).copy_from(&run.known);
        others.rows_mut(inputs, ny).copy_from(residuals);
        let (sums, last) = responses(cascade, &run.known, &others);
        let turned: Vec<_> = sums.iter().map(|s| &cascade.a * s).collect();
        let direct = others.rows(0, inputs) * others.transpose();
        let from = inputs * size;
        let all = from + inputs;
        let mut moments = Self {
            gram: DMatrix::zeros(all, all),
            residuals: DMatrix::zeros(all, ny),
        };
        let (gram, b) = (&mut moments.gram, &cascade.b);
        for j in 0..inputs {
            for i in 0..=j {
                let mut q = -last.column(i) * last.column(j).transpose();
                // At the first sample: b after the impulse, else nothing.
                let mut common = if i == nw { 1.0 } else { 0.0 };
                if j < nw {
                    q.ger(1.0, &turned[i].column(j), b, 1.0);
                    common += direct[(i, j)];
                }
                if i < nw {
                    q.ger(1.0, b, &turned[j].column(i), 1.0);
                }
                q.ger(common, b, b, 1.0);
                let sum = cascade.stein(q);
                gram.view_mut((j * size, i * size), (size, size))
                    .tr_copy_from(&sum);
                gram.view_mut((i * size, j * size), (size, size)).copy_from(&sum);
            }
            let sum = sums[j].columns(0, inputs);
            gram.view_mut((j * size, from), (size, inputs)).copy_from(&sum);
            gram.view_mut((from, j * size), (inputs, size)).tr_copy_from(&sum);
            moments
                .residuals
                .rows_mut(j * size, size)
                .copy_from(&sums[j].columns(inputs, ny));
        }
        gram.view_mut((from, from), (inputs, inputs))
            .copy_from(&direct.columns(0, inputs));
        moments
            .residuals
            .rows_mut(from, inputs)
            .copy_from(&direct.columns(inputs, ny));
        moments
    }
}

/// For each known signal, and an impulse before the first sample: sums of the responses' products with other signals,
/// one column a signal; and the responses after the last sample, one column an input.
fn responses(
    cascade: &Cascade,
    known: &DMatrix<f64>,
    others: &DMatrix<f64>,
) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
    let (nw, samples) = known.shape();
    let size = cascade.b.len();
    let mut groups = vec![cascade.rest(); (nw + 1).div_ceil(LANES)];
    for (state, b) in groups[nw / LANES].iter_mut().zip(cascade.b.iter()) {
        state[nw % LANES] = *b;
    }
    let rows = size * LANES;
    let mut block = DMatrix::zeros(rows * groups.len(), BLOCK);
    let mut sums = DMatrix::zeros(rows * groups.len(), others.nrows());
    let mut signals = [[0.0; LANES]; BLOCK];
    for from in (0..samples).step_by(BLOCK) {
        let count = BLOCK.min(samples - from);
        for (group, states) in groups.iter_mut().enumerate() {
            for (k, signal) in signals[..count].iter_mut().enumerate() {
                for (lane, value) in signal.iter_mut().enumerate() {
                    let j = group * LANES + lane;
                    *value = if j < nw { known[(j, from + k)] } else { 0.0 };
                }
            }
            cascade.filter(states, &mut signals[..count], &mut block, group * rows);
            // What has died away would be denormal at last, and slow.
            for value in states.iter_mut().flatten().filter(|v| v.abs() < 1e-150) {
                *value = 0.0;
            }
        }
        sums.gemm(
            1.0,
            &block.columns(0, count),
            &others.columns(from, count).transpose(),
            1.0,
        );
    }
    let row = |j: usize, k: usize| (j / LANES) * rows + k * LANES + j % LANES;
    let of = |j: usize| DMatrix::from_fn(size, others.nrows(), |k, column| sums[(row(j, k), column)]);
    let last = DMatrix::from_fn(size, nw + 1, |k, j| groups[j / LANES][k][j % LANES]);
    ((0..=nw).map(of).collect(), last)
}
