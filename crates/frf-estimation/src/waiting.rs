//! Transforms of periods that wait to be taken up together.

use crate::FrfError;
use crate::moments::{CHUNK, Means, Observed, Order, Part, Scatter, TOGETHER};
use crate::pairs::{Blocks, Centred, Plan};
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
    Pairs(Pairs),
    /// Spectra, one signal after the other.
    Spectra(Spectra, Vec<C64>),
}

struct Pairs {
    plan: Arc<Plan>,
    points: Vec<f64>,
    /// Powers of two that make the channels of one size; those of the last period will do for the next one.
    scales: Vec<f64>,
    /// By what the spectra of those that wait are to be multiplied, channel after channel.
    inverses: Vec<f64>,
}

impl Pairs {
    fn new(plan: Arc<Plan>, channels: usize) -> Self {
        Self {
            plan,
            points: Vec::new(),
            scales: vec![1.0; channels],
            inverses: Vec::new(),
        }
    }

    /// Transforms two channels, the first of which is `at`, or one with itself. Whether all samples are finite.
    fn transform(&mut self, at: usize, pair: [&[f64]; 2], to: usize) -> bool {
        let size = self.plan.size();
        let free = &mut self.points[to * size..][..size];
        let last = (at + 1).min(self.scales.len() - 1);
        let offsets = pair.map(typical);
        let centred = |scales: &[f64]| {
            [(0, at), (1, last)].map(|(i, channel)| Centred {
                signal: pair[i],
                offset: offsets[i],
                scale: scales[channel],
            })
        };
        let squares = self.plan.transform(centred(&self.scales), free);
        let alike = |square: f64| (1.0 / 16.0..=16.0).contains(&square);
        let mut factors = [1.0; 2];
        if !squares.into_iter().all(alike) {
            let found = [0, 1].map(|i| size_of(pair[i], offsets[i]));
            let [Some(a), Some(b)] = found else {
                return false;
            };
            factors = [a, b].map(|size| if size == 0.0 { 0.0 } else { 1.0 });
            let scales = [a, b].map(|size| power_of_two_below(size).recip());
            if scales != [self.scales[at], self.scales[last]] {
                [self.scales[last], self.scales[at]] = [scales[1], scales[0]];
                self.plan.transform(centred(&self.scales), free);
            }
        }
        // What is zero stays so, whatever is beside it.
        let inverses = [(at, factors[0]), (last, factors[1])].map(|(c, factor)| factor / self.scales[c]);
        self.inverses.extend(&inverses[..1 + last - at]);
        true
    }
}

/// The one in the middle of five samples: near enough to an offset, and none that stands out.
fn typical(signal: &[f64]) -> f64 {
    let mut some = [0, 1, 2, 3, 4].map(|i| signal[i * (signal.len() - 1) / 4]);
    some.sort_by(f64::total_cmp);
    some[2]
}

/// Root of the mean square of a signal without an offset; none where a sample is not finite.
fn size_of(signal: &[f64], offset: f64) -> Option<f64> {
    // Divided by the largest first, so that no square is too large or too small.
    let largest = signal
        .iter()
        .fold(0.0_f64, |most, x| most.max((x - offset).abs()));
    let power = power_of_two_below(largest);
    let squares = signal.iter().map(|x| (x / power - offset / power).powi(2));
    let size = power * (squares.sum::<f64>() / signal.len() as f64).sqrt();
    let finite = offset.is_finite() && signal.iter().all(|x| x.is_finite());
    finite.then_some(size)
}

/// The power of two at or below a size, within what has an inverse; 1 for zero.
fn power_of_two_below(size: f64) -> f64 {
    if size == 0.0 {
        1.0
    } else {
        size.clamp(1e-300, 1e300).log2().floor().exp2()
    }
}

impl Waiting {
    /// Room for as many periods as serve.
    pub(crate) fn new(length: usize, channels: usize) -> Self {
        let transformed = match Plan::new(length) {
            Some(plan) => Transformed::Pairs(Pairs::new(plan, channels)),
            None => Transformed::Spectra(Spectra::new(length), Vec::new()),
        };
        let together = if length.saturating_mul(channels) > MOST {
            1
        } else {
            TOGETHER
        };
        Self::of(length, channels, together, transformed)
    }

    /// Room for one period of other signals of the same length.
    pub(crate) fn beside(&self, channels: usize) -> Self {
        let transformed = match &self.transformed {
            Transformed::Pairs(pairs) => Transformed::Pairs(Pairs::new(pairs.plan.clone(), channels)),
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

    /// Transforms the signals of a period. Where this is false, a sample is not finite, or numbers are too large to be added
    /// up.
    ///
    /// Each signal is taken less one of its samples: the leakage of an offset is zero in theory, and rounding of a large one
    /// would raise the noise of every line.
    pub(crate) fn push<'a>(
        &mut self,
        mut signals: impl Iterator<Item = &'a Vec<f64>>,
    ) -> Result<bool, FrfError> {
        let mut finite = true;
        match &mut self.transformed {
            Transformed::Pairs(pairs) => {
                let (count, channels) = (self.channels.div_ceil(2), self.channels);
                let size = pairs.plan.size();
                pairs.points.resize(self.together * count * size, 0.0);
                pairs.inverses.truncate(self.count * channels);
                let before = pairs.scales.clone();
                for i in 0..count {
                    let Some(a) = signals.next() else { break };
                    let b = signals.next().unwrap_or(a);
                    finite &= pairs.transform(2 * i, [a, b], self.count * count + i);
                }
                if !finite {
                    pairs.scales = before;
                    pairs.inverses.resize((self.count + 1) * channels, f64::NAN);
                }
            }
            Transformed::Spectra(plan, spectra) => {
                let size = Spectra::size(self.length);
                spectra.resize(self.together * self.channels * size, C64::new(0.0, 0.0));
                let free = spectra.chunks_exact_mut(size).skip(self.count * self.channels);
                for (signal, free) in signals.zip(free) {
                    plan.transform(signal, typical(signal), free)?;
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
            Transformed::Pairs(pairs) => scatter.push(mean, &mut self.blocks(pairs)),
            Transformed::Spectra(_, spectra) => scatter.push(mean, &mut self.ascending(spectra)),
        }
        self.count = 0;
    }

    /// Adds the one that waits to a mean, so many times.
    pub(crate) fn average(&mut self, mean: &mut Means, times: usize) {
        match &self.transformed {
            Transformed::Pairs(pairs) => mean.push(&mut self.blocks(pairs), times),
            Transformed::Spectra(_, spectra) => mean.push(&mut self.ascending(spectra), times),
        }
        self.count = 0;
    }

    fn blocks<'a>(&self, pairs: &'a Pairs) -> Blocks<'a> {
        let scales = &pairs.inverses[..self.count * self.channels];
        Blocks::new(&pairs.plan, &pairs.points, self.channels, scales)
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
                if k % 37 > 2 && ![length / 16, length / 8, length / 4].contains(&k) {
                    continue;
                }
                // Amplitudes of 2 are 1 in the spectrum.
                let wave = |t: usize| {
                    let turn = 2.0 * std::f64::consts::PI * ((t * k) % length) as f64 / length as f64;
                    [3.0 + 2.0 * turn.cos(), 3.0 + 2.0 * turn.sin()]
                };
                let signals = [0, 1].map(|i| (0..length).map(|t| wave(t)[i]).collect::<Vec<f64>>());
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

    fn number(i: usize, seed: u64) -> f64 {
        let x = (i as u64 + 1)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15)
            .wrapping_add(seed)
            .rotate_left(23);
        (x.wrapping_mul(0xD134_2543_DE82_EF95) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    /// So many signals, each of a size and an offset of its own.
    fn signals(length: usize, channels: usize, seed: u64) -> Vec<Vec<f64>> {
        let of = |c: usize| {
            let (size, offset) = (10.0_f64.powf(24.0 * number(c, seed)), 20.0 * number(c + 9, seed));
            (0..length)
                .map(|t| size * (offset + number(c * length + t, seed)))
                .collect()
        };
        (0..channels).map(of).collect()
    }

    /// The largest distance of a channel's spectrum, relative to its size.
    fn distance(ours: &[Vec<C64>], theirs: &[Vec<C64>]) -> f64 {
        let of = |(a, b): (&Vec<C64>, &Vec<C64>)| {
            let apart: Vec<C64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
            norm(&apart) / norm(b)
        };
        ours.iter().zip(theirs).map(of).fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_number_of_signals_as_by_the_library(twos in 10_u32..17, channels in 1_usize..6, seed in 0_u64..1000) {
            let signals = signals(1 << twos, channels, seed);
            let found = distance(
                &spectra(Waiting::new(1 << twos, channels), &signals),
                &spectra(library(1 << twos, channels), &signals),
            );
            prop_assert!(found <= 2e-15, "2^{twos} {channels}: {found:e}");
        }
    }

    #[test]
    fn long_periods_as_by_the_library() {
        for twos in [17, 18, 19] {
            let signals = signals(1 << twos, 2, 3);
            let [ours, theirs] =
                [Waiting::new(1 << twos, 2), library(1 << twos, 2)].map(|w| spectra(w, &signals));
            assert!(
                distance(&ours, &theirs) <= 2e-15,
                "2^{twos}: {:e}",
                distance(&ours, &theirs)
            );
        }
    }

    #[test]
    fn pairs_are_what_is_tested_where_the_machine_has_them() {
        #[cfg(target_arch = "x86_64")]
        let has = pulp::x86::V4::try_new().is_some();
        #[cfg(not(target_arch = "x86_64"))]
        let has = false;
        assert_eq!(
            matches!(Waiting::new(1024, 2).transformed, Transformed::Pairs(_)),
            has
        );
        if !has {
            println!(
                "skipped: no registers of eight numbers, so that all transforms are those of the library"
            );
        }
    }

    #[test]
    fn what_is_constant_stays_zero_beside_anything() {
        for constant in [0.0, 5.0, -1e9, 0.1] {
            let one = vec![constant; 1024];
            let other: Vec<f64> = (0..1024).map(|t| number(t, 1)).collect();
            for pair in [[one.clone(), other.clone()], [other.clone(), one.clone()]] {
                let found = spectra(Waiting::new(1024, 2), &pair);
                let silent = usize::from(pair[1] == one);
                assert!(found[silent].iter().all(|z| *z == C64::default()), "{constant}");
                assert!(norm(&found[1 - silent]) > 0.0);
            }
        }
    }

    #[test]
    fn powers_of_two_change_no_digit() {
        let all = signals(2048, 3, 7);
        let reference = spectra(Waiting::new(2048, 3), &all);
        for twos in [[40, 0, -60], [-500, 300, 3], [0, -80, 700]] {
            let scaled = |c: usize| {
                all[c]
                    .iter()
                    .map(|x| x * 2.0_f64.powi(twos[c]))
                    .collect::<Vec<f64>>()
            };
            let found = spectra(Waiting::new(2048, 3), &[scaled(0), scaled(1), scaled(2)]);
            for (c, (a, b)) in found.iter().zip(&reference).enumerate() {
                assert!(
                    a.iter().zip(b).all(|(a, b)| *a == b * 2.0_f64.powi(twos[c])),
                    "{twos:?} {c}"
                );
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
