//! Amplitude spectra of real signals, with plan and buffers kept.

use crate::FrfError;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

type C64 = Complex<f64>;

/// Transforms signals of one length: `X_k = (1/N) sum_t x(t) exp(-2 pi j k t / N)`.
#[derive(Clone)]
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

    /// Writes the spectrum of a signal less its offset, of its [size](Self::size).
    pub(crate) fn transform(&mut self, signal: &[f64], offset: f64, out: &mut [C64]) -> Result<(), FrfError> {
        if self.input.len() != signal.len() {
            return Err(realfft::FftError::InputBuffer(self.input.len(), signal.len()).into());
        }
        let scale = 1.0 / signal.len() as f64;
        for (out, value) in self.input.iter_mut().zip(signal) {
            *out = (value - offset) * scale;
        }
        self.plan
            .process_with_scratch(&mut self.input, out, &mut self.scratch)?;
        Ok(())
    }
}

/// Mean of a signal.
pub(crate) fn mean(signal: &[f64]) -> f64 {
    sum(signal) / signal.len() as f64
}

/// Sum of a signal, many lanes at once.
pub(crate) fn sum(signal: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(Sum(signal))
}

/// Whether two signals are equal, sample by sample.
pub(crate) fn equal(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && pulp::Arch::new().dispatch(Equal(a, b))
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
