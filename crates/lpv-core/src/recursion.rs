//! `[x(k+1); y(k)] = [A B; C D] [x(k); u(k)]`, one sample after the other, as wide as the machine adds.

use nalgebra::{DMatrix, DVector};

use pulp::{Simd, WithSimd};

/// Rows are a multiple of this, so that the widest registers fit.
const ROWS: usize = 8;

/// The matrix of a recursion, column after column.
pub(crate) struct Recursion {
    columns: Vec<f64>,
    rows: usize,
    states: usize,
    outputs: usize,
}

impl Recursion {
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>, d: &DMatrix<f64>) -> Self {
        let (states, inputs, outputs) = (a.nrows(), b.ncols(), c.nrows());
        let rows = (states + outputs).next_multiple_of(ROWS);
        let mut all = DMatrix::zeros(rows, states + inputs);
        all.view_mut((0, 0), (states, states)).copy_from(a);
        all.view_mut((0, states), (states, inputs)).copy_from(b);
        all.view_mut((states, 0), (outputs, states)).copy_from(c);
        all.view_mut((states, states), (outputs, inputs)).copy_from(d);
        Self {
            columns: all.as_slice().to_vec(),
            rows,
            states,
            outputs,
        }
    }

    /// Outputs for all inputs, one column a sample; the state moves on.
    pub(crate) fn run(&self, state: &mut DVector<f64>, inputs: &DMatrix<f64>) -> DMatrix<f64> {
        let mut outputs = DMatrix::zeros(self.outputs, inputs.ncols());
        pulp::Arch::new().dispatch(Samples {
            matrix: self,
            state: state.as_mut_slice(),
            inputs,
            outputs: &mut outputs,
        });
        outputs
    }
}

/// All samples, in the registers of one kind of machine.
struct Samples<'a> {
    matrix: &'a Recursion,
    state: &'a mut [f64],
    inputs: &'a DMatrix<f64>,
    outputs: &'a mut DMatrix<f64>,
}

impl WithSimd for Samples<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Recursion {
            columns,
            rows,
            states,
            outputs,
        } = self.matrix;
        let (n, ny) = (*states, *outputs);
        let mut now = vec![0.0; n + self.inputs.nrows()];
        now[..n].copy_from_slice(self.state);
        let mut next = vec![0.0; *rows];
        for k in 0..self.inputs.ncols() {
            now[n..].copy_from_slice(self.inputs.column(k).as_slice());
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
            self.outputs.column_mut(k).copy_from_slice(&next[n..n + ny]);
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
    use super::Recursion;
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
            let inputs = matrix(nu, 50, 0.5);
            let mut x = DVector::from_fn(n, |i, _| 0.1 * i as f64 - 0.2);
            let mut moved = x.clone();
            let found = Recursion::new(&a, &b, &c, &d).run(&mut moved, &inputs);
            for k in 0..inputs.ncols() {
                let y = &c * &x + &d * inputs.column(k);
                x = &a * &x + &b * inputs.column(k);
                assert!((found.column(k) - y).amax() < 1e-13, "{n} {nu} {ny} at {k}");
            }
            assert!((moved - x).amax() < 1e-13);
        }
    }
}
