//! Frequency responses over thousands of lines: one Hessenberg reduction a model, then O(n^2) a line.

use crate::linalg::finite;
use crate::{Clock, CoreError, Frf, StateSpace};
use nalgebra::{DMatrix, Hessenberg};
use num_complex::Complex;

/// A model reduced to Hessenberg form, ready to be evaluated at many points.
///
/// With `A = Q H Q^T`, the response is `C Q (z I - H)^-1 Q^T B + D`; `z I - H` is solved by elimination between
/// neighbouring rows with pivoting (Laub, IEEE TAC 26(2), 1981).
#[derive(Debug, Clone)]
pub struct ResponseKernel {
    h: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    work: Vec<Complex<f64>>,
    rhs: Vec<Complex<f64>>,
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
            work: vec![Complex::new(0.0, 0.0); n * n],
            rhs: vec![Complex::new(0.0, 0.0); n * system.inputs()],
            h,
        }
    }

    /// Writes the response at `point` into `out` (`n_y x n_u`, column-major). Returns false, with `out` unspecified,
    /// where the point is a pole: where elimination meets an exact zero or the response overflows. A pole that rounding
    /// has moved off the point gives a very large response instead.
    ///
    /// # Panics
    /// Never, if `out` has `n_y n_u` entries; a shorter slice is filled as far as it goes.
    pub fn evaluate(&mut self, point: Complex<f64>, out: &mut [Complex<f64>]) -> bool {
        let n = self.h.nrows();
        let (ny, nu) = self.d.shape();
        for i in 0..n {
            for j in i.saturating_sub(1)..n {
                self.work[i * n + j] = Complex::new(-self.h[(i, j)], 0.0);
            }
            self.work[i * n + i] += point;
            for j in 0..nu {
                self.rhs[i * nu + j] = Complex::new(self.b[(i, j)], 0.0);
            }
        }
        if !self.solve(n, nu) {
            return false;
        }
        for j in 0..nu {
            for i in 0..ny {
                let mut sum = Complex::new(self.d[(i, j)], 0.0);
                for k in 0..n {
                    sum += self.rhs[k * nu + j] * self.c[(i, k)];
                }
                if let Some(o) = out.get_mut(j * ny + i) {
                    *o = sum;
                }
            }
        }
        true
    }

    fn solve(&mut self, n: usize, nu: usize) -> bool {
        for k in 0..n {
            if k + 1 < n {
                let (top, bottom) = self.work.split_at_mut((k + 1) * n);
                let (row, next) = (&mut top[k * n..], &mut bottom[..n]);
                if next[k].l1_norm() > row[k].l1_norm() {
                    row[k..n].swap_with_slice(&mut next[k..n]);
                    for j in 0..nu {
                        self.rhs.swap(k * nu + j, (k + 1) * nu + j);
                    }
                }
                if row[k] == Complex::new(0.0, 0.0) {
                    return false;
                }
                let factor = next[k] / row[k];
                if factor != Complex::new(0.0, 0.0) {
                    for j in k + 1..n {
                        next[j] -= factor * row[j];
                    }
                    for j in 0..nu {
                        let above = self.rhs[k * nu + j];
                        self.rhs[(k + 1) * nu + j] -= factor * above;
                    }
                }
            } else if self.work[k * n + k] == Complex::new(0.0, 0.0) {
                return false;
            }
        }
        for k in (0..n).rev() {
            let inverse = self.work[k * n + k].inv();
            for j in 0..nu {
                let mut sum = self.rhs[k * nu + j];
                for l in k + 1..n {
                    sum -= self.work[k * n + l] * self.rhs[l * nu + j];
                }
                self.rhs[k * nu + j] = sum * inverse;
            }
        }
        self.rhs.iter().all(|v| v.re.is_finite() && v.im.is_finite())
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
        for (k, &frequency_hz) in frequencies_hz.iter().enumerate() {
            if !kernel.evaluate(self.clock().point(frequency_hz), frf.line_slice_mut(k)) {
                return Err(CoreError::PoleOnLine { frequency_hz });
            }
        }
        Ok(frf)
    }
}
