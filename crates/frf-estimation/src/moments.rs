//! Running means of complex vectors over all lines, and the scatter about them, a few observations at a time.
//!
//! The noise is some 1e-4 of the signal. A sum of squares would lose eight of sixteen digits to the signal; the update
//! on deviations from the running mean loses none (\[chan1983\], there as a difference of two sums).
//!
//! With `n` observations of mean `m` before, `k` new ones `z_i` and `d_i = z_i - m`, `s = sum d_i`, the mean moves by
//! `s / (n + k)` and the scatter grows by `sum d_i d_i^H - s s^H / (n + k)`, which is `sum e_i e_i^H` of
//! `e_i = d_i - s / (n + k + sqrt(n (n + k)))`: squares alone.

use crate::lanes::{ComplexLanes, Lanes, WIDEST};
use crate::pairs::Blocks;
use num_complex::Complex;
use pulp::{Simd, WithSimd};

type C64 = Complex<f64>;

/// Lines worked on at once, so that the deviations stay in the fastest cache.
pub(crate) const CHUNK: usize = 64;

/// One real or imaginary part of the lines worked on.
pub(crate) type Part = [f64; CHUNK];

/// Observations that are taken up together: what is kept is larger than the caches, and read and written once for all of
/// them. With more than two, what waits would leave the caches too.
pub(crate) const TOGETHER: usize = 2;

/// Spectra of some observations of one experiment, a chunk of lines at a time, in ascending order.
pub(crate) trait Observed {
    /// How many observations.
    fn count(&self) -> usize;

    /// Writes the real and imaginary parts of chunk `at` of `COUNT` observations, the first of which is `from`: channel by
    /// channel, and there one observation after the other.
    fn chunk<S: Simd, const COUNT: usize>(&mut self, simd: S, at: usize, from: usize, out: &mut [[Part; 2]]);
}

/// Where the lines of a spectrum are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Order {
    /// One after the other; how many.
    Ascending(usize),
    /// In [`Blocks`] of a period of so many samples.
    Blocks(usize),
}

/// Place of a line in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place(usize);

/// Places of the lines in the lanes of a register.
pub(crate) type Places = [Place; WIDEST];

/// What a plane has at some places.
#[inline(always)]
fn gathered<S: Simd>(simd: S, plane: &[f64], places: &Places) -> Lanes<S> {
    let mut values = [0.0; WIDEST];
    for lane in 0..S::F64_LANES {
        values[lane] = plane[places[lane].0];
    }
    Lanes::new(simd, values)
}

impl Order {
    pub(crate) fn chunks(self) -> usize {
        match self {
            Self::Ascending(lines) => lines.div_ceil(CHUNK),
            Self::Blocks(length) => Blocks::blocks(length),
        }
    }

    /// Place of line `k`, in cycles a period.
    pub(crate) fn place(self, k: usize) -> Place {
        Place(match self {
            Self::Ascending(_) => k - 1,
            Self::Blocks(length) => Blocks::place(length, k),
        })
    }

    /// Those of some lines; the last one has the lanes that are left.
    pub(crate) fn places(self, lines: &[usize]) -> Places {
        std::array::from_fn(|lane| self.place(lines[lane.min(lines.len() - 1)]))
    }

    /// From one plane to the next: whole chunks, and as much more as keeps lines of different planes from the same place
    /// of a cache.
    fn stride(self) -> usize {
        self.chunks() * CHUNK + 8
    }
}

/// Zeros that, as the compiler treats this today, stand in memory. Those that are only promised are mapped at the first reading and
/// copied at the first writing, and such a copy stops all threads.
fn written_zeros(count: usize) -> Vec<f64> {
    let mut zeros = Vec::with_capacity(count);
    zeros.resize(count, 0.0);
    zeros
}

/// Mean of `channels` spectra over all lines, a plane of real parts and one of imaginary parts a channel.
#[derive(Debug, Clone)]
pub(crate) struct Means {
    channels: usize,
    order: Order,
    count: usize,
    planes: Vec<f64>,
}

impl Means {
    pub(crate) fn new(channels: usize, order: Order) -> Self {
        Self {
            channels,
            order,
            count: 0,
            planes: written_zeros(2 * channels * order.stride()),
        }
    }

    /// Observations so far.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Takes one observation so many times, and keeps nothing of it but the mean.
    pub(crate) fn push(&mut self, observed: &mut impl Observed, times: usize) {
        self.count += times;
        pulp::Arch::new().dispatch(Average {
            weight: times as f64 / self.count as f64,
            mean: self,
            observed,
        });
    }

    /// That of one channel at a line.
    pub(crate) fn at(&self, channel: usize, Place(line): Place) -> C64 {
        let stride = self.order.stride();
        let at = 2 * channel * stride + line;
        C64::new(self.planes[at], self.planes[at + stride])
    }

    /// Those of some channels at some lines.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(
        &self,
        simd: S,
        channels: std::ops::Range<usize>,
        places: &Places,
        out: &mut [ComplexLanes<S>],
    ) {
        let stride = self.order.stride();
        let planes = self.planes.chunks_exact(2 * stride).skip(channels.start);
        for (out, planes) in out.iter_mut().take(channels.len()).zip(planes) {
            let (re, im) = planes.split_at(stride);
            *out = ComplexLanes {
                re: gathered(simd, re, places),
                im: gathered(simd, im, places),
            };
        }
    }
}

/// An observation to be averaged, in the registers of one kind of machine.
struct Average<'a, O> {
    weight: f64,
    mean: &'a mut Means,
    observed: &'a mut O,
}

impl<O: Observed> WithSimd for Average<'_, O> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            weight,
            mean,
            observed,
        } = self;
        let mut spectra = vec![[[0.0; CHUNK]; 2]; mean.channels];
        let stride = mean.order.stride();
        for at in 0..mean.order.chunks() {
            observed.chunk::<S, 1>(simd, at, 0, &mut spectra);
            let planes = mean.planes.chunks_exact_mut(stride);
            for (mean, z) in planes.zip(spectra.as_flattened()) {
                for (mean, z) in mean[at * CHUNK..].iter_mut().zip(z) {
                    *mean += (z - *mean) * weight;
                }
            }
        }
    }
}

/// Scatter `sum_m (Z_m - mean)(Z_m - mean)^H` of spectra about the mean of their experiment, over all lines and summed over
/// the experiments.
#[derive(Debug, Clone)]
pub(crate) struct Scatter {
    channels: usize,
    order: Order,
    /// Planes of the pairs `(i, j)`, `i <= j`: real part and, off the diagonal, imaginary part.
    planes: Vec<f64>,
    /// Of the lines worked on, by channel and observation: real and imaginary part.
    deviations: Vec<[Part; 2]>,
}

/// Observations to be added, in the registers of one kind of machine.
struct Addition<'a, O> {
    scatter: &'a mut Scatter,
    mean: &'a mut Means,
    observed: &'a mut O,
}

impl<O: Observed> WithSimd for Addition<'_, O> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            scatter,
            mean,
            observed,
        } = self;
        let count = observed.count();
        let together = count - count % TOGETHER;
        for from in (0..together).step_by(TOGETHER) {
            scatter.add::<S, O, TOGETHER>(simd, mean, observed, from);
        }
        for from in together..count {
            scatter.add::<S, O, 1>(simd, mean, observed, from);
        }
    }
}

impl Scatter {
    pub(crate) fn new(channels: usize, order: Order) -> Self {
        Self {
            channels,
            order,
            planes: written_zeros(channels * channels * order.stride()),
            deviations: vec![[[0.0; CHUNK]; 2]; TOGETHER * channels],
        }
    }

    /// Takes observations of one experiment, whose mean goes along.
    pub(crate) fn push(&mut self, mean: &mut Means, observed: &mut impl Observed) {
        pulp::Arch::new().dispatch(Addition {
            scatter: self,
            mean,
            observed,
        });
    }

    #[inline(always)]
    fn add<S: Simd, O: Observed, const COUNT: usize>(
        &mut self,
        simd: S,
        mean: &mut Means,
        observed: &mut O,
        from: usize,
    ) {
        let (before, all) = (mean.count as f64, (mean.count + COUNT) as f64);
        let step = simd.splat_f64s(1.0 / all);
        let share = simd.splat_f64s(-1.0 / (all + (before * all).sqrt()));
        let stride = mean.order.stride();
        for at in 0..self.order.chunks() {
            observed.chunk::<S, COUNT>(simd, at, from, &mut self.deviations);
            let planes = mean.planes.chunks_exact_mut(2 * stride);
            for (planes, deviations) in planes.zip(self.deviations.chunks_exact_mut(COUNT)) {
                for (part, mean) in planes.chunks_exact_mut(stride).enumerate() {
                    let mean = S::as_mut_simd_f64s(&mut mean[at * CHUNK..][..CHUNK]).0;
                    for (l, mean) in mean.iter_mut().enumerate() {
                        let mut d = [simd.splat_f64s(0.0); COUNT];
                        let mut sum = simd.splat_f64s(0.0);
                        for m in 0..COUNT {
                            d[m] = simd.sub_f64s(S::as_simd_f64s(&deviations[m][part]).0[l], *mean);
                            sum = simd.add_f64s(sum, d[m]);
                        }
                        *mean = simd.mul_add_e_f64s(step, sum, *mean);
                        for m in 0..COUNT {
                            let less = simd.mul_add_e_f64s(share, sum, d[m]);
                            S::as_mut_simd_f64s(&mut deviations[m][part]).0[l] = less;
                        }
                    }
                }
            }
            self.add_products::<S, COUNT>(simd, at);
        }
        mean.count += COUNT;
    }

    /// Products of the deviations of chunk `at`.
    #[inline(always)]
    fn add_products<S: Simd, const COUNT: usize>(&mut self, simd: S, at: usize) {
        let mut planes = self.planes.chunks_exact_mut(self.order.stride());
        let mut next = || -> &mut [S::f64s] {
            let plane = planes.next().unwrap_or_default();
            S::as_mut_simd_f64s(&mut plane[at * CHUNK..][..CHUNK]).0
        };
        for i in 0..self.channels {
            let a = &self.deviations[i * COUNT..][..COUNT];
            for (l, sum) in next().iter_mut().enumerate() {
                let mut x = *sum;
                for m in 0..COUNT {
                    let [re, im] = parts::<S>(&a[m], l);
                    x = simd.mul_add_e_f64s(re, re, simd.mul_add_e_f64s(im, im, x));
                }
                *sum = x;
            }
            for j in i + 1..self.channels {
                let b = &self.deviations[j * COUNT..][..COUNT];
                for (l, (real, imaginary)) in next().iter_mut().zip(next()).enumerate() {
                    let (mut x, mut y) = (*real, *imaginary);
                    for m in 0..COUNT {
                        let ([ar, ai], [br, bi]) = (parts::<S>(&a[m], l), parts::<S>(&b[m], l));
                        x = simd.mul_add_e_f64s(ar, br, simd.mul_add_e_f64s(ai, bi, x));
                        y = simd.mul_add_e_f64s(ai, br, simd.negate_mul_add_e_f64s(ar, bi, y));
                    }
                    (*real, *imaginary) = (x, y);
                }
            }
        }
    }

    /// Those of some lines, Hermitian `channels x channels` matrices, column-major.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(&self, simd: S, places: &Places, out: &mut [ComplexLanes<S>]) {
        let n = self.channels;
        let mut planes = self.planes.chunks_exact(self.order.stride());
        for i in 0..n {
            out[i * n + i] = ComplexLanes {
                re: gathered(simd, planes.next().unwrap_or_default(), places),
                im: Lanes::splat(simd, 0.0),
            };
            for j in i + 1..n {
                let s = ComplexLanes {
                    re: gathered(simd, planes.next().unwrap_or_default(), places),
                    im: gathered(simd, planes.next().unwrap_or_default(), places),
                };
                out[j * n + i] = s;
                out[i * n + j] = s.conj();
            }
        }
    }

    /// That of one channel at a line.
    pub(crate) fn diagonal(&self, channel: usize, Place(line): Place) -> f64 {
        // Rows of the upper triangle before this one: one real plane and two for each entry right of the diagonal.
        let n = self.channels;
        let before: usize = (0..channel).map(|i| 1 + 2 * (n - 1 - i)).sum();
        self.planes[before * self.order.stride() + line]
    }
}

#[inline(always)]
fn parts<S: Simd>([re, im]: &[Part; 2], l: usize) -> [S::f64s; 2] {
    [S::as_simd_f64s(re).0[l], S::as_simd_f64s(im).0[l]]
}

#[cfg(test)]
mod tests;
