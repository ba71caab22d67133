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

/// Value and rise per sample at the start of a signal, each with its deviation: through the first samples goes a polynomial, with what the
/// input makes of a mass or without, of the degree with the shortest description. An axis that starts abruptly is no polynomial; where
/// its input does not tell either, what is left of the samples makes the deviations large.
pub(super) fn beginning(y: &[f64], u: &[f64]) -> [(f64, f64); 2] {
    /// The highest degree, alone and beside the input.
    const DEGREES: [i32; 2] = [5, 3];
    let y = &y[..BEGINNING.min(y.len())];
    let first = unset(y);
    let y = &y[first..];
    let right = DVector::from_column_slice(y);
    let n = right.len();
    let pushed = pushed(u.get(first..).unwrap_or_default(), n);
    let mut best = (f64::INFINITY, [(y[0], 0.0), (0.0, 0.0)]);
    let ways = [None, pushed.as_ref()].into_iter().zip(DEGREES);
    for (pushed, degree) in ways.flat_map(|(pushed, most)| (1..=most).map(move |degree| (pushed, degree))) {
        let powers = degree as usize + 1;
        let terms = powers + usize::from(pushed.is_some());
        let rows = DMatrix::from_fn(n, terms, |k, j| match pushed {
            Some(pushed) if j == powers => pushed[k],
            _ => (k as f64 / n as f64).powi(j as i32),
        });
        let (Ok(found), Some(inverse)) = (
            least_squares(rows.clone(), &right, 1e-12),
            rows.tr_mul(&rows).try_inverse(),
        ) else {
            continue;
        };
        let left = (&right - &rows * &found).norm_squared().max(f64::MIN_POSITIVE);
        let length = n as f64 * left.ln() + terms as f64 * (n as f64).ln();
        if length < best.0 {
            let size = (left / n.saturating_sub(terms).max(1) as f64).sqrt();
            let deviation = |i: usize| size * inverse[(i, i)].max(0.0).sqrt();
            let rise = (found[1] / n as f64, deviation(1) / n as f64);
            best = (length, [(found[0], deviation(0)), rise]);
        }
    }
    best.1
}

/// The way of a mass under inputs that are held, from rest, with a largest value of one; none where they do nothing.
fn pushed(u: &[f64], n: usize) -> Option<Vec<f64>> {
    let (mut way, mut rise) = (0.0, 0.0);
    let mut all = Vec::with_capacity(n);
    for k in 0..n {
        all.push(way);
        let held = *u.get(k)?;
        way += rise + 0.5 * held;
        rise += held;
    }
    let largest = all.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    (largest > 0.0).then(|| all.iter().map(|v| v / largest).collect())
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
        let [(position, _), (rise, _)] = beginning(&y, &[]);
        assert!((position - 3e-5).abs() < 5e-9, "{position}");
        assert!((rise - 7e-6).abs() < 1e-9, "{rise}");
    }

    /// At rest, and in a steady motion four samples later: no polynomial is that, and the deviations say so.
    #[test]
    fn an_abrupt_beginning_is_known_less_well() {
        let y: Vec<f64> = (0..40)
            .map(|k| {
                let (k, late) = (f64::from(k), f64::from(k) - 2.0);
                if late < 0.0 {
                    1e-4 * k.powi(4)
                } else {
                    1e-4 * 16.0 + 3e-3 * late
                }
            })
            .collect();
        let [(position, of_position), (rise, of_rise)] = beginning(&y, &[]);
        // What is left is no noise: it is its size that counts.
        assert!(position.abs() < 6.0 * of_position, "{position} {of_position}");
        assert!(rise.abs() < 6.0 * of_rise && of_rise > 1e-4, "{rise} {of_rise}");
    }

    /// A mass of 3 that is at 0.2 with a rise of 1e-3, pushed hard in the third sample and held back by friction from then on.
    #[test]
    fn the_input_tells_an_abrupt_beginning() {
        let u: Vec<f64> = (0..40)
            .map(|k| if k == 2 { 9.0 } else { -0.01 * f64::from(k % 3) })
            .collect();
        let (mut x, mut v) = (0.2_f64, 1e-3);
        let mut y = Vec::new();
        for u in &u {
            y.push(x + 1e-9 * (1e3 * x).sin());
            let a = (u - 0.02) / 3.0;
            x += v + 0.5 * a;
            v += a;
        }
        let [(position, of_position), (rise, of_rise)] = beginning(&y, &u);
        assert!(
            (position - 0.2).abs() < 1e-8 && (rise - 1e-3).abs() < 1e-8,
            "{position} {rise}"
        );
        assert!(of_position < 1e-8 && of_rise < 1e-8);
        let [_, (rise, of_rise)] = beginning(&y, &[]);
        assert!(
            (rise - 1e-3).abs() < 6.0 * of_rise && of_rise > 1e-3,
            "{rise} {of_rise}"
        );
    }

    /// A logger whose first reading was not there yet; and an axis whose first steps of a coarse sensor are no such reading.
    #[test]
    fn a_first_reading_that_is_no_position() {
        for size in [1e-6, 1.0, 1e4] {
            let mut late = [-1.08 * size; 40];
            (late[0], late[1]) = (0.0, -0.97 * size);
            let [(position, _), (rise, _)] = beginning(&late, &[]);
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
