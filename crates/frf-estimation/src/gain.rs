//! The gain `G = X^H (U X^H)^-1` of a line, so that `F = Y G`, without allocation; several lines at a time in [`crate::lanes`].

use crate::lanes::{ComplexLanes, Lanes, WIDEST};
use pulp::Simd;

/// Buffers for lines with `inputs` inputs and `experiments` experiments. Matrices are column-major slices.
pub(crate) struct GainKernel<S: Simd> {
    simd: S,
    inputs: usize,
    experiments: usize,
    /// `[A | I]`, row-major, `inputs x 2 inputs`.
    work: Vec<ComplexLanes<S>>,
    rows: Vec<Lanes<S>>,
    columns: Vec<Lanes<S>>,
    /// `n_e x n_u`.
    gain: Vec<ComplexLanes<S>>,
}

impl<S: Simd> GainKernel<S> {
    pub(crate) fn new(simd: S, inputs: usize, experiments: usize) -> Self {
        let zero = ComplexLanes::zero(simd);
        Self {
            simd,
            inputs,
            experiments,
            work: vec![zero; 2 * inputs * inputs],
            rows: vec![zero.re; inputs],
            columns: vec![zero.re; inputs],
            gain: vec![zero; experiments * inputs],
        }
    }

    /// `G`, `n_e x n_u`, of the last lines.
    #[inline(always)]
    pub(crate) fn gain(&self) -> &[ComplexLanes<S>] {
        &self.gain
    }

    /// Computes `G` from `U` and the instruments `X` (both `n_u x n_e`); `G = U^-1` where `X` is `U` and the two
    /// numbers agree. Returns by lane the condition number `||A||_F ||A^-1||_F / n_u` of `A = U X^H` with rows and columns
    /// scaled to unit length, which is 1 for orthogonal experiments whatever the units; infinite where `A` is singular.
    #[inline(always)]
    pub(crate) fn compute(&mut self, u: &[ComplexLanes<S>], x: Option<&[ComplexLanes<S>]>) -> [f64; WIDEST] {
        // The usual sizes as constants, so that their loops are unrolled.
        let mut conditions = match (self.inputs, self.experiments) {
            (1, 1) => self.compute_of(1, 1, u, x),
            (2, 2) => self.compute_of(2, 2, u, x),
            (n, ne) => self.compute_of(n, ne, u, x),
        };
        for condition in &mut conditions {
            if !condition.is_finite() {
                *condition = f64::INFINITY;
            }
        }
        conditions
    }

    // Loops, here and below: a closure may not be inlined into the function that has the instructions of the registers.
    #[inline(always)]
    fn compute_of(
        &mut self,
        n: usize,
        ne: usize,
        u: &[ComplexLanes<S>],
        x: Option<&[ComplexLanes<S>]>,
    ) -> [f64; WIDEST] {
        let square = x.is_none() && n == ne;
        let u = &u[..n * ne];
        let x = &x.unwrap_or(u)[..n * ne];
        let work = &mut self.work[..2 * n * n];
        let gain = &mut self.gain[..ne * n];
        for i in 0..n {
            for j in 0..n {
                work[i * 2 * n + j] = if square {
                    u[j * n + i]
                } else {
                    let mut sum = ComplexLanes::zero(self.simd);
                    for e in 0..ne {
                        sum += u[e * n + i] * x[e * n + j].conj();
                    }
                    sum
                };
            }
        }
        let condition = invert(self.simd, work, &mut self.rows[..n], &mut self.columns[..n]);
        for j in 0..n {
            for e in 0..ne {
                gain[j * ne + e] = if square {
                    work[e * 2 * n + n + j]
                } else {
                    let mut sum = ComplexLanes::zero(self.simd);
                    for i in 0..n {
                        sum += x[e * n + i].conj() * work[i * 2 * n + n + j];
                    }
                    sum
                };
            }
        }
        condition.values()
    }
}

/// Inverts the matrix on the left of `work`, scaled; its inverse is then on the right. Returns its condition number.
#[inline(always)]
fn invert<S: Simd>(
    simd: S,
    work: &mut [ComplexLanes<S>],
    rows: &mut [Lanes<S>],
    columns: &mut [Lanes<S>],
) -> Lanes<S> {
    let n = rows.len();
    let w = 2 * n;
    let (zero, one) = (ComplexLanes::zero(simd), Lanes::splat(simd, 1.0));
    for i in 0..n {
        rows[i] = one / squares(zero.re, work, i * w, 1, n).sqrt();
        for j in 0..n {
            work[i * w + j] = work[i * w + j] * rows[i];
            work[i * w + n + j] = zero;
        }
        work[i * w + n + i].re = one;
    }
    for j in 0..n {
        columns[j] = one / squares(zero.re, work, j, w, n).sqrt();
        for i in 0..n {
            work[i * w + j] = work[i * w + j] * columns[j];
        }
    }
    if n == 2 {
        cramer(work);
    } else {
        eliminate(work, n);
    }
    let mut square = zero.re;
    for i in 0..n {
        square = squares(square, work, i * w + n, 1, n);
    }
    // A = Dr^-1 As Dc^-1, hence A^-1 = Dc As^-1 Dr.
    for i in 0..n {
        for j in 0..n {
            work[i * w + n + j] = work[i * w + n + j] * (columns[i] * rows[j]);
        }
    }
    // Every column has length one.
    let size = Lanes::splat(simd, (n as f64).sqrt());
    size * square.sqrt() / Lanes::splat(simd, n as f64)
}

/// A sum with the squares of so many numbers, every `step`th from one on.
#[inline(always)]
fn squares<S: Simd>(
    mut sum: Lanes<S>,
    numbers: &[ComplexLanes<S>],
    from: usize,
    step: usize,
    count: usize,
) -> Lanes<S> {
    for i in 0..count {
        sum = sum + numbers[from + i * step].norm_sqr();
    }
    sum
}

/// The inverse of a matrix of two rows by Cramer's rule, which for two is as accurate as elimination (\[higham2002\], sec. 1.10.1).
#[inline(always)]
fn cramer<S: Simd>(work: &mut [ComplexLanes<S>]) {
    let [a, b, c, d] = [work[0], work[1], work[4], work[5]];
    let inverse = (a * d - b * c).inv();
    [work[2], work[3]] = [d * inverse, -b * inverse];
    [work[6], work[7]] = [-c * inverse, a * inverse];
}

/// Gauss-Jordan elimination with row pivots, of its own in each lane.
#[inline(always)]
fn eliminate<S: Simd>(work: &mut [ComplexLanes<S>], n: usize) {
    let w = 2 * n;
    for k in 0..n {
        for i in k + 1..n {
            let (above, below) = work.split_at_mut(i * w);
            let (above, below) = (&mut above[k * w..][..w], &mut below[..w]);
            let (own, other) = (above[k].norm_sqr(), below[k].norm_sqr());
            for j in 0..w {
                ComplexLanes::exchange_where(other, own, &mut above[j], &mut below[j]);
            }
        }
        let inverse = work[k * w + k].inv();
        for j in 0..w {
            work[k * w + j] = work[k * w + j] * inverse;
        }
        for i in 0..n {
            if i == k {
                continue;
            }
            let factor = work[i * w + k];
            for j in 0..w {
                let above = work[k * w + j];
                work[i * w + j] -= factor * above;
            }
        }
    }
}

/// `F = Y G` (`n_y x n_u`) from `Y` (`n_y x n_e`) and `G` (`n_e x n_u`).
#[inline(always)]
pub(crate) fn response<S: Simd>(
    simd: S,
    y: &[ComplexLanes<S>],
    g: &[ComplexLanes<S>],
    ny: usize,
    ne: usize,
    f: &mut [ComplexLanes<S>],
) {
    for (column, out) in g.chunks_exact(ne).zip(f.chunks_exact_mut(ny)) {
        for i in 0..ny {
            let mut sum = ComplexLanes::zero(simd);
            for e in 0..ne {
                sum += y[e * ny + i] * column[e];
            }
            out[i] = sum;
        }
    }
}

/// `scale [I -F] C [I -F]^H` into `out` (`n_y x n_y`), `C` Hermitian over outputs and then inputs.
#[inline(always)]
pub(crate) fn residual_covariance<S: Simd>(
    simd: S,
    c: &[ComplexLanes<S>],
    f: &[ComplexLanes<S>],
    ny: usize,
    nu: usize,
    scale: f64,
    out: &mut [ComplexLanes<S>],
) {
    // The usual sizes as constants, so that their loops are unrolled.
    match (ny, nu) {
        (1, 1) => residual_covariance_of(simd, c, f, 1, 1, scale, out),
        (2, 2) => residual_covariance_of(simd, c, f, 2, 2, scale, out),
        _ => residual_covariance_of(simd, c, f, ny, nu, scale, out),
    }
}

#[inline(always)]
fn residual_covariance_of<S: Simd>(
    simd: S,
    c: &[ComplexLanes<S>],
    f: &[ComplexLanes<S>],
    ny: usize,
    nu: usize,
    scale: f64,
    out: &mut [ComplexLanes<S>],
) {
    let nz = ny + nu;
    let (zero, scale) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, scale));
    let (c, f, out) = (&c[..nz * nz], &f[..ny * nu], &mut out[..ny * ny]);
    for i in 0..ny {
        for k in 0..ny {
            let mut sum = c[k * nz + i];
            for j in 0..nu {
                sum -= f[j * ny + i] * c[k * nz + ny + j];
                sum -= c[(ny + j) * nz + i] * f[j * ny + k].conj();
                for l in 0..nu {
                    sum += f[j * ny + i] * c[(ny + l) * nz + ny + j] * f[l * ny + k].conj();
                }
            }
            out[k * ny + i] = sum * scale;
        }
    }
    // The four terms cancel where inputs and outputs share noise; rounding may leave a diagonal just below zero.
    for i in 0..ny {
        let d = &mut out[i * ny + i];
        d.re = d.re.positive_part();
        d.im = zero;
    }
}

#[cfg(test)]
mod tests;
