//! Values that a log repeats because it runs faster than what it logs.

use lpv_numerics::statistics::median;

/// Different values from which a signal is no switching signal.
const LEVELS: usize = 16;
/// Repeats from which a pattern is one, and the longest repeat: longer ones are rests.
const LEAST: usize = 20;
const LONGEST: usize = 200;
/// A step counts as motion from so many of the smallest steps, and from this part of the usual one.
const QUANTA: f64 = 8.0;
const USUAL: f64 = 0.1;
/// Part of the moving samples that repeat: more than this and than chance on a grid makes, by a factor.
const SHARE: f64 = 0.05;
const CHANCE: f64 = 5.0;

/// Samples that each new value stands, where a signal in motion repeats its values; a sensor with steps does not count, nor a
/// limit, nor what switches between few levels.
pub(super) fn held(x: &[f64]) -> Option<f64> {
    let steps: Vec<f64> = x.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let moving: Vec<f64> = steps.iter().copied().filter(|d| *d > 0.0).collect();
    if moving.len() < LEAST || moving.len() == steps.len() || few_levels(x) {
        return None;
    }
    let (low, high) = lpv_numerics::statistics::range(x);
    // Rounding of a scale makes steps that are none.
    let rounding = 1e-12 * low.abs().max(high.abs());
    let quantum = moving
        .iter()
        .copied()
        .filter(|d| *d > rounding)
        .fold(f64::INFINITY, f64::min);
    let usual = median(&moving);
    let large = |d: f64| d > QUANTA * quantum && d > USUAL * usual;
    // Pairs of changes that are both motion, and the repeats between them.
    let (mut repeats, mut runs, mut pairs) = (0, 0, 0);
    let mut before: Option<usize> = None;
    for (k, d) in steps.iter().enumerate().filter(|(_, d)| **d > 0.0) {
        let between = before.map_or(LONGEST, |b| k - b - 1);
        let inside = x[k] > low && x[k] < high;
        if between < LONGEST && inside && large(*d) && before.is_some_and(|b| large(steps[b])) {
            pairs += 1;
            repeats += between;
            runs += usize::from(between > 0);
        }
        before = Some(k);
    }
    let share = repeats as f64 / (repeats + moving.len()) as f64;
    (runs >= LEAST && share > SHARE + CHANCE * quantum / usual).then(|| 1.0 + repeats as f64 / pairs as f64)
}

fn few_levels(x: &[f64]) -> bool {
    let mut seen: Vec<f64> = Vec::with_capacity(LEVELS);
    for v in x {
        if !seen.contains(v) {
            seen.push(*v);
            if seen.len() >= LEVELS {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::super::kit::Random;
    use super::*;

    /// Filtered noise: a motion of any speed.
    fn motion(random: &mut Random, samples: usize, pole: f64) -> Vec<f64> {
        let mut state = [0.0; 2];
        (0..samples)
            .map(|_| {
                state[0] = pole * state[0] + random.normal();
                state[1] = pole * state[1] + state[0];
                state[1]
            })
            .collect()
    }

    #[test]
    fn every_pattern_of_repeats_is_found_and_its_length_told() {
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let pole = random.between(0.3, 0.995);
            let x = motion(&mut random, 6000, pole);
            let scale = 10f64.powf(random.between(-9.0, 9.0));
            for every in [1.25, 2.0, 2.5, 4.0, 10.0, 17.0] {
                let log: Vec<f64> = (0..6000)
                    .map(|k| scale * x[((f64::from(k) + 0.5) / every) as usize])
                    .collect();
                let found = held(&log).unwrap_or(f64::NAN);
                assert!((found / every - 1.0).abs() < 0.1, "{seed}: {found}, {every}");
            }
        }
    }

    #[test]
    fn sensors_with_steps_limits_rests_and_switches_are_not_held() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(1000 + seed);
            let pole = random.between(0.0, 0.999);
            let x = motion(&mut random, 5000, pole);
            let size = lpv_numerics::statistics::standard_deviation(&x);
            let grid = size * 10f64.powf(random.between(-5.0, 0.0));
            let coarse: Vec<f64> = x.iter().map(|v| (v / grid).round() * grid).collect();
            let cut: Vec<f64> = x.iter().map(|v| v.clamp(-size, size)).collect();
            let rests: Vec<f64> = (0..5000)
                .map(|k| if k / 500 % 2 == 0 { x[k] } else { x[k / 500 * 500] })
                .collect();
            let switches: Vec<f64> = x.iter().enumerate().map(|(k, _)| x[k / 7 * 7].signum()).collect();
            alarms += [coarse, cut, rests, switches]
                .iter()
                .filter(|x| held(x).is_some())
                .count();
        }
        assert!(alarms <= 8, "{alarms} of 800");
    }
}
