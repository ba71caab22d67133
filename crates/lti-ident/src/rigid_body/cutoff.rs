//! Cut-offs from the spectrum of the position.

use super::{RigidBodySettings, centred, decimated, filter};
use crate::LtiIdentError;
use lpv_core::{Clock, Discrete};
use realfft::RealFftPlanner;

/// What both sides of the equations go through, by what the spectrum of the position tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Cut-off of the filter on the position.
    pub position_cutoff_hz: f64,
    /// Cut-off of the filter on the equations.
    pub regression_cutoff_hz: f64,
    /// Samples a row of the regression.
    pub decimation: usize,
}

/// What rounding may make of a ratio of a frequency and a rate.
pub(super) const ROUNDING: f64 = 1e-9;

impl Filter {
    /// That of the runs of one position; cut-offs of the settings go before.
    ///
    /// # Errors
    /// [`LtiIdentError::Setting`].
    pub fn new(
        positions: &[&[f64]],
        clock: Discrete,
        settings: &RigidBodySettings,
    ) -> Result<Self, LtiIdentError> {
        Self::of(cutoffs(positions, clock), clock, settings)
    }

    /// The same of positions that are integrals of measured speeds: the noise of the sensor is white in the speed.
    ///
    /// # Errors
    /// As [`Filter::new`].
    pub fn of_speeds(
        integrals: &[&[f64]],
        clock: Discrete,
        settings: &RigidBodySettings,
    ) -> Result<Self, LtiIdentError> {
        Self::of(cutoffs_of(integrals, clock, 1), clock, settings)
    }

    fn of(found: Cutoffs, clock: Discrete, settings: &RigidBodySettings) -> Result<Self, LtiIdentError> {
        settings.check()?;
        let regression_cutoff_hz = settings.regression_cutoff_hz.unwrap_or(found.regression_hz);
        // A whole number stays one, whatever the unit of time makes of its last digit.
        let decimation = ((1.0 + ROUNDING) / (2.5 * regression_cutoff_hz * clock.sample_time())) as usize;
        Ok(Self {
            position_cutoff_hz: settings.position_cutoff_hz.unwrap_or(found.position_hz),
            regression_cutoff_hz,
            decimation: decimation.max(1),
        })
    }

    /// A signal behind the filter on the equations.
    ///
    /// # Errors
    /// As [`decimated`].
    pub fn reduced(&self, signal: &[f64], clock: Discrete) -> Result<Vec<f64>, LtiIdentError> {
        decimated(signal, clock, self.regression_cutoff_hz, self.decimation)
    }

    /// A held force beside derivatives of a filtered position: behind both filters as these are, so that the filters bias nothing.
    ///
    /// # Errors
    /// As [`decimated`].
    pub fn held(&self, force: &[f64], clock: Discrete) -> Result<Vec<f64>, LtiIdentError> {
        filter::check("position_cutoff_hz", self.position_cutoff_hz, clock)?;
        let slow = filter::low_pass(&centred(force), clock, self.position_cutoff_hz);
        self.reduced(&slow, clock)
    }
}

/// Ratio of signal to noise down to which the position is kept.
const VISIBLE: f64 = 10.0;

/// Part of the power of the acceleration that the regression keeps; the rest is left to what rattles above the band of the drive.
const KEPT: f64 = 0.98;

/// Longest piece of the averaged periodogram.
const PIECE: usize = 8192;

/// Where the spectrum of the position meets its noise, and up to where the acceleration has its power.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cutoffs {
    pub(super) position_hz: f64,
    pub(super) regression_hz: f64,
}

/// The noise of a position sensor is white, so its level is what the upper half of the band shows. The spectrum is that
/// of second differences, whose range the sidelobes of a window can hold; dividing by `(2 - 2 cos wT)^2` gives that of
/// the position.
pub(super) fn cutoffs(runs: &[&[f64]], clock: Discrete) -> Cutoffs {
    cutoffs_of(runs, clock, 0)
}

/// The same where the noise is white in so many derivatives of the position.
fn cutoffs_of(runs: &[&[f64]], clock: Discrete, derivatives: i32) -> Cutoffs {
    let nyquist = clock.nyquist_hz();
    let power = spectrum(runs);
    let bins = power.len();
    let frequency = |k: usize| nyquist * k as f64 / (bins.max(2) - 1) as f64;
    let difference = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / (bins.max(2) - 1) as f64;
        (2.0 - 2.0 * angle.cos()).powi(2 - derivatives)
    };
    let sensor: Vec<f64> = (0..bins)
        .map(|k| power[k] / difference(k).max(f64::MIN_POSITIVE))
        .collect();
    let mut upper = sensor[bins / 2..].to_vec();
    upper.sort_by(f64::total_cmp);
    let noise = upper.get(upper.len() / 2).copied().unwrap_or(0.0);
    let visible = (1..bins)
        .rev()
        .find(|&k| sensor[k] > VISIBLE * noise)
        .unwrap_or(0);
    let acceleration = |k: usize| (sensor[k] - noise).max(0.0) * difference(k);
    let total: f64 = (1..=visible).map(acceleration).sum();
    let mut sum = 0.0;
    let most = (1..=visible).find(|&k| {
        sum += acceleration(k);
        sum >= KEPT * total
    });
    let least = 4.0 * nyquist / bins.max(2) as f64;
    let regression_hz = frequency(most.unwrap_or(0)).clamp(least.min(0.2 * nyquist), 0.2 * nyquist);
    Cutoffs {
        position_hz: frequency(visible).clamp(2.0 * regression_hz, 0.8 * nyquist),
        regression_hz,
    }
}

/// Frequency below which a force has its power.
pub(super) fn band_hz(runs: &[&[f64]], clock: Discrete) -> f64 {
    let power = spectrum(runs);
    let last = (power.len().max(2) - 1) as f64;
    let own = |k: usize| {
        let angle = std::f64::consts::PI * k as f64 / last;
        power[k] / (2.0 - 2.0 * angle.cos()).powi(2).max(f64::MIN_POSITIVE)
    };
    let total: f64 = (1..power.len()).map(own).sum();
    let mut sum = 0.0;
    let most = (1..power.len()).find(|&k| {
        sum += own(k);
        sum >= KEPT * total
    });
    clock.nyquist_hz() * most.unwrap_or(0) as f64 / last
}

/// Averaged periodogram of second differences, Hann window, halves overlap; any scale.
fn spectrum(runs: &[&[f64]]) -> Vec<f64> {
    let longest = runs.iter().map(|r| r.len().saturating_sub(2)).max().unwrap_or(0);
    let piece = (longest / 4).clamp(8, PIECE) & !1;
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(piece);
    let mut power = vec![0.0; piece / 2 + 1];
    let mut lines = fft.make_output_vec();
    for run in runs {
        let second: Vec<f64> = run.windows(3).map(|q| q[2] - 2.0 * q[1] + q[0]).collect();
        for from in (0..(second.len() + 1).saturating_sub(piece)).step_by(piece / 2) {
            let window = |k: usize| {
                (std::f64::consts::PI * (k as f64 + 0.5) / piece as f64)
                    .sin()
                    .powi(2)
            };
            let mut part: Vec<f64> = (0..piece).map(|k| second[from + k] * window(k)).collect();
            if fft.process(&mut part, &mut lines).is_ok() {
                power.iter_mut().zip(&lines).for_each(|(p, l)| *p += l.norm_sqr());
            }
        }
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigid_body::Motion;
    use rand::{RngExt, SeedableRng};

    /// A mass under white forces, integrated exactly: what both sides leave of it, for cut-offs of the position below, at and above
    /// that of the equations.
    #[test]
    fn the_filters_bias_no_mass() -> Result<(), LtiIdentError> {
        let clock = Discrete::from_rate(1000.0)?;
        let (h, mass) = (clock.sample_time(), 3.0);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let force: Vec<f64> = (0..20_000).map(|_| rng.random_range(-1.0..1.0)).collect();
        let (mut x, mut v) = (0.0, 0.0);
        let position: Vec<f64> = force
            .iter()
            .map(|f| {
                let now = x;
                x += h * v + 0.5 * h * h * f / mass;
                v += h * f / mass;
                now
            })
            .collect();
        for position_cutoff_hz in [5.0, 20.0, 80.0] {
            let filter = Filter {
                position_cutoff_hz,
                regression_cutoff_hz: 20.0,
                decimation: 20,
            };
            let motion = Motion::new(&position, clock, position_cutoff_hz)?;
            let acceleration = filter.reduced(&motion.acceleration, clock)?;
            let force = filter.held(&force, clock)?;
            // Ends of the record are the filter's.
            let inner = 100..force.len() - 100;
            let square = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(a, b)| a * b).sum::<f64>();
            let (f, a) = (&force[inner.clone()], &acceleration[inner]);
            let found = square(f, a) / square(a, a);
            let left = square(f, f) - found * square(f, a);
            assert!(
                (found / mass - 1.0).abs() < 2e-3,
                "{position_cutoff_hz} Hz: {found}"
            );
            assert!(
                left < 1e-3 * square(f, f),
                "{position_cutoff_hz} Hz: {left:.1e} of {:.1e}",
                square(f, f)
            );
        }
        Ok(())
    }
}
