//! Butterworth low-pass of order four, run forth and back, so that it shifts nothing in time.

use crate::LtiIdentError;
use lpv_core::{Clock, Discrete};

/// Damping terms `2 cos(pi / 8)` and `2 cos(3 pi / 8)` of the two sections of the prototype.
const SECTIONS: [f64; 2] = [1.847_759_065_022_573_5, 0.765_366_864_730_179_6];

/// Refuses a cut-off that is not between zero and the Nyquist frequency.
pub(super) fn check(name: &'static str, cutoff_hz: f64, clock: Discrete) -> Result<(), LtiIdentError> {
    if cutoff_hz > 0.0 && cutoff_hz < clock.nyquist_hz() {
        return Ok(());
    }
    let allowed = "above zero and below the Nyquist frequency";
    Err(LtiIdentError::Setting {
        name,
        value: cutoff_hz,
        allowed,
    })
}

/// The signal without what lies above the cut-off, at which half of the amplitude is left. Ends are continued by point
/// reflection.
pub(super) fn low_pass(signal: &[f64], clock: Discrete, cutoff_hz: f64) -> Vec<f64> {
    let Some((&first, &last)) = signal.first().zip(signal.last()) else {
        return Vec::new();
    };
    let settling = (6.0 / (cutoff_hz * clock.sample_time())).ceil();
    let pad = (signal.len() - 1).min(if settling < 1e9 {
        settling as usize
    } else {
        usize::MAX
    });
    let before = (1..=pad).rev().map(|k| 2.0 * first - signal[k]);
    let after = (1..=pad).map(|k| 2.0 * last - signal[signal.len() - 1 - k]);
    let mut padded: Vec<f64> = before.chain(signal.iter().copied()).chain(after).collect();
    let sections = SECTIONS.map(|damping| Section::new(damping, clock, cutoff_hz));
    for _ in 0..2 {
        sections.iter().for_each(|s| s.run(&mut padded));
        padded.reverse();
    }
    padded[pad..pad + signal.len()].to_vec()
}

/// `(b_0 + b_1 q^-1 + b_2 q^-2) / (1 + a_1 q^-1 + a_2 q^-2)` with gain one at rest.
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

impl Section {
    /// `w^2 / (s^2 + damping w s + w^2)` under the bilinear map, cut-off prewarped.
    fn new(damping: f64, clock: Discrete, cutoff_hz: f64) -> Self {
        let w = (std::f64::consts::PI * cutoff_hz * clock.sample_time()).tan();
        let scale = 1.0 / (1.0 + damping * w + w * w);
        let b = w * w * scale;
        Self {
            b: [b, 2.0 * b, b],
            a: [2.0 * (w * w - 1.0) * scale, (1.0 - damping * w + w * w) * scale],
        }
    }

    /// In place, direct form II transposed, at rest at the first value.
    fn run(&self, signal: &mut [f64]) {
        let Some(&rest) = signal.first() else { return };
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        let mut d2 = (b2 - a2) * rest;
        let mut d1 = (b1 - a1) * rest + d2;
        for v in signal {
            let u = *v;
            let y = b0 * u + d1;
            d1 = b1 * u - a1 * y + d2;
            d2 = b2 * u - a2 * y;
            *v = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_amplitude_at_the_cut_off_and_no_shift() {
        let clock = Discrete::new(1e-3).unwrap();
        for (frequency_hz, gain) in [(1.0, 1.0), (20.0, 0.5), (40.0, 1.0 / 257.0)] {
            let wave = |k: usize| (std::f64::consts::TAU * frequency_hz * k as f64 * 1e-3).sin();
            let signal: Vec<f64> = (0..4000).map(wave).collect();
            let filtered = low_pass(&signal, clock, 20.0);
            // Prewarping makes the attenuation above the cut-off a little larger than that in continuous time.
            for k in 1000..3000 {
                assert!(
                    (filtered[k] - gain * signal[k]).abs() < 2e-4,
                    "{frequency_hz}: {k}"
                );
            }
        }
    }

    #[test]
    fn a_ramp_passes_to_its_ends() {
        let clock = Discrete::new(0.01).unwrap();
        let ramp: Vec<f64> = (0..500).map(|k| 3.0 + 0.1 * f64::from(k)).collect();
        let filtered = low_pass(&ramp, clock, 5.0);
        let worst = ramp
            .iter()
            .zip(&filtered)
            .fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-6, "{worst}");
        assert_eq!(low_pass(&[], clock, 5.0), Vec::<f64>::new());
        assert!((low_pass(&[2.0], clock, 5.0)[0] - 2.0).abs() < 1e-12);
    }
}
