//! Running means of complex vectors over all lines, and the scatter about them, a few observations at a time.
//!
//! The noise is some 1e-4 of the signal. A sum of squares would lose eight of sixteen digits to the signal; the update
//! on deviations from the running mean loses none (\[chan1983\], there as a difference of two sums).
//!
//! With `n` observations of mean `m` before, `k` new ones `z_i` and `d_i = z_i - m`, `s = sum d_i`, the mean moves by
//! `s / (n + k)` and the scatter grows by `sum d_i d_i^H - s s^H / (n + k)`, which is `sum e_i e_i^H` of
//! `e_i = d_i - s / (n + k + sqrt(n (n + k)))`: squares alone.

use num_complex::Complex;
use pulp::{Simd, WithSimd};

type C64 = Complex<f64>;

/// Observations that are taken up together: what is kept is larger than the caches, and read and written once for all of
/// them. With more than two, the spectra that wait would leave the caches too.
pub(crate) const TOGETHER: usize = 2;

/// Lines worked on at once, so that the deviations stay in the fastest cache.
const CHUNK: usize = 64;

/// One real or imaginary part of the lines worked on.
type Part = [f64; CHUNK];

/// Zeros that, as the compiler treats this today, stand in memory. Those that are only promised are mapped at the first reading and
/// copied at the first writing, and such a copy stops all threads.
fn written_zeros(count: usize) -> Vec<f64> {
    let mut zeros = Vec::with_capacity(count);
    zeros.resize(count, 0.0);
    zeros
}

/// Mean of `channels` spectra over `lines` lines, a plane of real parts and one of imaginary parts a channel. Observations are
/// spectra of some size each, channel after channel, with the lines from index 1 on.
#[derive(Debug, Clone)]
pub(crate) struct Means {
    channels: usize,
    lines: usize,
    count: usize,
    planes: Vec<f64>,
}

impl Means {
    pub(crate) fn new(channels: usize, lines: usize) -> Self {
        Self {
            channels,
            lines,
            count: 0,
            planes: written_zeros(2 * channels * lines),
        }
    }

    /// Observations so far.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Takes one observation, of which nothing but the mean is kept.
    pub(crate) fn push(&mut self, spectra: &[C64]) {
        self.count += 1;
        let inverse = 1.0 / self.count as f64;
        let size = (spectra.len() / self.channels.max(1)).max(1);
        let means = self.planes.chunks_exact_mut(2 * self.lines.max(1));
        for (z, mean) in spectra.chunks_exact(size).zip(means) {
            let (re, im) = mean.split_at_mut(self.lines);
            for ((z, re), im) in z[1..].iter().zip(re).zip(im) {
                *re += (z.re - *re) * inverse;
                *im += (z.im - *im) * inverse;
            }
        }
    }

    /// That of one channel at line `l` (from 0).
    pub(crate) fn at(&self, channel: usize, l: usize) -> C64 {
        let at = 2 * channel * self.lines + l;
        C64::new(self.planes[at], self.planes[at + self.lines])
    }
}

/// Scatter `sum_m (Z_m - mean)(Z_m - mean)^H` of spectra about the mean of their experiment, over all lines and summed over
/// the experiments.
#[derive(Debug, Clone)]
pub(crate) struct Scatter {
    channels: usize,
    /// Lines of a plane: whole chunks.
    stride: usize,
    /// Planes of the pairs `(i, j)`, `i <= j`: real part and, off the diagonal, imaginary part.
    planes: Vec<f64>,
    /// Of the lines worked on, by channel and observation: real and imaginary part.
    deviations: Vec<[Part; 2]>,
}

/// Observations to be added, in the registers of one kind of machine.
struct Observations<'a> {
    scatter: &'a mut Scatter,
    mean: &'a mut Means,
    spectra: &'a [C64],
    count: usize,
}

impl WithSimd for Observations<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            scatter,
            mean,
            spectra,
            count,
        } = self;
        match count {
            0 => (),
            TOGETHER => scatter.add::<TOGETHER>(mean, spectra),
            // The rest of an experiment.
            _ => {
                let each = spectra.chunks_exact(spectra.len() / count);
                each.for_each(|one| scatter.add::<1>(mean, one));
            }
        }
    }
}

impl Scatter {
    pub(crate) fn new(channels: usize, lines: usize) -> Self {
        let stride = lines.next_multiple_of(CHUNK);
        Self {
            channels,
            stride,
            planes: written_zeros(channels * channels * stride),
            deviations: vec![[[0.0; CHUNK]; 2]; TOGETHER * channels],
        }
    }

    /// Takes `count` observations of one experiment, at most [`TOGETHER`]; its mean goes along.
    pub(crate) fn push(&mut self, mean: &mut Means, spectra: &[C64], count: usize) {
        pulp::Arch::new().dispatch(Observations {
            scatter: self,
            mean,
            spectra,
            count,
        });
    }

    #[inline(always)]
    fn add<const COUNT: usize>(&mut self, mean: &mut Means, spectra: &[C64]) {
        let (before, all) = (mean.count as f64, (mean.count + COUNT) as f64);
        let (step, share) = (1.0 / all, 1.0 / (all + (before * all).sqrt()));
        let lines = mean.lines;
        let size = spectra.len() / (COUNT * self.channels);
        for start in (0..lines).step_by(CHUNK) {
            let width = CHUNK.min(lines - start);
            for channel in 0..self.channels {
                let plane = &mut mean.planes[2 * channel * lines..][..2 * lines];
                let (re, im) = plane.split_at_mut(lines);
                let (re, im) = (&mut re[start..start + width], &mut im[start..start + width]);
                let out = &mut self.deviations[channel * TOGETHER..][..COUNT];
                let (mut sum_re, mut sum_im) = ([0.0; CHUNK], [0.0; CHUNK]);
                for (m, [a, b]) in out.iter_mut().enumerate() {
                    let from = (m * self.channels + channel) * size + 1 + start;
                    let z = &spectra[from..from + width];
                    for l in 0..width {
                        a[l] = z[l].re - re[l];
                        b[l] = z[l].im - im[l];
                        sum_re[l] += a[l];
                        sum_im[l] += b[l];
                    }
                }
                for l in 0..width {
                    re[l] += step * sum_re[l];
                    im[l] += step * sum_im[l];
                }
                for [a, b] in out {
                    for l in 0..CHUNK {
                        a[l] -= share * sum_re[l];
                        b[l] -= share * sum_im[l];
                    }
                    // Lines beyond the last one have no deviation.
                    a[width..].fill(0.0);
                    b[width..].fill(0.0);
                }
            }
            self.add_products::<COUNT>(start);
        }
        mean.count += COUNT;
    }

    /// Products of the deviations of the chunk at `start`.
    #[inline(always)]
    fn add_products<const COUNT: usize>(&mut self, start: usize) {
        let of = |channel: usize| -> [&[Part; 2]; COUNT] {
            std::array::from_fn(|m| &self.deviations[channel * TOGETHER + m])
        };
        let stride = self.stride;
        let mut plane = 0;
        for i in 0..self.channels {
            let a = of(i);
            let sums = &mut self.planes[plane * stride + start..][..CHUNK];
            for l in 0..CHUNK {
                let mut sum = sums[l];
                for [re, im] in a {
                    sum += re[l] * re[l] + im[l] * im[l];
                }
                sums[l] = sum;
            }
            plane += 1;
            for j in i + 1..self.channels {
                let b = of(j);
                let (real, imaginary) = self.planes[plane * stride + start..].split_at_mut(stride);
                let (real, imaginary) = (&mut real[..CHUNK], &mut imaginary[..CHUNK]);
                for l in 0..CHUNK {
                    let (mut x, mut y) = (real[l], imaginary[l]);
                    for m in 0..COUNT {
                        let ([ar, ai], [br, bi]) = (a[m], b[m]);
                        x += ar[l] * br[l] + ai[l] * bi[l];
                        y += ai[l] * br[l] - ar[l] * bi[l];
                    }
                    real[l] = x;
                    imaginary[l] = y;
                }
                plane += 2;
            }
        }
    }

    /// That of line `l` (from 0), a Hermitian `channels x channels` matrix, column-major.
    pub(crate) fn at(&self, l: usize, out: &mut [C64]) {
        let n = self.channels;
        let mut at = l;
        for i in 0..n {
            out[i * n + i] = C64::new(self.planes[at], 0.0);
            at += self.stride;
            for j in i + 1..n {
                let s = C64::new(self.planes[at], self.planes[at + self.stride]);
                out[j * n + i] = s;
                out[i * n + j] = s.conj();
                at += 2 * self.stride;
            }
        }
    }

    /// That of one channel at line `l`.
    pub(crate) fn diagonal(&self, channel: usize, l: usize) -> f64 {
        // Rows of the upper triangle before this one: one real plane and two for each entry right of the diagonal.
        let n = self.channels;
        let before: usize = (0..channel).map(|i| 1 + 2 * (n - 1 - i)).sum();
        self.planes[before * self.stride + l]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_two_pass_formula_under_a_large_offset() {
        // Five observations by hand: z = 1e6 + {0, 3, 6, 3, 3}, w = 1e6 j + {j, 0, -j, 0, 0}.
        let zero = C64::new(0.0, 0.0);
        let z = |(a, b): (f64, f64)| [zero, C64::new(1e6 + a, 0.0), zero, C64::new(0.0, 1e6 + b)];
        let all = [(0.0, 1.0), (3.0, 0.0), (6.0, -1.0), (3.0, 0.0), (3.0, 0.0)].map(z);
        // One after the other, or as many together as there may be, and a rest.
        for parts in [
            vec![1; 5],
            vec![TOGETHER, TOGETHER, 1],
            vec![1, TOGETHER, TOGETHER],
            vec![3, 2],
        ] {
            let (mut mean, mut scatter) = (Means::new(2, 1), Scatter::new(2, 1));
            let mut left = &all[..];
            for part in parts {
                scatter.push(&mut mean, left[..part].as_flattened(), part);
                left = &left[part..];
            }
            assert_eq!(mean.count(), 5);
            assert!((mean.at(0, 0) - (1e6 + 3.0)).norm() < 1e-9);
            assert!((mean.at(1, 0) - C64::new(0.0, 1e6)).norm() < 1e-9);
            let mut s = [C64::new(0.0, 0.0); 4];
            scatter.at(0, &mut s);
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
            assert!((scatter.diagonal(1, 0) - 2.0).abs() < 1e-9);
        }
    }

    #[test]
    fn experiments_scatter_about_their_own_means() {
        let mut scatter = Scatter::new(1, 1);
        for offset in [0.0, 1e3] {
            let mut mean = Means::new(1, 1);
            let z = [0.0, offset - 1.0, 0.0, offset + 1.0].map(C64::from);
            scatter.push(&mut mean, &z, 2);
            assert_eq!(mean.at(0, 0), C64::new(offset, 0.0));
        }
        assert!((scatter.diagonal(0, 0) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn lines_beyond_one_chunk_are_alike() {
        let lines = 2 * CHUNK + 3;
        let (mut mean, mut scatter) = (Means::new(3, lines), Scatter::new(3, lines));
        for k in 0..4 {
            let value = |i: usize| ((i / (lines + 1) * 7 + k * 3) % 5) as f64;
            let spectra: Vec<C64> = (0..3 * (lines + 1))
                .map(|i| C64::new(value(i), 2.0 - value(i)))
                .collect();
            scatter.push(&mut mean, &spectra, 1);
        }
        let mut first = [C64::new(0.0, 0.0); 9];
        scatter.at(0, &mut first);
        for l in 1..lines {
            let mut s = [C64::new(0.0, 0.0); 9];
            scatter.at(l, &mut s);
            assert_eq!(s, first);
        }
        assert!(first[0].re > 0.0);
    }

    #[test]
    fn a_mean_alone() {
        let mut mean = Means::new(1, 2);
        for k in 0..3 {
            let zero = C64::new(0.0, 0.0);
            mean.push(&[
                zero,
                C64::new(f64::from(k), 1.0),
                C64::new(0.0, f64::from(-k)),
                zero,
            ]);
        }
        assert_eq!(
            (mean.at(0, 0), mean.at(0, 1)),
            (C64::new(1.0, 1.0), C64::new(0.0, -1.0))
        );
    }
}
