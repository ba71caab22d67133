//! Running mean and scatter of complex vectors over all lines (Welford's update).
//!
//! The noise is some 1e-4 of the signal. A sum of squares would lose eight of sixteen digits to the signal; the update
//! on deviations from the running mean loses none.

use num_complex::Complex;
use pulp::{Simd, WithSimd};

type C64 = Complex<f64>;

/// Lines worked on at once, so that the deviations stay in the fastest cache.
const CHUNK: usize = 256;

/// Mean and scatter `sum_m (Z_m - mean)(Z_m - mean)^H` of `channels` spectra over `lines` lines.
///
/// Real and imaginary parts stand in planes of their own, one plane a channel or pair, so that the loops over lines
/// vectorise.
#[derive(Debug, Clone)]
pub(crate) struct Moments {
    channels: usize,
    lines: usize,
    count: usize,
    mean: Vec<f64>,
    /// Planes of the pairs `(i, j)`, `i <= j`: real part and, off the diagonal, imaginary part.
    scatter: Vec<f64>,
    deviation: Vec<f64>,
}

/// Observations to be added, in the registers of one kind of machine.
struct Observations<'a> {
    sums: &'a mut Moments,
    planes: &'a [f64],
}

impl WithSimd for Observations<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        self.sums.add(self.planes);
    }
}

impl Moments {
    pub(crate) fn new(channels: usize, lines: usize) -> Self {
        Self {
            channels,
            lines,
            count: 0,
            mean: vec![0.0; 2 * channels * lines],
            scatter: vec![0.0; channels * channels * lines],
            deviation: vec![0.0; 2 * channels * CHUNK],
        }
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Takes observations, one after the other: of each the planes `re, im` of channel 0, then of channel 1, and so on. What is kept
    /// is read and written once for all of them.
    pub(crate) fn push(&mut self, planes: &[f64]) {
        pulp::Arch::new().dispatch(Observations { sums: self, planes });
    }

    #[inline(always)]
    fn add(&mut self, planes: &[f64]) {
        let size = (2 * self.channels * self.lines).max(1);
        let before = self.count;
        for start in (0..self.lines).step_by(CHUNK) {
            for (m, planes) in planes.chunks_exact(size).enumerate() {
                self.add_chunk(planes, start, before + m + 1);
            }
        }
        self.count += planes.len() / size;
    }

    /// Lines from `start` of the observation that makes `count`.
    #[inline(always)]
    fn add_chunk(&mut self, planes: &[f64], start: usize, count: usize) {
        let inverse = 1.0 / count as f64;
        let weight = 1.0 - inverse;
        let lines = self.lines;
        let width = CHUNK.min(lines - start);
        for plane in 0..2 * self.channels {
            let range = plane * lines + start..plane * lines + start + width;
            let z = &planes[range.clone()];
            let mean = &mut self.mean[range];
            let d = &mut self.deviation[plane * CHUNK..plane * CHUNK + width];
            for ((d, m), z) in d.iter_mut().zip(mean).zip(z) {
                *d = z - *m;
                *m += *d * inverse;
            }
        }
        if count == 1 {
            return;
        }
        let part = |c: usize, p: usize| {
            let at = (2 * c + p) * CHUNK;
            &self.deviation[at..at + width]
        };
        let mut plane = 0;
        for i in 0..self.channels {
            let (ar, ai) = (part(i, 0), part(i, 1));
            let at = plane * lines + start;
            for ((s, a), b) in self.scatter[at..at + width].iter_mut().zip(ar).zip(ai) {
                *s += weight * (a * a + b * b);
            }
            plane += 1;
            for j in i + 1..self.channels {
                let (br, bi) = (part(j, 0), part(j, 1));
                let at = plane * lines + start;
                let (re, im) = self.scatter[at..at + lines + width].split_at_mut(lines);
                for l in 0..width {
                    re[l] += weight * (ar[l] * br[l] + ai[l] * bi[l]);
                    im[l] += weight * (ai[l] * br[l] - ar[l] * bi[l]);
                }
                plane += 2;
            }
        }
    }

    /// Mean of one channel at line `l` (from 0).
    pub(crate) fn mean(&self, channel: usize, l: usize) -> C64 {
        let at = 2 * channel * self.lines + l;
        C64::new(self.mean[at], self.mean[at + self.lines])
    }

    /// Adds the scatter of line `l` to a Hermitian `channels x channels` matrix, column-major.
    pub(crate) fn add_scatter(&self, l: usize, out: &mut [C64]) {
        let n = self.channels;
        let mut at = l;
        for i in 0..n {
            out[i * n + i].re += self.scatter[at];
            at += self.lines;
            for j in i + 1..n {
                let s = C64::new(self.scatter[at], self.scatter[at + self.lines]);
                out[j * n + i] += s;
                out[i * n + j] += s.conj();
                at += 2 * self.lines;
            }
        }
    }

    /// Scatter of one channel at line `l`.
    pub(crate) fn scatter_diagonal(&self, channel: usize, l: usize) -> f64 {
        // Rows of the upper triangle before this one: one real plane and two for each entry right of the diagonal.
        let n = self.channels;
        let before: usize = (0..channel).map(|i| 1 + 2 * (n - 1 - i)).sum();
        self.scatter[before * self.lines + l]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_two_pass_formula_under_a_large_offset() {
        // Three observations by hand: z = 1e6 + {0, 3, 6}, w = 1e6 j + {j, 0, -j}.
        let mut m = Moments::new(2, 1);
        for (a, b) in [(0.0, 1.0), (3.0, 0.0), (6.0, -1.0)] {
            m.push(&[1e6 + a, 0.0, 0.0, 1e6 + b]);
        }
        assert_eq!(m.mean(0, 0), C64::new(1e6 + 3.0, 0.0));
        assert_eq!(m.mean(1, 0), C64::new(0.0, 1e6));
        let mut s = [C64::new(0.0, 0.0); 4];
        m.add_scatter(0, &mut s);
        // sum (z - mean) conj(w - mean) = (-3)(-j) + 0 + (3)(j) = 6j.
        let expected = [
            C64::new(18.0, 0.0),
            C64::new(0.0, -6.0),
            C64::new(0.0, 6.0),
            C64::new(2.0, 0.0),
        ];
        for (a, b) in s.iter().zip(expected) {
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
        assert!((m.scatter_diagonal(1, 0) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn planes_beyond_one_chunk_are_alike() {
        let lines = 2 * CHUNK + 3;
        let mut m = Moments::new(3, lines);
        for k in 0..4 {
            let planes: Vec<f64> = (0..6 * lines)
                .map(|i| ((i / lines * 7 + k * 3) % 5) as f64)
                .collect();
            m.push(&planes);
        }
        let mut first = [C64::new(0.0, 0.0); 9];
        m.add_scatter(0, &mut first);
        for l in 1..lines {
            let mut s = [C64::new(0.0, 0.0); 9];
            m.add_scatter(l, &mut s);
            assert_eq!(s, first);
        }
        assert!(first[0].re > 0.0);
    }
}
