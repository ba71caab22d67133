//! The lines of one position: residuals, and how they move with the entries of the sampled S.

use crate::data::Position;
use crate::shape::Shape;
use lpv_core::{Discrete, ResponseKernel, StateSpace};
use lpv_numerics::dense::Triangle;
use nalgebra::{DMatrix, DMatrixView, DVector};
use num_complex::Complex;
use std::ops::Range;

type C64 = Complex<f64>;

const ZERO: C64 = C64::new(0.0, 0.0);

/// The square of the residual `W_y (F - G) W_u` of each line, not emphasised; none where a response does not exist.
pub(crate) fn squared_residuals(
    s: &DMatrix<f64>,
    shape: Shape,
    position: &Position,
    values: &[C64],
) -> Option<Vec<f64>> {
    let all = residuals(s, shape, position, values)?;
    let of_line = |line: &[C64]| line.iter().map(|v| v.norm_sqr()).sum();
    Some(
        all.chunks_exact(shape.outputs * shape.inputs)
            .map(of_line)
            .collect(),
    )
}

/// The residuals themselves, line after line, each down its columns.
pub(crate) fn residuals(
    s: &DMatrix<f64>,
    shape: Shape,
    position: &Position,
    values: &[C64],
) -> Option<Vec<C64>> {
    let mut kernel = response_kernel(s, shape)?;
    let size = shape.outputs * shape.inputs;
    let mut all = vec![ZERO; values.len()];
    let mut work = vec![ZERO; size];
    kernel.evaluate(&position.z, &mut all).ok()?;
    for (k, (e, g)) in all
        .chunks_exact_mut(size)
        .zip(values.chunks_exact(size))
        .enumerate()
    {
        e.iter_mut().zip(g).for_each(|(e, g)| *e -= g);
        position.whiten(k, shape, e, &mut work);
    }
    Some(all)
}

fn response_kernel(s: &DMatrix<f64>, shape: Shape) -> Option<ResponseKernel> {
    let (n, ny, nu) = (shape.states, shape.outputs, shape.inputs);
    let part = |at, size| s.view(at, size).into_owned();
    kernel(
        part((0, 0), (n, n)),
        part((0, n), (n, nu)),
        part((n, 0), (ny, n)),
        part((n, n), (ny, nu)),
    )
}

/// `C (zI - A)^-1 B + D`; the clock does not matter to it.
fn kernel(a: DMatrix<f64>, b: DMatrix<f64>, c: DMatrix<f64>, d: DMatrix<f64>) -> Option<ResponseKernel> {
    let system = StateSpace::new(a, b, c, d, Discrete::new(1.0).ok()?).ok()?;
    ResponseKernel::new(&system).ok()
}

impl Position {
    /// The sum of squares of the weighted response itself.
    pub(crate) fn energy(&self) -> f64 {
        (0..self.frf.len()).map(|k| self.line_energy(k)).sum()
    }

    /// The square of the weighted response of a line.
    fn line_energy(&self, k: usize) -> f64 {
        let shape = Shape {
            states: 0,
            outputs: self.frf.outputs(),
            inputs: self.frf.inputs(),
        };
        let mut work = vec![ZERO; shape.outputs * shape.inputs];
        let mut g = self.frf.line_slice(k).to_vec();
        self.whiten(k, shape, &mut g, &mut work);
        g.iter().map(|v| v.norm_sqr()).sum()
    }

    /// The same lines, none of them taken for more exact than this part of its response.
    pub(crate) fn with_error_floor(mut self, part: f64) -> Self {
        let equations = (2 * self.frf.outputs() * self.frf.inputs()) as f64;
        let sizes: Vec<f64> = (0..self.frf.len()).map(|k| self.line_energy(k)).collect();
        for (scale, size) in self.scale.iter_mut().zip(sizes) {
            *scale /= (1.0 + part * part * size / equations).sqrt();
        }
        self
    }

    /// `W_y e W_u` of line `k`, all column-major.
    fn whiten(&self, k: usize, shape: Shape, e: &mut [C64], work: &mut [C64]) {
        let scale = self.scale[k];
        let Some(whitening) = &self.whitening else {
            e.iter_mut().for_each(|v| *v *= scale);
            return;
        };
        let (ny, nu) = (shape.outputs, shape.inputs);
        multiply(whitening.left(k), e, ny, work);
        multiply(work, whitening.right(k), nu, e);
        e.iter_mut().for_each(|v| *v *= scale);
    }
}

/// `out = x y` with `inner` columns of x and rows of y, all column-major.
fn multiply(x: &[C64], y: &[C64], inner: usize, out: &mut [C64]) {
    let rows = x.len() / inner;
    for (column, y) in out.chunks_exact_mut(rows).zip(y.chunks_exact(inner)) {
        column.fill(ZERO);
        for (x, y) in x.chunks_exact(rows).zip(y) {
            column.iter_mut().zip(x).for_each(|(o, x)| *o += x * y);
        }
    }
}

/// One complex number a line, as two planes: products over lines then run in vector registers.
#[derive(Clone)]
struct Plane {
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Plane {
    fn zeros(n: usize) -> Self {
        Self {
            re: vec![0.0; n],
            im: vec![0.0; n],
        }
    }
    fn set(&mut self, k: usize, v: C64) {
        (self.re[k], self.im[k]) = (v.re, v.im);
    }
}

/// Some lines of one position, linearised: `dF = l dS r` with `l = W_y [C (zI - A)^-1, I]` and
/// `r = [(zI - A)^-1 B; I] W_u`.
pub(crate) struct Chunk {
    lines: usize,
    shape: Shape,
    /// `l`, `n_y x (n + n_y)` planes, column-major.
    left: Vec<Plane>,
    /// `r`, `(n + n_u) x n_u` planes, column-major.
    right: Vec<Plane>,
    /// Residuals, `n_y x n_u` planes, column-major.
    residual: Vec<Plane>,
}

impl Chunk {
    pub(crate) fn new(
        s: &DMatrix<f64>,
        shape: Shape,
        position: &Position,
        (values, emphasis): (&[C64], &[f64]),
        range: Range<usize>,
    ) -> Option<Self> {
        let (n, ny, nu) = (shape.states, shape.outputs, shape.inputs);
        let (a, b) = (shape.rows(), shape.columns());
        let part = |at, size| s.view(at, size).into_owned();
        let (am, bm, cm) = (part((0, 0), (n, n)), part((0, n), (n, nu)), part((n, 0), (ny, n)));
        let d: Vec<f64> = s.view((n, n), (ny, nu)).iter().copied().collect();
        let unit = DMatrix::identity(n, n);
        let mut forward = kernel(am.clone(), bm, unit.clone(), DMatrix::zeros(n, nu))?;
        let mut backward = kernel(am.transpose(), cm.transpose(), unit, DMatrix::zeros(n, ny))?;
        let lines = range.len();
        let zeros = |count: usize| vec![Plane::zeros(lines); count];
        let (mut left, mut right, mut residual) = (zeros(ny * a), zeros(b * nu), zeros(ny * nu));
        let (mut states, mut costates) = (vec![ZERO; lines * n * nu], vec![ZERO; lines * n * ny]);
        forward.evaluate(&position.z[range.clone()], &mut states).ok()?;
        backward
            .evaluate(&position.z[range.clone()], &mut costates)
            .ok()?;
        let (mut l, mut r) = (vec![ZERO; ny * a], vec![ZERO; b * nu]);
        let (mut e, mut work) = (vec![ZERO; ny * nu], vec![ZERO; (ny * a).max(b * nu)]);
        for (at, k) in range.enumerate() {
            let x = &states[at * n * nu..(at + 1) * n * nu];
            let y = &costates[at * n * ny..(at + 1) * n * ny];
            l.fill(ZERO);
            r.fill(ZERO);
            for o in 0..ny {
                for i in 0..n {
                    l[i * ny + o] = y[o * n + i];
                }
                l[(n + o) * ny + o] = C64::from(1.0);
            }
            for i in 0..nu {
                r[i * b..i * b + n].copy_from_slice(&x[i * n..(i + 1) * n]);
                r[i * b + n + i] = C64::from(1.0);
                for o in 0..ny {
                    let product = (0..n).map(|j| x[i * n + j] * cm[(o, j)]).sum::<C64>();
                    e[i * ny + o] = product + d[i * ny + o] - values[k * ny * nu + i * ny + o];
                }
            }
            position.whiten(k, shape, &mut e, &mut work[..ny * nu]);
            if let Some(whitening) = &position.whitening {
                multiply(whitening.left(k), &l, ny, &mut work[..ny * a]);
                l.copy_from_slice(&work[..ny * a]);
                multiply(&r, whitening.right(k), nu, &mut work[..b * nu]);
                r.copy_from_slice(&work[..b * nu]);
            }
            let emphasis = emphasis[k];
            let scale = position.scale[k] * emphasis;
            left.iter_mut()
                .zip(&l)
                .for_each(|(plane, v)| plane.set(at, v * scale));
            right.iter_mut().zip(&r).for_each(|(plane, v)| plane.set(at, *v));
            residual
                .iter_mut()
                .zip(&e)
                .for_each(|(plane, v)| plane.set(at, v * emphasis));
        }
        Some(Self {
            lines,
            shape,
            left,
            right,
            residual,
        })
    }

    /// Real rows: two a line and channel.
    pub(crate) fn rows(&self) -> usize {
        2 * self.lines * self.residual.len()
    }

    /// The derivative of the residuals with respect to entries of S. Rows: for each channel, column-major, the real
    /// parts of all lines, then the imaginary parts.
    pub(crate) fn jacobian(&self, entries: &[(usize, usize)]) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.rows(), entries.len());
        self.write_jacobian(entries, jacobian.as_mut_slice());
        jacobian
    }

    fn write_jacobian(&self, entries: &[(usize, usize)], out: &mut [f64]) {
        let (ny, b, n) = (self.shape.outputs, self.shape.columns(), self.lines);
        for (&(i, j), column) in entries.iter().zip(out.chunks_exact_mut(self.rows().max(1))) {
            for (channel, rows) in column.chunks_exact_mut(2 * n).enumerate() {
                let (o, u) = (channel % ny, channel / ny);
                let (l, r) = (&self.left[i * ny + o], &self.right[u * b + j]);
                let (re, im) = rows.split_at_mut(n);
                let (lr, li, rr, ri) = (&l.re[..n], &l.im[..n], &r.re[..n], &r.im[..n]);
                let im = &mut im[..n];
                for k in 0..n {
                    re[k] = lr[k] * rr[k] - li[k] * ri[k];
                    im[k] = lr[k] * ri[k] + li[k] * rr[k];
                }
            }
        }
    }

    /// Writes `[J basis, r]` as the next block of a triangle. `work` keeps its memory from one chunk to the next.
    pub(crate) fn fill(
        &self,
        entries: &[(usize, usize)],
        basis: &DMatrix<f64>,
        work: &mut Vec<f64>,
        triangle: &mut Triangle,
    ) {
        let rows = self.rows();
        work.resize(rows * entries.len(), 0.0);
        self.write_jacobian(entries, work);
        let jacobian = DMatrixView::from_slice(work, rows, entries.len());
        triangle
            .block_mut(rows, basis.ncols())
            .gemm(1.0, &jacobian, basis, 0.0);
        self.write_residual(&mut triangle.column_mut(basis.ncols())[..rows]);
    }

    /// The residuals, emphasised, in the rows of the Jacobian.
    pub(crate) fn residual(&self) -> DVector<f64> {
        let mut residual = DVector::zeros(self.rows());
        self.write_residual(residual.as_mut_slice());
        residual
    }

    fn write_residual(&self, out: &mut [f64]) {
        for (rows, plane) in out.chunks_exact_mut(2 * self.lines).zip(&self.residual) {
            rows[..self.lines].copy_from_slice(&plane.re);
            rows[self.lines..].copy_from_slice(&plane.im);
        }
    }
}

#[cfg(test)]
mod tests;
