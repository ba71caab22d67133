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

    // Loops, here and below, since what takes a function is not always compiled for these registers.
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
        let mut square = zero.re;
        for j in 0..n {
            square = square + work[i * w + j].norm_sqr();
        }
        rows[i] = one / square.sqrt();
        for j in 0..n {
            work[i * w + j] = work[i * w + j] * rows[i];
            work[i * w + n + j] = zero;
        }
        work[i * w + n + i].re = one;
    }
    for j in 0..n {
        let mut square = zero.re;
        for i in 0..n {
            square = square + work[i * w + j].norm_sqr();
        }
        columns[j] = one / square.sqrt();
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
        for j in 0..n {
            square = square + work[i * w + n + j].norm_sqr();
        }
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
    y: &[ComplexLanes<S>],
    g: &[ComplexLanes<S>],
    ny: usize,
    ne: usize,
    f: &mut [ComplexLanes<S>],
) {
    for (column, out) in g.chunks_exact(ne).zip(f.chunks_exact_mut(ny)) {
        for i in 0..ny {
            let mut sum = y[i] * column[0];
            for e in 1..ne {
                sum += y[e * ny + i] * column[e];
            }
            out[i] = sum;
        }
    }
}

/// `scale [I -F] C [I -F]^H` into `out` (`n_y x n_y`), `C` Hermitian over outputs and then inputs.
#[inline(always)]
pub(crate) fn residual_covariance<S: Simd>(
    c: &[ComplexLanes<S>],
    f: &[ComplexLanes<S>],
    ny: usize,
    nu: usize,
    scale: Lanes<S>,
    out: &mut [ComplexLanes<S>],
) {
    // The usual sizes as constants, so that their loops are unrolled.
    match (ny, nu) {
        (1, 1) => residual_covariance_of(c, f, 1, 1, scale, out),
        (2, 2) => residual_covariance_of(c, f, 2, 2, scale, out),
        _ => residual_covariance_of(c, f, ny, nu, scale, out),
    }
}

#[inline(always)]
fn residual_covariance_of<S: Simd>(
    c: &[ComplexLanes<S>],
    f: &[ComplexLanes<S>],
    ny: usize,
    nu: usize,
    scale: Lanes<S>,
    out: &mut [ComplexLanes<S>],
) {
    let nz = ny + nu;
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
    let zero = scale.filled(0.0);
    for i in 0..ny {
        let d = &mut out[i * ny + i];
        d.re = d.re.max(zero);
        d.im = zero;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::write_lines;
    use num_complex::Complex;
    use pulp::Scalar;

    type C64 = Complex<f64>;
    const ZERO: C64 = C64::new(0.0, 0.0);

    fn c(re: f64, im: f64) -> C64 {
        C64::new(re, im)
    }

    fn lanes(values: &[C64]) -> Vec<ComplexLanes<Scalar>> {
        values.iter().copied().map(ComplexLanes::one).collect()
    }

    /// Gain and condition number of one line.
    fn gain(inputs: usize, experiments: usize, u: &[C64], x: Option<&[C64]>) -> (Vec<C64>, f64) {
        let mut kernel = GainKernel::new(Scalar::new(), inputs, experiments);
        let [condition, ..] = kernel.compute(&lanes(u), x.map(lanes).as_deref());
        (kernel.gain().iter().map(|g| g.value()).collect(), condition)
    }

    #[test]
    fn diagonal_experiments_by_hand() {
        // U = diag(2, 4j), X = I: A = U, G = diag(1/2, -j/4); orthogonal, so the condition number is 1.
        let u = [c(2.0, 0.0), ZERO, ZERO, c(0.0, 4.0)];
        let x = [c(1.0, 0.0), ZERO, ZERO, c(1.0, 0.0)];
        for instrument in [Some(&x[..]), None] {
            let (gain, condition) = gain(2, 2, &u, instrument);
            assert!((condition - 1.0).abs() < 1e-15);
            let expected = [c(0.5, 0.0), ZERO, ZERO, c(0.0, -0.25)];
            assert!(gain.iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-15));
        }
    }

    #[test]
    fn dependent_experiments_are_singular() {
        let u = [c(1.0, 1.0), c(2.0, 0.0), c(2.0, 2.0), c(4.0, 0.0)];
        assert!(gain(2, 2, &u, None).1 > 1e12);
        assert_eq!(gain(2, 2, &[ZERO; 4], None).1, f64::INFINITY);
        assert_eq!(gain(2, 2, &[c(f64::NAN, 0.0); 4], None).1, f64::INFINITY);
    }

    #[test]
    fn two_rows_are_inverted_as_by_elimination() {
        let left = [c(0.3, -0.2), c(0.9, 0.1), c(-0.5, 0.8), c(0.1, 0.4)];
        let mut work = [ZERO; 8];
        [work[0], work[1], work[4], work[5]] = left;
        (work[2], work[7]) = (c(1.0, 0.0), c(1.0, 0.0));
        let (mut one, mut other) = (lanes(&work), lanes(&work));
        cramer(&mut one);
        eliminate(&mut other, 2);
        for i in [2, 3, 6, 7] {
            let (one, other) = (one[i].value(), other[i].value());
            assert!((one - other).norm() < 1e-15, "{one} {other}");
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
        let (gain, condition) = gain(2, 3, &u, Some(&x));
        assert!(condition.is_finite());
        for i in 0..2 {
            for j in 0..2 {
                let sum: C64 = (0..3).map(|e| u[e * 2 + i] * gain[j * 3 + e]).sum();
                assert!((sum - if i == j { 1.0 } else { 0.0 }).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn residual_covariance_by_hand() {
        // y = f u + v with f = 2j, var u = 1, var v = 3: C = [4 + 3, 2j; -2j, 1].
        let cz = [c(7.0, 0.0), c(0.0, -2.0), c(0.0, 2.0), c(1.0, 0.0)];
        let mut out = lanes(&[ZERO]);
        let half = Lanes::splat(Scalar::new(), 0.5);
        residual_covariance(&lanes(&cz), &lanes(&[c(0.0, 2.0)]), 1, 1, half, &mut out);
        assert!((out[0].value() - 1.5).norm() < 1e-15);
    }

    #[test]
    fn lines_side_by_side_are_as_one_by_one() {
        // Four inputs, another pivot in each lane: the same bits.
        let entry = |line: usize, i: usize| {
            let x = (line * 16 + i) as f64;
            C64::from_polar(1.0 + (3.7 * x).sin(), x * x)
        };
        struct Together<F>(F);
        impl<F: Fn(usize, usize) -> C64> pulp::WithSimd for Together<F> {
            type Output = Vec<(Vec<C64>, f64)>;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                let part = |i: usize, of: fn(C64) -> f64| {
                    Lanes::new(simd, std::array::from_fn(|line| of(self.0(line, i))))
                };
                let u: Vec<ComplexLanes<S>> = (0..16)
                    .map(|i| ComplexLanes {
                        re: part(i, |z| z.re),
                        im: part(i, |z| z.im),
                    })
                    .collect();
                let mut kernel = GainKernel::new(simd, 4, 4);
                let conditions = kernel.compute(&u, None);
                let mut gains = vec![ZERO; 16 * S::F64_LANES];
                write_lines(kernel.gain(), &mut gains);
                let gains = gains.chunks_exact(16).map(<[C64]>::to_vec);
                gains.zip(conditions).collect()
            }
        }
        let all = pulp::Arch::new().dispatch(Together(entry));
        for (line, (found, condition)) in all.iter().enumerate() {
            let u: Vec<C64> = (0..16).map(|i| entry(line, i)).collect();
            assert_eq!((found.clone(), *condition), gain(4, 4, &u, None), "line {line}");
        }
    }
}
