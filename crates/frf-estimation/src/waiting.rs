//! A buffer for the spectra of periods, so that they are accumulated in one pass.

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
mod tests;
