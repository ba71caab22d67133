//! The gain `G = X^H (U X^H)^-1` of one line, so that `F = Y G`, without allocation.

use num_complex::Complex;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

/// Buffers for lines with `inputs` inputs and `experiments` experiments. Matrices are column-major slices.
pub(crate) struct GainKernel {
    inputs: usize,
    experiments: usize,
    /// `[A | I]`, row-major, `inputs x 2 inputs`.
    work: Vec<C64>,
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// `n_e x n_u`.
    gain: Vec<C64>,
}

impl GainKernel {
    pub(crate) fn new(inputs: usize, experiments: usize) -> Self {
        Self {
            inputs,
            experiments,
            work: vec![ZERO; 2 * inputs * inputs],
            rows: vec![0.0; inputs],
            columns: vec![0.0; inputs],
            gain: vec![ZERO; experiments * inputs],
        }
    }

    /// `G`, `n_e x n_u`, of the last line.
    pub(crate) fn gain(&self) -> &[C64] {
        &self.gain
    }

    /// Computes `G` from `U` and the instruments `X` (both `n_u x n_e`); `G = U^-1` where `X` is `U` and the two
    /// numbers agree. Returns the condition number `||A||_F ||A^-1||_F / n_u` of `A = U X^H` with rows and columns
    /// scaled to unit length, which is 1 for orthogonal experiments whatever the units; infinite where `A` is singular.
    pub(crate) fn compute(&mut self, u: &[C64], x: Option<&[C64]>) -> f64 {
        // The usual sizes as constants, so that their loops are unrolled.
        match (self.inputs, self.experiments) {
            (1, 1) => self.compute_of(1, 1, u, x),
            (2, 2) => self.compute_of(2, 2, u, x),
            (n, ne) => self.compute_of(n, ne, u, x),
        }
    }

    #[inline(always)]
    fn compute_of(&mut self, n: usize, ne: usize, u: &[C64], x: Option<&[C64]>) -> f64 {
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
                    (0..ne).map(|e| u[e * n + i] * x[e * n + j].conj()).sum()
                };
            }
        }
        let condition = invert(work, &mut self.rows[..n], &mut self.columns[..n]);
        if !condition.is_finite() {
            return f64::INFINITY;
        }
        for j in 0..n {
            for e in 0..ne {
                gain[j * ne + e] = if square {
                    work[e * 2 * n + n + j]
                } else {
                    (0..n)
                        .map(|i| x[e * n + i].conj() * work[i * 2 * n + n + j])
                        .sum()
                };
            }
        }
        condition
    }
}

/// Inverts the matrix on the left of `work`, scaled; its inverse is then on the right. Returns its condition number.
#[inline(always)]
fn invert(work: &mut [C64], rows: &mut [f64], columns: &mut [f64]) -> f64 {
    let n = rows.len();
    let w = 2 * n;
    for i in 0..n {
        let length = norm(work[i * w..i * w + n].iter());
        rows[i] = 1.0 / length;
        for j in 0..n {
            work[i * w + j] *= rows[i];
            work[i * w + n + j] = if i == j { C64::new(1.0, 0.0) } else { ZERO };
        }
    }
    for j in 0..n {
        let length = norm((0..n).map(|i| &work[i * w + j]));
        columns[j] = 1.0 / length;
        for i in 0..n {
            work[i * w + j] *= columns[j];
        }
    }
    // Every column has length one now.
    let size = (n as f64).sqrt();
    if n == 2 {
        cramer(work);
    } else {
        eliminate(work, n);
    }
    let inverse_size = norm((0..n).flat_map(|i| &work[i * w + n..(i + 1) * w]));
    // A = Dr^-1 As Dc^-1, hence A^-1 = Dc As^-1 Dr.
    for i in 0..n {
        for j in 0..n {
            work[i * w + n + j] *= columns[i] * rows[j];
        }
    }
    size * inverse_size / n as f64
}

/// The inverse of a matrix of two rows by Cramer's rule, which for two is as accurate as elimination (\[higham2002\], sec. 1.10.1).
#[inline(always)]
fn cramer(work: &mut [C64]) {
    let [a, b, c, d] = [work[0], work[1], work[4], work[5]];
    let inverse = (a * d - b * c).inv();
    [work[2], work[3]] = [d * inverse, -b * inverse];
    [work[6], work[7]] = [-c * inverse, a * inverse];
}

/// Gauss-Jordan elimination with row pivots.
#[inline(always)]
fn eliminate(work: &mut [C64], n: usize) {
    let w = 2 * n;
    for k in 0..n {
        let pivot = (k..n).fold(k, |best, i| {
            if work[i * w + k].norm_sqr() > work[best * w + k].norm_sqr() {
                i
            } else {
                best
            }
        });
        for j in 0..w {
            work.swap(k * w + j, pivot * w + j);
        }
        let inverse = work[k * w + k].inv();
        for j in 0..w {
            work[k * w + j] *= inverse;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = work[i * w + k];
            for j in 0..w {
                let above = work[k * w + j];
                work[i * w + j] -= factor * above;
            }
        }
    }
}

#[inline(always)]
fn norm<'a>(values: impl Iterator<Item = &'a C64>) -> f64 {
    values.map(C64::norm_sqr).sum::<f64>().sqrt()
}

/// `F = Y G` (`n_y x n_u`) from `Y` (`n_y x n_e`) and `G` (`n_e x n_u`).
pub(crate) fn response(y: &[C64], g: &[C64], ny: usize, ne: usize, f: &mut [C64]) {
    for (column, out) in g.chunks_exact(ne).zip(f.chunks_exact_mut(ny)) {
        for (i, o) in out.iter_mut().enumerate() {
            *o = (0..ne).map(|e| y[e * ny + i] * column[e]).sum();
        }
    }
}

/// Adds `scale [I -F] C [I -F]^H` to `out` (`n_y x n_y`), `C` Hermitian over outputs and then inputs.
pub(crate) fn add_residual_covariance(
    c: &[C64],
    f: &[C64],
    ny: usize,
    nu: usize,
    scale: f64,
    out: &mut [C64],
) {
    // The usual sizes as constants, so that their loops are unrolled.
    match (ny, nu) {
        (1, 1) => add_residual_covariance_of(c, f, 1, 1, scale, out),
        (2, 2) => add_residual_covariance_of(c, f, 2, 2, scale, out),
        _ => add_residual_covariance_of(c, f, ny, nu, scale, out),
    }
}

#[inline(always)]
fn add_residual_covariance_of(c: &[C64], f: &[C64], ny: usize, nu: usize, scale: f64, out: &mut [C64]) {
    let nz = ny + nu;
    let (c, f, out) = (&c[..nz * nz], &f[..ny * nu], &mut out[..ny * ny]);
    let at = |i: usize, j: usize| c[j * nz + i];
    for i in 0..ny {
        for k in 0..ny {
            let mut sum = at(i, k);
            for j in 0..nu {
                sum -= f[j * ny + i] * at(ny + j, k);
                sum -= at(i, ny + j) * f[j * ny + k].conj();
                for l in 0..nu {
                    sum += f[j * ny + i] * at(ny + j, ny + l) * f[l * ny + k].conj();
                }
            }
            out[k * ny + i] += sum * scale;
        }
    }
    // The four terms cancel where inputs and outputs share noise; rounding may leave a diagonal just below zero.
    for i in 0..ny {
        let d = &mut out[i * ny + i];
        *d = C64::new(d.re.max(0.0), 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn c(re: f64, im: f64) -> C64 {
        C64::new(re, im)
    }

    #[test]
    fn diagonal_experiments_by_hand() {
        // U = diag(2, 4j), X = I: A = U, G = diag(1/2, -j/4); orthogonal, so the condition number is 1.
        let mut k = GainKernel::new(2, 2);
        let u = [c(2.0, 0.0), ZERO, ZERO, c(0.0, 4.0)];
        let x = [c(1.0, 0.0), ZERO, ZERO, c(1.0, 0.0)];
        for instrument in [Some(&x[..]), None] {
            assert!((k.compute(&u, instrument) - 1.0).abs() < 1e-15);
            let expected = [c(0.5, 0.0), ZERO, ZERO, c(0.0, -0.25)];
            assert!(k.gain().iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-15));
        }
    }

    #[test]
    fn dependent_experiments_are_singular() {
        let mut k = GainKernel::new(2, 2);
        let u = [c(1.0, 1.0), c(2.0, 0.0), c(2.0, 2.0), c(4.0, 0.0)];
        assert!(k.compute(&u, None) > 1e12);
        assert_eq!(k.compute(&[ZERO; 4], None), f64::INFINITY);
        assert_eq!(k.compute(&[c(f64::NAN, 0.0); 4], None), f64::INFINITY);
    }

    #[test]
    fn two_rows_are_inverted_as_by_elimination() {
        let left = [c(0.3, -0.2), c(0.9, 0.1), c(-0.5, 0.8), c(0.1, 0.4)];
        let mut work = [ZERO; 8];
        [work[0], work[1], work[4], work[5]] = left;
        (work[2], work[7]) = (c(1.0, 0.0), c(1.0, 0.0));
        let mut other = work;
        cramer(&mut work);
        eliminate(&mut other, 2);
        for i in [2, 3, 6, 7] {
            assert!((work[i] - other[i]).norm() < 1e-15, "{} {}", work[i], other[i]);
        }
    }

    #[test]
    fn gain_is_a_right_inverse_of_the_inputs() {
        // U G = U X^H (U X^H)^-1 = I for three experiments and two inputs.
        let u: Vec<C64> = (0..6)
            .map(|i| C64::from_polar(1.0 + i as f64, (i * i) as f64))
            .collect();
        let x: Vec<C64> = (0..6)
            .map(|i| C64::from_polar(1.0, 0.7 * i as f64 + 0.1 * (i * i) as f64))
            .collect();
        let mut k = GainKernel::new(2, 3);
        assert!(k.compute(&u, Some(&x)).is_finite());
        for i in 0..2 {
            for j in 0..2 {
                let sum: C64 = (0..3).map(|e| u[e * 2 + i] * k.gain()[j * 3 + e]).sum();
                assert!((sum - if i == j { 1.0 } else { 0.0 }).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn residual_covariance_by_hand() {
        // y = f u + v with f = 2j, var u = 1, var v = 3: C = [4 + 3, 2j; -2j, 1].
        let cz = [c(7.0, 0.0), c(0.0, -2.0), c(0.0, 2.0), c(1.0, 0.0)];
        let mut out = [ZERO];
        add_residual_covariance(&cz, &[c(0.0, 2.0)], 1, 1, 0.5, &mut out);
        assert!((out[0] - 1.5).norm() < 1e-15);
    }
}
