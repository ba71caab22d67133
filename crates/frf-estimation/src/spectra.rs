//! Amplitude spectra of real signals, with plan and buffers kept.

use crate::FrfError;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

type C64 = Complex<f64>;

/// Transforms signals of one length: `X_k = (1/N) sum_t x(t) exp(-2 pi j k t / N)`.
pub(crate) struct Spectra {
    plan: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    scratch: Vec<C64>,
}

impl Spectra {
    pub(crate) fn new(length: usize) -> Self {
        let plan = RealFftPlanner::new().plan_fft_forward(length);
        Self {
            input: plan.make_input_vec(),
            scratch: plan.make_scratch_vec(),
            plan,
        }
    }

    /// Lines between zero and Nyquist, both left out.
    pub(crate) fn lines(length: usize) -> usize {
        length.saturating_sub(1) / 2
    }

    /// Length of a spectrum: zero, the lines, and Nyquist where there is one.
    pub(crate) fn size(length: usize) -> usize {
        length / 2 + 1
    }

    /// Writes the spectrum of a signal whose samples add up to `sum`, of its [size](Self::size).
    pub(crate) fn transform(&mut self, signal: &[f64], sum: f64, out: &mut [C64]) -> Result<(), FrfError> {
        let scale = 1.0 / signal.len() as f64;
        // A constant offset is removed by hand: its leakage is zero in theory, and rounding of a large offset would
        // raise the noise of every line.
        let mean = sum * scale;
        if self.input.len() != signal.len() {
            return Err(realfft::FftError::InputBuffer(self.input.len(), signal.len()).into());
        }
        pulp::Arch::new().dispatch(Centre {
            signal,
            mean,
            scale,
            out: &mut self.input,
        });
        self.plan
            .process_with_scratch(&mut self.input, out, &mut self.scratch)?;
        Ok(())
    }
}

/// Sum of a signal, many lanes at once.
pub(crate) fn sum(signal: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(Sum(signal))
}

/// Whether two signals are equal, sample by sample.
pub(crate) fn equal(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && pulp::Arch::new().dispatch(Equal(a, b))
}

/// A signal without its mean, times a factor.
struct Centre<'a> {
    signal: &'a [f64],
    mean: f64,
    scale: f64,
    out: &'a mut [f64],
}

impl WithSimd for Centre<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for (out, value) in self.out.iter_mut().zip(self.signal) {
            *out = (value - self.mean) * self.scale;
        }
    }
}

struct Sum<'a>(&'a [f64]);

impl WithSimd for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (wide, last) = S::as_simd_f64s(self.0);
        let (fours, rest) = wide.as_chunks::<4>();
        let mut sums = [simd.splat_f64s(0.0); 4];
        for values in fours {
            for i in 0..4 {
                sums[i] = simd.add_f64s(sums[i], values[i]);
            }
        }
        for value in rest {
            sums[0] = simd.add_f64s(sums[0], *value);
        }
        let [a, b, c, d] = sums;
        let all = simd.add_f64s(simd.add_f64s(a, b), simd.add_f64s(c, d));
        simd.reduce_sum_f64s(all) + last.iter().sum::<f64>()
    }
}

/// Samples that are compared before a difference is looked for.
const COMPARED: usize = 512;

struct Equal<'a>(&'a [f64], &'a [f64]);

impl WithSimd for Equal<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> bool {
        let parts = self.0.chunks(COMPARED).zip(self.1.chunks(COMPARED));
        parts
            .map(|(a, b)| a.iter().zip(b).fold(false, |other, (a, b)| other | (a != b)))
            .all(|other| !other)
    }
}
