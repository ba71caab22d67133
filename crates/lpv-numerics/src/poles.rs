//! What a sampled pole is: an oscillation with its deviations, and a partial fraction on the lines.

use nalgebra::Matrix2;
use num_complex::Complex;

type C64 = Complex<f64>;

/// A sampled pole as an oscillation: `z = exp(s T)`, `s = w (-d + j sqrt(1 - d^2))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillation {
    /// Natural frequency `|s| / (2 pi)`, Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_deviation_hz: f64,
    /// Damping ratio `-Re s / |s|`.
    pub damping: f64,
    /// Its standard deviation.
    pub damping_deviation: f64,
}

impl Oscillation {
    /// Of a pole z with the covariance of its real and imaginary part, and the sample time in seconds.
    #[must_use]
    pub fn new(z: C64, covariance: &Matrix2<f64>, sample_time: f64) -> Self {
        let s = z.ln();
        let size = s.norm();
        // ds = dz / z; rows of the Jacobian of (|s|, -Re s / |s|) with respect to (Re z, Im z).
        let (dx, dy) = (z.inv(), C64::i() / z);
        let slope = |d: C64| {
            let growth = (s.conj() * d).re / size;
            (growth, -d.re / size + s.re * growth / (size * size))
        };
        let ((fx, gx), (fy, gy)) = (slope(dx), slope(dy));
        let deviation = |x: f64, y: f64| {
            let c = covariance;
            (c[(0, 0)] * x * x + 2.0 * c[(0, 1)] * x * y + c[(1, 1)] * y * y)
                .max(0.0)
                .sqrt()
        };
        let to_hz = 1.0 / (std::f64::consts::TAU * sample_time);
        Self {
            frequency_hz: size * to_hz,
            frequency_deviation_hz: deviation(fx, fy) * to_hz,
            damping: -s.re / size,
            damping_deviation: deviation(gx, gy),
        }
    }
}

/// Partial fractions with real coefficients, on the points z: `1 / (z - l)` of a real pole; of a complex one, with its conjugate, the
/// sum of both and j times their difference. The poles are one of each pair.
#[must_use]
pub fn partial_fractions(z: &[C64], poles: &[C64]) -> Vec<Vec<C64>> {
    let mut all = Vec::new();
    for &l in poles {
        let own = z.iter().map(|z| (z - l).inv());
        if l.im == 0.0 {
            all.push(own.collect());
            continue;
        }
        let other = || z.iter().map(|z| (z - l.conj()).inv());
        all.push(own.clone().zip(other()).map(|(a, b)| a + b).collect());
        all.push(own.zip(other()).map(|(a, b)| C64::i() * (a - b)).collect());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillation_meets_finite_differences() {
        for z in [C64::new(0.9, 0.3), C64::new(0.2, 0.95), C64::new(0.999, 1e-3)] {
            let of = |z: C64| Oscillation::new(z, &Matrix2::zeros(), 0.01);
            for (step, entry) in [(C64::from(1e-7), (0, 0)), (C64::new(0.0, 1e-7), (1, 1))] {
                let mut covariance = Matrix2::zeros();
                covariance[entry] = 1.0;
                let found = Oscillation::new(z, &covariance, 0.01);
                let (more, less) = (of(z + step), of(z - step));
                let frequency = (more.frequency_hz - less.frequency_hz).abs() / 2e-7;
                let damping = (more.damping - less.damping).abs() / 2e-7;
                assert!((found.frequency_deviation_hz - frequency).abs() <= 1e-5 * frequency.max(1.0));
                assert!((found.damping_deviation - damping).abs() <= 1e-5 * damping.max(1.0));
            }
        }
    }
}
