//! Time in the type: a continuous model and a sampled one do not mix.

use crate::CoreError;
use num_complex::Complex;
use serde::{Deserialize, Serialize};

mod sealed {
    pub trait Sealed {}
}

/// The clock of a model: [`Continuous`] or [`Discrete`].
pub trait Clock: Copy + PartialEq + std::fmt::Debug + Send + Sync + sealed::Sealed + 'static {
    /// The point of the complex plane at which a transfer function is evaluated for a frequency in cycles per
    /// unit of time: `s = j 2 pi f`, or `z = exp(j 2 pi f T_s)`.
    fn point(self, frequency_hz: f64) -> Complex<f64>;

    /// Whether a pole is strictly inside the stable region.
    fn is_stable_pole(self, pole: Complex<f64>) -> bool;

    /// The highest frequency that the clock can tell from lower ones; infinite in continuous time.
    fn nyquist_hz(self) -> f64;
}

/// Continuous time; poles are values of `s`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Continuous;

/// Discrete time with its sample time; poles are values of `z`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Discrete {
    sample_time: f64,
}

impl Discrete {
    /// A clock that ticks every `sample_time` units of time.
    ///
    /// # Errors
    /// [`CoreError::SampleTime`] unless it is finite and above zero.
    pub fn new(sample_time: f64) -> Result<Self, CoreError> {
        if sample_time.is_finite() && sample_time > 0.0 {
            Ok(Self { sample_time })
        } else {
            Err(CoreError::SampleTime { value: sample_time })
        }
    }

    /// A clock from its rate in samples per unit of time.
    ///
    /// # Errors
    /// [`CoreError::SampleTime`] unless the rate is finite and above zero.
    pub fn from_rate(sample_rate_hz: f64) -> Result<Self, CoreError> {
        Self::new(1.0 / sample_rate_hz)
    }

    /// Time between samples.
    pub fn sample_time(self) -> f64 {
        self.sample_time
    }

    /// Response `(1 - e^-sT) / (sT)` of a hold of zero order at `s = j 2 pi f`, f in Hz: the mean of what is held over the sample before.
    pub fn hold_response(self, frequency_hz: f64) -> Complex<f64> {
        // sin(x) / x with half a sample of delay, which keeps its digits at low frequencies.
        let x = std::f64::consts::PI * frequency_hz * self.sample_time;
        let size = if x.abs() < 1e-8 { 1.0 } else { x.sin() / x };
        Complex::from_polar(size, -x)
    }
}

impl TryFrom<f64> for Discrete {
    type Error = CoreError;
    fn try_from(sample_time: f64) -> Result<Self, CoreError> {
        Self::new(sample_time)
    }
}

impl From<Discrete> for f64 {
    fn from(clock: Discrete) -> f64 {
        clock.sample_time
    }
}

impl sealed::Sealed for Continuous {}
impl sealed::Sealed for Discrete {}

impl Clock for Continuous {
    fn point(self, frequency_hz: f64) -> Complex<f64> {
        Complex::new(0.0, std::f64::consts::TAU * frequency_hz)
    }
    fn is_stable_pole(self, pole: Complex<f64>) -> bool {
        pole.re < 0.0
    }
    fn nyquist_hz(self) -> f64 {
        f64::INFINITY
    }
}

impl Clock for Discrete {
    fn point(self, frequency_hz: f64) -> Complex<f64> {
        Complex::from_polar(1.0, std::f64::consts::TAU * frequency_hz * self.sample_time)
    }
    fn is_stable_pole(self, pole: Complex<f64>) -> bool {
        pole.norm() < 1.0
    }
    fn nyquist_hz(self) -> f64 {
        0.5 / self.sample_time
    }
}

/// Refuses to join systems whose clocks differ by more than the rounding of a rate.
///
/// # Errors
/// [`CoreError::DifferentClocks`].
pub fn same_clock<K: Clock>(first: K, second: K) -> Result<(), CoreError> {
    let (first_nyquist_hz, second_nyquist_hz) = (first.nyquist_hz(), second.nyquist_hz());
    // In continuous time both are infinite and their difference is NaN, which is not above anything.
    if (first_nyquist_hz - second_nyquist_hz).abs() > 1e-12 * first_nyquist_hz {
        return Err(CoreError::DifferentClocks {
            first_nyquist_hz,
            second_nyquist_hz,
        });
    }
    Ok(())
}
