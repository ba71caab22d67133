//! What the steps of an encoder do to an estimate.
//!
//! The error of rounding repeats with the motion: of a slow sine it sits at the lines of the sine and of its harmonics,
//! where no average over neighbouring lines sees its full height. So the motion is rounded again, with other offsets
//! against the steps and amplitudes that differ by part of a step.

use super::filter;
use super::lines::{C, spectrum, window};
use lpv_core::Discrete;
use realfft::RealFftPlanner;

/// The step of the readings; zero where they have none.
pub(super) fn step(position: &[f64]) -> f64 {
    let mut sorted = position.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(&least), Some(&most)) = (sorted.first(), sorted.last()) else {
        return 0.0;
    };
    let exact = 1e-9 * (most - least) + 64.0 * f64::EPSILON * most.abs().max(least.abs());
    let gaps: Vec<f64> = sorted
        .windows(2)
        .map(|v| v[1] - v[0])
        .filter(|d| *d > exact)
        .collect();
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let mut alike: Vec<f64> = gaps.iter().copied().filter(|d| *d < 1.5 * smallest).collect();
    alike.sort_by(f64::total_cmp);
    let Some(&step) = alike.get(alike.len() / 2) else {
        return 0.0;
    };
    let whole = gaps
        .iter()
        .filter(|d| (*d / step - (*d / step).round()).abs() < 0.05)
        .count();
    let is_stepped = gaps.len() >= 2 && 20 * whole > 19 * gaps.len();
    if is_stepped { step } else { 0.0 }
}

/// Times that the motion is rounded again.
pub(super) const TIMES: usize = 16;
/// Noise of the position over the step from which the error of rounding does not repeat any more.
const DITHERED: f64 = 0.7;

/// Spectra of the force that errors of rounding make of a position: `force` maps three neighbours to a force. None
/// where the readings have no steps, or enough noise on them.
pub(super) fn forces(
    position: &[f64],
    clock: Discrete,
    cutoff_hz: f64,
    force: impl Fn(&[f64]) -> f64,
) -> Option<Vec<Vec<C>>> {
    let step = step(position);
    if step <= 0.0 || position.len() < 20 {
        return None;
    }
    let smooth = filter::low_pass(position, clock, cutoff_hz);
    let tenth = position.len() / 10;
    let inside = tenth..position.len() - tenth;
    let squares = inside.clone().map(|k| (position[k] - smooth[k]).powi(2));
    let noise = (squares.sum::<f64>() / inside.len() as f64 - step * step / 12.0)
        .max(0.0)
        .sqrt();
    if noise > DITHERED * step {
        return None;
    }
    let mut sorted = smooth.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let range = sorted[sorted.len() - 1] - sorted[0];
    let spread = (2.0 * step / (range + step)).min(0.05);
    let mut planner = RealFftPlanner::new();
    let window = window(position.len() - 2);
    let mut dither = Dither(1);
    let one = |time: usize| {
        // Parts of a step and amplitudes that fill their ranges evenly.
        let even = |ratio: f64| ((time as f64 + 0.5) * ratio).fract();
        let amplitude = 1.0 + spread * (2.0 * even(0.618_033_988_749_895) - 1.0);
        let offset = step * even(0.754_877_666_246_693);
        let error = |q: &f64| {
            let q = middle + amplitude * (q - middle) + offset + noise * dither.next();
            (q / step).round() * step - q
        };
        let errors: Vec<f64> = smooth.iter().map(error).collect();
        let forces: Vec<f64> = errors.windows(3).map(&force).collect();
        spectrum(&mut planner, &forces, &window)
    };
    Some((0..TIMES).map(one).collect())
}

/// Numbers of mean zero and variance one that look random: sums of four from a SplitMix generator.
struct Dither(u64);

impl Dither {
    fn next(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..4 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            sum += ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        }
        sum * 3f64.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_found_and_smooth_readings_have_none() {
        let wave = |k: usize| 3.0 + 0.7 * (0.01 * k as f64).sin();
        let rounded: Vec<f64> = (0..3000).map(|k| (wave(k) * 500.0).round() / 500.0).collect();
        assert!((step(&rounded) / 0.002 - 1.0).abs() < 1e-6, "{}", step(&rounded));
        let smooth: Vec<f64> = (0..3000).map(wave).collect();
        assert_eq!(step(&smooth), 0.0);
        assert_eq!(step(&[2.0; 9]), 0.0);
    }
}
