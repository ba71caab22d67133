//! Transforms of periods that wait to be taken up together.

use crate::FrfError;
use crate::moments::{CHUNK, Means, Observed, Order, Part, Scatter, TOGETHER};
use crate::pairs::{Blocks, Plan};
use crate::spectra::Spectra;
use num_complex::Complex;
use pulp::Simd;
use std::sync::Arc;

type C64 = Complex<f64>;

/// Samples of a period, of all channels together, above which it is taken up by itself: what waits would be too large for
/// any cache.
const MOST: usize = 1 << 19;

/// Periods of one experiment, each of so many signals of one length.
pub(crate) struct Waiting {
    length: usize,
    channels: usize,
    together: usize,
    count: usize,
    transforms: usize,
    transformed: Transformed,
}

enum Transformed {
    /// Two signals at once.
    Pairs(Arc<Plan>, Vec<f64>),
    /// Spectra, one signal after the other.
    Spectra(Spectra, Vec<C64>),
}

impl Waiting {
    /// Room for as many periods as serve.
    pub(crate) fn new(length: usize, channels: usize) -> Self {
        let transformed = match Plan::new(length) {
            Some(plan) => Transformed::Pairs(plan, Vec::new()),
            None => Transformed::Spectra(Spectra::new(length), Vec::new()),
        };
        let together = if length * channels > MOST { 1 } else { TOGETHER };
        Self::of(length, channels, together, transformed)
    }

    /// Room for one period of other signals of the same length.
    pub(crate) fn beside(&self, channels: usize) -> Self {
        let transformed = match &self.transformed {
            Transformed::Pairs(plan, _) => Transformed::Pairs(plan.clone(), Vec::new()),
            Transformed::Spectra(plan, _) => Transformed::Spectra(plan.clone(), Vec::new()),
        };
        Self::of(self.length, channels, 1, transformed)
    }

    fn of(length: usize, channels: usize, together: usize, transformed: Transformed) -> Self {
        Self {
            length,
            channels,
            together,
            count: 0,
            transforms: 0,
            transformed,
        }
    }

    /// Where the lines are kept.
    pub(crate) fn order(&self) -> Order {
        match self.transformed {
            Transformed::Pairs(..) => Order::Blocks(self.length),
            Transformed::Spectra(..) => Order::Ascending(Spectra::lines(self.length)),
        }
    }

    /// Transforms so far.
    pub(crate) fn transforms(&self) -> usize {
        self.transforms
    }

    /// Whether there is no room for another one.
    pub(crate) fn is_full(&self) -> bool {
        self.count == self.together
    }

    /// Transforms the signals of a period. Whether their sums are finite, which they are not if a sample is not.
    ///
    /// Each signal is taken less its first sample: the leakage of an offset is zero in theory, and rounding of a large one
    /// would raise the noise of every line.
    pub(crate) fn push<'a>(
        &mut self,
        mut signals: impl Iterator<Item = &'a Vec<f64>>,
    ) -> Result<bool, FrfError> {
        let mut finite = true;
        match &mut self.transformed {
            Transformed::Pairs(plan, points) => {
                let size = plan.size();
                let pairs = self.channels.div_ceil(2);
                points.resize(self.together * pairs * size, 0.0);
                for free in points.chunks_exact_mut(size).skip(self.count * pairs).take(pairs) {
                    let Some(a) = signals.next() else { break };
                    let b = signals.next().unwrap_or(a);
                    finite &= plan.transform([a, b], [a[0], b[0]], free);
                }
            }
            Transformed::Spectra(plan, spectra) => {
                let size = Spectra::size(self.length);
                spectra.resize(self.together * self.channels * size, C64::new(0.0, 0.0));
                let free = spectra.chunks_exact_mut(size).skip(self.count * self.channels);
                for (signal, free) in signals.zip(free) {
                    plan.transform(signal, signal[0], free)?;
                    finite &= free[0].re.is_finite();
                }
            }
        }
        self.transforms += self.channels;
        self.count += 1;
        Ok(finite)
    }

    /// Takes back the last period.
    pub(crate) fn forget(&mut self) {
        self.count -= 1;
        self.transforms -= self.channels;
    }

    /// Adds what waits to a scatter and its mean.
    pub(crate) fn take_up(&mut self, mean: &mut Means, scatter: &mut Scatter) {
        match &self.transformed {
            Transformed::Pairs(plan, points) => {
                let mut blocks = Blocks::new(plan, points, self.channels, self.count);
                scatter.push(mean, &mut blocks);
            }
            Transformed::Spectra(_, spectra) => scatter.push(mean, &mut self.ascending(spectra)),
        }
        self.count = 0;
    }

    /// Adds the one that waits to a mean, so many times.
    pub(crate) fn average(&mut self, mean: &mut Means, times: usize) {
        match &self.transformed {
            Transformed::Pairs(plan, points) => {
                mean.push(&mut Blocks::new(plan, points, self.channels, 1), times);
            }
            Transformed::Spectra(_, spectra) => mean.push(&mut self.ascending(spectra), times),
        }
        self.count = 0;
    }

    fn ascending<'a>(&self, spectra: &'a [C64]) -> Ascending<'a> {
        Ascending {
            spectra,
            length: self.length,
            channels: self.channels,
            count: self.count,
        }
    }
}

/// Spectra of observations, channel after channel.
struct Ascending<'a> {
    spectra: &'a [C64],
    length: usize,
    channels: usize,
    count: usize,
}

impl Observed for Ascending<'_> {
    fn count(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn chunk<S: Simd, const COUNT: usize>(
        &mut self,
        _simd: S,
        at: usize,
        from: usize,
        out: &mut [[Part; 2]],
    ) {
        // A spectrum begins with its mean.
        let start = 1 + at * CHUNK;
        let width = CHUNK.min(1 + Spectra::lines(self.length) - start);
        let spectra = self.spectra.chunks_exact(Spectra::size(self.length));
        let own = spectra.skip(from * self.channels).take(COUNT * self.channels);
        for (at, z) in own.enumerate() {
            let (m, channel) = (at / self.channels, at % self.channels);
            let [re, im] = &mut out[channel * COUNT + m];
            let z = &z[start..start + width];
            for ((z, re), im) in z.iter().zip(&mut *re).zip(&mut *im) {
                (*re, *im) = (z.re, z.im);
            }
            // Lines beyond the last one stay zero.
            re[width..].fill(0.0);
            im[width..].fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Means of the spectra of one period, by channel and line.
    fn spectra(mut waiting: Waiting, signals: &[Vec<f64>]) -> Vec<Vec<C64>> {
        let order = waiting.order();
        assert!(waiting.push(signals.iter()).unwrap());
        let mut mean = Means::new(signals.len(), order);
        waiting.average(&mut mean, 1);
        let lines = 1..=Spectra::lines(signals[0].len());
        let of = |c: usize| lines.clone().map(|k| mean.at(c, order.place(k))).collect();
        (0..signals.len()).map(of).collect()
    }

    fn library(length: usize, channels: usize) -> Waiting {
        let spectra = Transformed::Spectra(Spectra::new(length), Vec::new());
        Waiting::of(length, channels, TOGETHER, spectra)
    }

    fn norm(z: &[C64]) -> f64 {
        z.iter().map(C64::norm_sqr).sum::<f64>().sqrt()
    }

    #[test]
    fn a_cosine_and_a_sine_at_every_line() {
        for length in [1 << 10, 1 << 11, 1 << 12] {
            for k in 1..length / 2 {
                // Amplitudes of 2 are 1 in the spectrum; the quarter turn is exact.
                let turn = |t: usize| 2.0 * std::f64::consts::PI * ((t * k) % length) as f64 / length as f64;
                let signals = [0.0, 0.25].map(|shift| {
                    let wave = |t| 3.0 + 2.0 * (turn(t) - 2.0 * std::f64::consts::PI * shift).cos();
                    (0..length).map(wave).collect::<Vec<f64>>()
                });
                if k % 37 > 2 && ![length / 16, length / 8, length / 4].contains(&k) {
                    continue;
                }
                let found = spectra(Waiting::new(length, 2), &signals);
                for (channel, expected) in [(0, C64::new(1.0, 0.0)), (1, C64::new(0.0, -1.0))] {
                    for (l, z) in found[channel].iter().enumerate() {
                        let expected = if l + 1 == k { expected } else { C64::default() };
                        assert!((z - expected).norm() < 1e-14, "{length} {k} {l} {z}");
                    }
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_number_of_signals_as_by_the_library(twos in 8_u32..17, channels in 1_usize..6, seed in 0_u64..1000) {
            let length = 1 << twos;
            let value = |i: usize| {
                let x = (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(seed).rotate_left(23);
                (x.wrapping_mul(0xD134_2543_DE82_EF95) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            };
            let signals: Vec<Vec<f64>> =
                (0..channels).map(|c| (0..length).map(|t| value(c * length + t)).collect()).collect();
            let ours = spectra(Waiting::new(length, channels), &signals);
            let theirs = spectra(library(length, channels), &signals);
            for (a, b) in ours.iter().zip(&theirs) {
                let apart: Vec<C64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
                prop_assert!(norm(&apart) <= 1e-15 * norm(b), "{} {channels}: {:e}", length, norm(&apart) / norm(b));
            }
        }
    }

    #[test]
    fn scatter_does_not_depend_on_the_transform() {
        let (length, channels) = (1 << 11, 3);
        let period = |m: usize| -> Vec<Vec<f64>> {
            let value = |c: usize, t: usize| ((t * (c + 2) + m * t * t % 97) as f64 * 0.37).sin();
            (0..channels)
                .map(|c| (0..length).map(|t| value(c, t)).collect())
                .collect()
        };
        let of = |mut waiting: Waiting| {
            let order = waiting.order();
            let (mut mean, mut scatter) = (Means::new(channels, order), Scatter::new(channels, order));
            for m in 0..5 {
                waiting.push(period(m).iter()).unwrap();
                if waiting.is_full() || m == 4 {
                    waiting.take_up(&mut mean, &mut scatter);
                }
            }
            let mut all = Vec::new();
            for k in 1..=Spectra::lines(length) {
                let mut s = vec![C64::default(); channels * channels];
                scatter.at(order.place(k), &mut s);
                all.extend(s);
                all.extend((0..channels).map(|c| mean.at(c, order.place(k))));
            }
            all
        };
        let (ours, theirs) = (of(Waiting::new(length, channels)), of(library(length, channels)));
        let apart: Vec<C64> = ours.iter().zip(&theirs).map(|(a, b)| a - b).collect();
        assert!(
            norm(&apart) < 1e-14 * norm(&theirs),
            "{:e}",
            norm(&apart) / norm(&theirs)
        );
    }

    #[test]
    fn a_sample_that_is_not_finite_is_seen() {
        for at in [0, 1, 700, 1023] {
            for bad in [f64::NAN, f64::INFINITY] {
                for channel in 0..3 {
                    let mut signals = vec![vec![1.0; 1024]; 3];
                    signals[channel][at] = bad;
                    assert!(!Waiting::new(1024, 3).push(signals.iter()).unwrap());
                    assert!(!library(1024, 3).push(signals.iter()).unwrap());
                }
            }
        }
    }
}
