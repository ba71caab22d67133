//! Frequency responses over thousands of lines: one Hessenberg reduction a model, then O(n^2) a line.

use crate::linalg::finite;
use crate::{Clock, CoreError, Frf, StateSpace};
use nalgebra::{DMatrix, Hessenberg};
use num_complex::Complex;

/// A model reduced to Hessenberg form, ready to be evaluated at many points.
///
/// With `A = Q H Q^T`, the response is `C Q (z I - H)^-1 Q^T B + D`; `z I - H` is solved by elimination between
/// neighbouring rows with pivoting (Laub, IEEE TAC 26(2), 1981), for several points at a time, one in each lane of the
/// vector registers that the machine has. The result does not depend on how wide they are.
#[derive(Debug, Clone)]
pub struct ResponseKernel {
    h: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    work: Vec<Lanes>,
    rhs: Vec<Lanes>,
    arch: pulp::Arch,
}

impl ResponseKernel {
    /// One reduction of `A`.
    pub fn new<K: Clock>(system: &StateSpace<K>) -> Self {
        let n = system.states();
        let (q, h) = if n > 1 {
            Hessenberg::new(system.a().clone()).unpack()
        } else {
            (DMatrix::identity(n, n), system.a().clone())
        };
        Self {
            b: q.transpose() * system.b(),
            c: system.c() * &q,
            d: system.d().clone(),
            work: vec![Lanes::ZERO; n * n],
            rhs: vec![Lanes::ZERO; n * system.inputs()],
            arch: pulp::Arch::new(),
            h,
        }
    }

    /// Writes the response at each of `points` into `out`, point after point, `n_y x n_u` each, column-major.
    ///
    /// # Errors
    /// The index of the first point that is a pole: where elimination meets an exact zero or the response overflows; from
    /// there on `out` is unspecified. A pole that rounding has moved off the point gives a very large response instead.
    ///
    /// # Panics
    /// Never, if `out` has `n_y n_u` entries a point; a shorter slice is filled as far as it goes.
    pub fn evaluate(&mut self, points: &[Complex<f64>], out: &mut [Complex<f64>]) -> Result<(), usize> {
        let size = self.d.len();
        let arch = self.arch;
        for (block, points) in points.chunks(LANES).enumerate() {
            let from = (block * LANES * size).min(out.len());
            let out = &mut out[from..];
            let poles = arch.dispatch(|| self.block(points, out));
            if let Some(lane) = poles[..points.len()].iter().position(|pole| *pole) {
                return Err(block * LANES + lane);
            }
        }
        Ok(())
    }

    /// The response at as many points as there are lanes, or fewer; which of them are poles.
    #[inline(always)]
    fn block(&mut self, points: &[Complex<f64>], out: &mut [Complex<f64>]) -> [bool; LANES] {
        let n = self.h.nrows();
        let (ny, nu) = self.d.shape();
        let z = Lanes::of(points);
        for i in 0..n {
            for j in i.saturating_sub(1)..n {
                self.work[i * n + j] = Lanes::real(-self.h[(i, j)]);
            }
            self.work[i * n + i].add(&z);
            for j in 0..nu {
                self.rhs[i * nu + j] = Lanes::real(self.b[(i, j)]);
            }
        }
        self.solve(n, nu);
        for j in 0..nu {
            for i in 0..ny {
                let mut sum = Lanes::real(self.d[(i, j)]);
                for k in 0..n {
                    sum.add_scaled(&self.rhs[k * nu + j], self.c[(i, k)]);
                }
                for lane in 0..points.len() {
                    if let Some(o) = out.get_mut(lane * ny * nu + j * ny + i) {
                        *o = Complex::new(sum.re[lane], sum.im[lane]);
                    }
                }
            }
        }
        let mut poles = [false; LANES];
        for v in &self.rhs {
            for lane in 0..LANES {
                poles[lane] |= !(v.re[lane].is_finite() && v.im[lane].is_finite());
            }
        }
        poles
    }

    #[inline(always)]
    fn solve(&mut self, n: usize, nu: usize) {
        for k in 0..n.saturating_sub(1) {
            let (top, bottom) = self.work.split_at_mut((k + 1) * n);
            let (row, next) = (&mut top[k * n + k..], &mut bottom[k..n]);
            let (above, below) = self.rhs.split_at_mut((k + 1) * nu);
            let (above, below) = (&mut above[k * nu..], &mut below[..nu]);
            let larger = next[0].exceeds(&row[0]);
            if larger.contains(&true) {
                let rows = row.iter_mut().zip(next.iter_mut());
                for (one, other) in rows.chain(above.iter_mut().zip(below.iter_mut())) {
                    Lanes::swap_where(&larger, one, other);
                }
            }
            let factor = next[0].over(&row[0]);
            for (next, row) in next[1..].iter_mut().zip(&row[1..]) {
                next.subtract_product(&factor, row);
            }
            for (below, above) in below.iter_mut().zip(above.iter()) {
                below.subtract_product(&factor, above);
            }
        }
        for k in (0..n).rev() {
            let inverse = Lanes::real(1.0).over(&self.work[k * n + k]);
            let (known, solved) = self.rhs.split_at_mut((k + 1) * nu);
            for j in 0..nu {
                let sum = &mut known[k * nu + j];
                for l in k + 1..n {
                    sum.subtract_product(&self.work[k * n + l], &solved[(l - k - 1) * nu + j]);
                }
                *sum = sum.times(&inverse);
            }
        }
    }
}

/// Points that are solved for together: one or more registers, of whatever width.
const LANES: usize = 8;

/// One complex number of each point.
#[derive(Debug, Clone, Copy)]
struct Lanes {
    re: [f64; LANES],
    im: [f64; LANES],
}

impl Lanes {
    const ZERO: Self = Self {
        re: [0.0; LANES],
        im: [0.0; LANES],
    };

    /// The last point fills the lanes that are left.
    #[inline(always)]
    fn of(points: &[Complex<f64>]) -> Self {
        let at = |lane: usize| points[lane.min(points.len() - 1)];
        Self {
            re: std::array::from_fn(|lane| at(lane).re),
            im: std::array::from_fn(|lane| at(lane).im),
        }
    }
    #[inline(always)]
    fn real(v: f64) -> Self {
        Self {
            re: [v; LANES],
            ..Self::ZERO
        }
    }
    #[inline(always)]
    fn add(&mut self, other: &Self) {
        self.add_scaled(other, 1.0);
    }
    #[inline(always)]
    fn add_scaled(&mut self, other: &Self, factor: f64) {
        for l in 0..LANES {
            self.re[l] += other.re[l] * factor;
            self.im[l] += other.im[l] * factor;
        }
    }
    #[inline(always)]
    fn subtract_product(&mut self, a: &Self, b: &Self) {
        for l in 0..LANES {
            self.re[l] -= a.re[l] * b.re[l] - a.im[l] * b.im[l];
            self.im[l] -= a.re[l] * b.im[l] + a.im[l] * b.re[l];
        }
    }
    #[inline(always)]
    fn times(&self, other: &Self) -> Self {
        let mut product = Self::ZERO;
        for l in 0..LANES {
            product.re[l] = self.re[l] * other.re[l] - self.im[l] * other.im[l];
            product.im[l] = self.re[l] * other.im[l] + self.im[l] * other.re[l];
        }
        product
    }
    #[inline(always)]
    fn over(&self, other: &Self) -> Self {
        let mut ratio = Self::ZERO;
        for l in 0..LANES {
            let (a, b, c, d) = (self.re[l], self.im[l], other.re[l], other.im[l]);
            let square = c * c + d * d;
            ratio.re[l] = (a * c + b * d) / square;
            ratio.im[l] = (b * c - a * d) / square;
        }
        ratio
    }
    /// Where it is larger, by the sum of the absolute values of its parts.
    #[inline(always)]
    fn exceeds(&self, other: &Self) -> [bool; LANES] {
        let size = |v: &Self, l: usize| v.re[l].abs() + v.im[l].abs();
        std::array::from_fn(|l| size(self, l) > size(other, l))
    }
    #[inline(always)]
    fn swap_where(mask: &[bool; LANES], one: &mut Self, other: &mut Self) {
        let (a, b) = (*one, *other);
        for l in 0..LANES {
            one.re[l] = if mask[l] { b.re[l] } else { a.re[l] };
            one.im[l] = if mask[l] { b.im[l] } else { a.im[l] };
            other.re[l] = if mask[l] { a.re[l] } else { b.re[l] };
            other.im[l] = if mask[l] { a.im[l] } else { b.im[l] };
        }
    }
}

impl<K: Clock> StateSpace<K> {
    /// The frequency response at frequencies in cycles per unit of time.
    ///
    /// # Errors
    /// [`CoreError::Frequency`] for a frequency that is negative, not finite, not increasing or above Nyquist;
    /// [`CoreError::PoleOnLine`] where the response is infinite.
    pub fn frequency_response(&self, frequencies_hz: &[f64]) -> Result<Frf, CoreError> {
        let limit = self.clock().nyquist_hz() * (1.0 + 1e-12);
        if let Some(index) = frequencies_hz.iter().position(|&f| f > limit) {
            return Err(CoreError::Frequency {
                index,
                value_hz: frequencies_hz[index],
                problem: "above the Nyquist frequency of the model",
            });
        }
        finite("frequency response: A", self.a())?;
        let mut frf = Frf::zeros(frequencies_hz.to_vec(), self.outputs(), self.inputs())?;
        let mut kernel = ResponseKernel::new(self);
        let points: Vec<Complex<f64>> = frequencies_hz.iter().map(|&f| self.clock().point(f)).collect();
        match kernel.evaluate(&points, frf.values_mut()) {
            Ok(()) => Ok(frf),
            Err(at) => Err(CoreError::PoleOnLine {
                frequency_hz: frequencies_hz[at],
            }),
        }
    }
}
