//! Amplitude spectra of real signals, with plan and buffers kept.

use crate::FrfError;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Transforms signals of one length: `X_k = (1/N) sum_t x(t) exp(-2 pi j k t / N)`.
pub(crate) struct Spectra {
    plan: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    output: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl Spectra {
    pub(crate) fn new(length: usize) -> Self {
        let plan = RealFftPlanner::new().plan_fft_forward(length);
        Self {
            input: plan.make_input_vec(),
            output: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            plan,
        }
    }

    /// Lines between zero and Nyquist, both left out.
    pub(crate) fn lines(length: usize) -> usize {
        length.saturating_sub(1) / 2
    }

    /// Writes lines `1..=lines` of the channels' spectra, one plane of real and one of imaginary parts a channel.
    pub(crate) fn planes<'a>(
        &mut self,
        channels: impl Iterator<Item = &'a [f64]>,
        lines: usize,
        planes: &mut [f64],
    ) -> Result<(), FrfError> {
        for (signal, plane) in channels.zip(planes.chunks_exact_mut(2 * lines)) {
            let (re, im) = plane.split_at_mut(lines);
            self.transform(signal, re, im)?;
        }
        Ok(())
    }

    /// Writes lines `1..=re.len()` of the spectrum, real and imaginary parts apart.
    fn transform(&mut self, signal: &[f64], re: &mut [f64], im: &mut [f64]) -> Result<(), FrfError> {
        let scale = 1.0 / signal.len() as f64;
        // A constant offset is removed by hand: its leakage is zero in theory, and rounding of a large offset would
        // raise the noise of every line.
        let mean = sum(signal) * scale;
        if self.input.len() != signal.len() {
            return Err(realfft::FftError::InputBuffer(self.input.len(), signal.len()).into());
        }
        for (b, s) in self.input.iter_mut().zip(signal) {
            *b = s - mean;
        }
        self.plan
            .process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch)?;
        let lines = &self.output[1..];
        pulp::Arch::new().dispatch(Split { lines, scale, re, im });
        Ok(())
    }
}

/// Sum of a signal, many lanes at once.
pub(crate) fn sum(signal: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(Sum(signal))
}

/// Numbers times a factor, real and imaginary parts apart.
struct Split<'a> {
    lines: &'a [Complex<f64>],
    scale: f64,
    re: &'a mut [f64],
    im: &'a mut [f64],
}

impl WithSimd for Split<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for ((r, i), x) in self.re.iter_mut().zip(self.im).zip(self.lines) {
            *r = x.re * self.scale;
            *i = x.im * self.scale;
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
