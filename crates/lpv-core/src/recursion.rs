//! `[x(k+1); y(k)] = [A B; C D] [x(k); u(k)]`, one sample after the other or several a step, as wide as the machine adds.

mod lifted;

use lifted::Lifted;
use nalgebra::{DMatrix, DVector};
use pulp::{Simd, WithSimd};

/// Rows are a multiple of this, so that the widest registers fit.
const ROWS: usize = 8;

/// Outputs of `[A, B, C, D]` for all inputs, one column a sample; the state moves on.
pub(crate) fn outputs(
    matrices: [&DMatrix<f64>; 4],
    state: &mut DVector<f64>,
    inputs: &DMatrix<f64>,
) -> DMatrix<f64> {
    let samples = inputs.ncols();
    let mut outputs = DMatrix::zeros(matrices[2].nrows(), samples);
    let plain = Recursion::new(matrices, None);
    if let Some(Lifted { step, low, count }) = Lifted::new(matrices, samples) {
        let steps = samples / count;
        let mut x = state.clone();
        let (now, then) = inputs.as_slice().split_at(inputs.nrows() * count * steps);
        let (first, rest) = outputs
            .as_mut_slice()
            .split_at_mut(matrices[2].nrows() * count * steps);
        Recursion::new(step.each_ref(), Some(&low)).run(&mut x, steps, now, first);
        plain.run(&mut x, samples - steps * count, then, rest);
        // What overflows does so at its own sample.
        if x.iter().chain(outputs.iter()).all(|v| v.is_finite()) {
            *state = x;
            return outputs;
        }
    }
    plain.run(state, samples, inputs.as_slice(), outputs.as_mut_slice());
    outputs
}

/// The matrix of a recursion, column after column.
struct Recursion {
    columns: Vec<f64>,
    rows: usize,
    states: usize,
    inputs: usize,
    outputs: usize,
    /// Whether the state goes in once more, times what its columns were rounded by.
    is_twofold: bool,
}

impl Recursion {
    fn new([a, b, c, d]: [&DMatrix<f64>; 4], low: Option<&[DMatrix<f64>; 2]>) -> Self {
        let (states, inputs, outputs) = (a.nrows(), b.ncols(), c.nrows());
        let rows = (states + outputs).next_multiple_of(ROWS);
        let more = if low.is_some() { states } else { 0 };
        let mut all = DMatrix::zeros(rows, states + inputs + more);
        all.view_mut((0, 0), (states, states)).copy_from(a);
        all.view_mut((0, states), (states, inputs)).copy_from(b);
        all.view_mut((states, 0), (outputs, states)).copy_from(c);
        all.view_mut((states, states), (outputs, inputs)).copy_from(d);
        if let Some([a, c]) = low {
            let from = states + inputs;
            all.view_mut((0, from), (states, states)).copy_from(a);
            all.view_mut((states, from), (outputs, states)).copy_from(c);
        }
        Self {
            is_twofold: low.is_some(),
            columns: all.as_slice().to_vec(),
            rows,
            states,
            inputs,
            outputs,
        }
    }

    /// So many samples; the state moves on.
    fn run(&self, state: &mut DVector<f64>, samples: usize, inputs: &[f64], outputs: &mut [f64]) {
        pulp::Arch::new().dispatch(Samples {
            matrix: self,
            state: state.as_mut_slice(),
            samples,
            inputs,
            outputs,
        });
    }
}

/// All samples, in the registers of one kind of machine.
struct Samples<'a> {
    matrix: &'a Recursion,
    state: &'a mut [f64],
    samples: usize,
    inputs: &'a [f64],
    outputs: &'a mut [f64],
}

impl WithSimd for Samples<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Recursion {
            columns,
            rows,
            states,
            inputs,
            outputs,
            is_twofold,
        } = self.matrix;
        let (n, nu, ny) = (*states, *inputs, *outputs);
        let mut now = vec![0.0; n + nu + if *is_twofold { n } else { 0 }];
        now[..n].copy_from_slice(self.state);
        let mut next = vec![0.0; *rows];
        for k in 0..self.samples {
            now[n..n + nu].copy_from_slice(&self.inputs[nu * k..nu * (k + 1)]);
            if *is_twofold {
                now.copy_within(..n, n + nu);
            }
            let (columns, _) = S::as_simd_f64s(columns);
            let (out, _) = S::as_mut_simd_f64s(&mut next);
            let mut from = 0;
            while from < out.len() {
                from += match out.len() - from {
                    1 => product::<S, 1>(simd, columns, from, &now, out),
                    2 | 3 => product::<S, 2>(simd, columns, from, &now, out),
                    _ => product::<S, 4>(simd, columns, from, &now, out),
                };
            }
            now[..n].copy_from_slice(&next[..n]);
            self.outputs[ny * k..ny * (k + 1)].copy_from_slice(&next[n..n + ny]);
        }
        self.state.copy_from_slice(&now[..n]);
    }
}

/// So many registers of rows times a vector; even and odd columns apart, so that a sum does not wait for the one before.
#[inline(always)]
fn product<S: Simd, const WIDE: usize>(
    simd: S,
    columns: &[S::f64s],
    from: usize,
    vector: &[f64],
    out: &mut [S::f64s],
) -> usize {
    let zero = simd.splat_f64s(0.0);
    let (mut even, mut odd) = ([zero; WIDE], [zero; WIDE]);
    let stride = out.len();
    let (pairs, last) = vector.as_chunks::<2>();
    let mut columns = columns.chunks_exact(2 * stride);
    for ([one, other], columns) in pairs.iter().zip(columns.by_ref()) {
        let (one, other) = (simd.splat_f64s(*one), simd.splat_f64s(*other));
        let left = &columns[from..from + WIDE];
        let right = &columns[stride + from..stride + from + WIDE];
        for i in 0..WIDE {
            even[i] = simd.mul_add_f64s(left[i], one, even[i]);
            odd[i] = simd.mul_add_f64s(right[i], other, odd[i]);
        }
    }
    if let [one] = last {
        let one = simd.splat_f64s(*one);
        for (sum, column) in even.iter_mut().zip(&columns.remainder()[from..]) {
            *sum = simd.mul_add_f64s(*column, one, *sum);
        }
    }
    for (i, out) in out[from..from + WIDE].iter_mut().enumerate() {
        *out = simd.add_f64s(even[i], odd[i]);
    }
    WIDE
}

#[cfg(test)]
mod tests {
    use super::outputs;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn is_the_plain_recursion_for_any_size() {
        for (n, nu, ny) in [
            (0, 1, 1),
            (1, 1, 1),
            (5, 2, 3),
            (7, 1, 1),
            (24, 2, 2),
            (33, 3, 9),
            (70, 1, 2),
        ] {
            let matrix = |rows: usize, columns: usize, seed: f64| {
                DMatrix::from_fn(rows, columns, |i, j| {
                    (seed + 1.3 * i as f64 + 0.7 * (j * j) as f64).sin() / (1.0 + n as f64)
                })
            };
            let (a, b, c, d) = (
                matrix(n, n, 0.1),
                matrix(n, nu, 0.2),
                matrix(ny, n, 0.3),
                matrix(ny, nu, 0.4),
            );
            // Enough for several samples a step, and one more.
            let inputs = matrix(nu, 513 * n + 1, 0.5);
            let mut x = DVector::from_fn(n, |i, _| 0.1 * i as f64 - 0.2);
            let mut moved = x.clone();
            let found = outputs([&a, &b, &c, &d], &mut moved, &inputs);
            for k in 0..inputs.ncols() {
                let y = &c * &x + &d * inputs.column(k);
                x = &a * &x + &b * inputs.column(k);
                assert!((found.column(k) - y).amax() < 1e-13, "{n} {nu} {ny} at {k}");
            }
            assert!((moved - x).amax() < 1e-13);
        }
    }
}
