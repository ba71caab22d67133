//! Where a record begins, as its first samples tell.

use super::Track;
use crate::base::Pair;
use lpv_core::linalg::least_squares;
use lpv_numerics::statistics::range;
use nalgebra::{DMatrix, DVector};

/// Samples that tell how a record begins.
pub(super) const BEGINNING: usize = 16;

/// The first readings that are no positions, at most two: an axis does not leap further than it moves in all the next ones together.
/// One step of a coarse sensor is no leap.
fn unset(y: &[f64]) -> usize {
    const LEAP: f64 = 5.0;
    const STEPS: f64 = 3.0;
    let changes = y.windows(2).map(|w| (w[1] - w[0]).abs());
    let step = changes.filter(|c| *c > 0.0).fold(f64::INFINITY, f64::min);
    let leaps = |first: &usize| {
        let (low, high) = range(&y[*first..]);
        let far = |v: &f64| (v - y[*first]).abs() > (LEAP * (high - low)).max(STEPS * step);
        far(&y[0])
    };
    (1..=2).rev().filter(|n| *n < y.len()).find(leaps).unwrap_or(0)
}

/// Value and rise per sample at the start of a signal: a polynomial through the first samples, of the degree with the shortest
/// description.
pub(super) fn beginning(y: &[f64]) -> [f64; 2] {
    /// The highest degree.
    const DEGREE: i32 = 5;
    let y = &y[..BEGINNING.min(y.len())];
    let y = &y[unset(y)..];
    let right = DVector::from_column_slice(y);
    let n = right.len();
    let mut best = (f64::INFINITY, [y[0], 0.0]);
    for degree in 1..=DEGREE {
        let rows = DMatrix::from_fn(n, degree as usize + 1, |k, j| {
            (k as f64 / n as f64).powi(j as i32)
        });
        let Ok(found) = least_squares(rows.clone(), &right, 1e-12) else {
            continue;
        };
        let left = (&right - rows * &found).norm_squared().max(f64::MIN_POSITIVE);
        let length = n as f64 * left.ln() + f64::from(degree + 1) * (n as f64).ln();
        if length < best.0 {
            best = (length, [found[0], found[1] / n as f64]);
        }
    }
    best.1
}

impl Track {
    /// What was measured beside what was simulated, by sample. Of a record that may begin [anywhere](Self::anywhere) it is what the likeliest
    /// beginning leaves.
    pub(crate) fn error(&self, found: &[Pair]) -> Vec<Pair> {
        let gap = |(a, b): (&Pair, &Pair)| [a[0] - b[0], a[1] - b[1]];
        let mut error: Vec<Pair> = self.outputs.iter().zip(found).map(gap).collect();
        for column in &self.free {
            let part: f64 = column.iter().zip(&error).map(|(c, e)| c * e[0]).sum();
            for (e, c) in error.iter_mut().zip(column) {
                e[0] -= part * c;
            }
        }
        error
    }

    /// The same record that may begin anywhere: with what changes of its first output and of its first rate make of the error along it.
    pub(crate) fn anywhere(&self, changes: [DVector<f64>; 2]) -> Self {
        let mut free: Vec<DVector<f64>> = Vec::new();
        for mut column in changes {
            for other in &free {
                let part = other.dot(&column);
                column.axpy(-part, other, 1.0);
            }
            free.extend(column.try_normalize(0.0));
        }
        Self { free, ..self.clone() }
    }

    /// Whether it may begin anywhere.
    pub(crate) fn is_free(&self) -> bool {
        !self.free.is_empty()
    }

    /// The same record that is held to where it begins.
    pub(crate) fn held_to_its_beginning(&self) -> Self {
        Self {
            free: Vec::new(),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::beginning;

    /// `3e-5 + 7e-3 t + 0.45 t^2` sampled with 1 kHz, with a ripple of 1e-9.
    #[test]
    fn a_beginning_in_motion() {
        let y: Vec<f64> = (0..40)
            .map(|k| 1e-3 * f64::from(k))
            .map(|t| 3e-5 + 7e-3 * t + 0.45 * t * t + 1e-9 * (3e3 * t).sin())
            .collect();
        let [position, rise] = beginning(&y);
        assert!((position - 3e-5).abs() < 5e-9, "{position}");
        assert!((rise - 7e-6).abs() < 1e-9, "{rise}");
    }

    /// A logger whose first reading was not there yet; and an axis whose first steps of a coarse sensor are no such reading.
    #[test]
    fn a_first_reading_that_is_no_position() {
        for size in [1e-6, 1.0, 1e4] {
            let mut late = [-1.08 * size; 40];
            (late[0], late[1]) = (0.0, -0.97 * size);
            let [position, rise] = beginning(&late);
            assert!((position + 1.08 * size).abs() < 1e-9 * size && rise.abs() < 1e-9 * size);
            let coarse: Vec<f64> = (0..40)
                .map(|k| size * (0.02 * f64::from(k * k)).round())
                .collect();
            assert_eq!(super::unset(&coarse[..16]), 0);
            let step: Vec<f64> = (0..40).map(|k| if k == 0 { 0.0 } else { size }).collect();
            assert_eq!(super::unset(&step[..16]), 0);
        }
    }
}
