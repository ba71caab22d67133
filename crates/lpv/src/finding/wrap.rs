//! Counters that run over: a jump by the whole range of the counter.

use lpv_numerics::statistics::{mean, range};

/// Part of the range that a jump takes at least, and the most that any other step may take of it.
const JUMP: f64 = 0.6;
const OTHER: f64 = 0.2;
/// Counts that a whole number may differ from its reading.
const WHOLE: f64 = 1e-6;
/// Smallest counter that is looked for, and largest, in bits.
const BITS: std::ops::RangeInclusive<i32> = 8..=48;
/// Ranges of sensors that read angles, in their units: degrees, turns, radians.
const TURNS: [f64; 3] = [360.0, 1.0, std::f64::consts::TAU];

/// A counter that ran over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wrap {
    /// Range of the counter, in the unit of the signal.
    pub(super) modulus: f64,
    /// How often it ran over.
    pub(super) times: usize,
    /// First sample after the first jump, from 0.
    pub(super) sample: usize,
}

/// A counter that ran over, if this is one.
pub(super) fn wrap(x: &[f64]) -> Option<Wrap> {
    by_jumps(x).or_else(|| by_bends(x))
}

/// Whole counts of an unsigned or signed counter whose motion is smooth only where its steps are the shortest way round: a motor may go a
/// quarter of the range from one sample to the next.
fn by_bends(x: &[f64]) -> Option<Wrap> {
    /// Part of the squared second differences that is left of them.
    const LESS: f64 = 0.1;
    /// Times the others that those at the jumps may be: behind one the motion goes on as it was before.
    const ALIKE: f64 = 3.0;
    let (low, high) = range(x);
    let fits = |m: &f64| {
        let is_within = low >= 0.0 && high < *m || low >= -0.5 * m && high < 0.5 * m;
        is_within && high - low > JUMP * m
    };
    let modulus = BITS.map(|bits| 2f64.powi(bits)).find(fits)?;
    if x.iter().any(|v| v.fract() != 0.0) {
        return None;
    }
    let steps: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let bends = |steps: &[f64]| steps.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>();
    let shortest: Vec<f64> = steps
        .iter()
        .map(|d| d - modulus * (d / modulus).round())
        .collect();
    let is_jump = |k: usize| steps[k] != shortest[k];
    let jumps = || (0..steps.len()).filter(|k| is_jump(*k));
    let (mut at_jumps, mut elsewhere) = (Vec::new(), Vec::new());
    for (k, w) in shortest.windows(2).enumerate() {
        let bends = if is_jump(k) || is_jump(k + 1) {
            &mut at_jumps
        } else {
            &mut elsewhere
        };
        bends.push((w[1] - w[0]).powi(2));
    }
    let goes_on = mean(&at_jumps) <= ALIKE * ALIKE * mean(&elsewhere);
    // What jumps to another level and rests there is a switch.
    let moves =
        |k: &usize| *k > 0 && shortest[k - 1] != 0.0 || shortest.get(k + 1).is_some_and(|d| *d != 0.0);
    let moving = jumps().filter(moves).count();
    (goes_on && 2 * moving > jumps().count() && bends(&shortest) < LESS * bends(&steps)).then_some(Wrap {
        modulus,
        times: jumps().count(),
        sample: jumps().next()? + 1,
    })
}

/// Jumps of one size where all else is smooth, of a size that counters have; the motion goes on behind each as it was before.
fn by_jumps(x: &[f64]) -> Option<Wrap> {
    let (low, high) = range(x);
    let steps: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let largest = steps.iter().map(|d| d.abs()).fold(0.0, f64::max);
    if largest <= 0.0 || !largest.is_finite() || largest < JUMP * (high - low) {
        return None;
    }
    let jumps: Vec<usize> = (0..steps.len())
        .filter(|k| steps[*k].abs() > (1.0 - OTHER) * largest)
        .collect();
    let is_jump = |d: f64| d.abs() > (1.0 - OTHER) * largest;
    let other = steps
        .iter()
        .map(|d| d.abs())
        .filter(|d| !is_jump(*d))
        .fold(0.0, f64::max);
    if other > OTHER * largest || other == 0.0 {
        return None;
    }
    let modulus = modulus(x, largest, other)?;
    // The steps before and behind the jump say what the step itself would have been.
    let continues = |k: &usize| {
        let beside = [k.checked_sub(1), Some(k + 1)];
        let beside = beside
            .into_iter()
            .flatten()
            .filter_map(|i| steps.get(i))
            .filter(|d| !is_jump(**d));
        let (sum, count) = beside.fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
        let unwrapped = steps[*k] - modulus * steps[*k].signum();
        count > 0 && (unwrapped - sum / f64::from(count)).abs() <= other
    };
    // Where it turns back within the noise, some have no neighbour that is none.
    let smooth = jumps.iter().filter(|k| continues(k)).count();
    // What jumps to another level and rests there is a switch.
    let moves = jumps.iter().any(|k| steps[*k].abs() != modulus);
    (moves && 10 * smooth >= 6 * jumps.len()).then(|| Wrap {
        modulus,
        times: jumps.len(),
        sample: jumps[0] + 1,
    })
}

/// The range of a counter that jumps by about so much.
fn modulus(x: &[f64], jump: f64, other: f64) -> Option<f64> {
    let near = |m: &f64| (m - jump).abs() <= 2.0 * other;
    let unit = quantum(x, other);
    let counter = unit.and_then(|unit| BITS.map(|bits| unit * 2f64.powi(bits)).find(near));
    counter.or_else(|| TURNS.into_iter().find(|m| near(m) && other < 0.1 * m))
}

/// The step of a signal that has one: all values are whole multiples of it away from the first. A counter that is given as it is
/// has the step 1.
fn quantum(x: &[f64], other: f64) -> Option<f64> {
    let largest = x.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let whole = |unit: f64| {
        // Rounding of a scale grows with the number.
        let slack = WHOLE + 4.0 * f64::EPSILON * largest / unit;
        slack < 0.1
            && x.iter()
                .map(|v| (v - x[0]) / unit)
                .all(|n| (n - n.round()).abs() < slack)
    };
    let least = (1e-8 * other).max(1e3 * f64::EPSILON * largest);
    let (mut unit, mut most) = (0.0, 0.0f64);
    for d in x
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|d| *d > least && *d <= other)
    {
        unit = common(unit, d, least);
        if unit <= least {
            return None;
        }
        // The largest step tells it best.
        most = most.max(d);
        unit = most / (most / unit).round();
    }
    // The whole range tells it better than one step.
    let (low, high) = range(x);
    let fine = (high - low) / ((high - low) / unit).round();
    [1.0, fine].into_iter().find(|u| whole(*u))
}

/// The largest number of which both are whole multiples, up to rounding.
fn common(mut a: f64, mut b: f64, least: f64) -> f64 {
    while a > least {
        (a, b) = (b - (b / a).round() * a, a);
        a = a.abs();
    }
    b
}

#[cfg(test)]
mod tests {
    use super::super::kit::Random;
    use super::*;

    /// Back and forth, each way of its own length and speed.
    fn motion(random: &mut Random, samples: usize, size: f64) -> Vec<f64> {
        let mut at = 0.0;
        let mut speed = 0.0;
        let mut aim = 0.0;
        (0..samples)
            .map(|k| {
                if k % 400 == 0 {
                    aim = size * random.between(-1.0, 1.0) / 200.0;
                }
                speed += 0.02 * (aim - speed);
                at += speed;
                at
            })
            .collect()
    }

    #[test]
    fn counters_of_any_width_and_unit_are_found() {
        for seed in 0..60 {
            let mut random = Random::new(seed);
            let bits = 10 + (seed % if seed % 2 == 0 { 22 } else { 13 }) as i32;
            let modulus = 2f64.powi(bits);
            let size = modulus * random.between(0.7, 1.5);
            let x = motion(&mut random, 8000, size);
            let scale = if seed % 2 == 0 { 1.0 } else { random.decades(9.0) };
            let start = random.between(0.0, modulus);
            let counts: Vec<f64> = x
                .iter()
                .map(|v| scale * ((v + start).round().rem_euclid(modulus) - 0.5 * modulus))
                .collect();
            let jumps = counts
                .windows(2)
                .filter(|w| (w[1] - w[0]).abs() > 0.5 * scale * modulus)
                .count();
            let found = wrap(&counts);
            match found {
                Some(found) => {
                    assert!(
                        (found.modulus / (scale * modulus) - 1.0).abs() < 1e-6,
                        "{seed}: {found:?}"
                    );
                    assert_eq!(found.times, jumps);
                }
                None => assert_eq!(jumps, 0, "{seed}: {bits} bits, scale {scale}"),
            }
        }
    }

    /// A fast motor: up to a quarter of the range from sample to sample, about zero or about the middle.
    #[test]
    fn fast_counters_are_found_and_noise_is_none() {
        let mut found = 0;
        for seed in 0..60 {
            let mut random = Random::new(90 + seed);
            let modulus = 2f64.powi(8 + (seed % 25) as i32);
            let size = modulus * random.between(5.0, 45.0);
            let start = [0.0, 0.5 * modulus, random.between(0.0, modulus)][seed as usize % 3];
            let low = if seed % 2 == 0 { 0.0 } else { -0.5 * modulus };
            let x = motion(&mut random, 4000, size);
            let counts: Vec<f64> = x
                .iter()
                .map(|v| (v + start).round().rem_euclid(modulus) + low)
                .collect();
            found += usize::from(wrap(&counts).is_some_and(|w| w.modulus == modulus));
            let noise: Vec<f64> = (0..4000).map(|_| random.between(0.0, modulus).floor()).collect();
            assert_eq!(wrap(&noise), None, "{seed}");
            // A switch that is read with noise.
            let dither = random.between(0.002, 0.02) * modulus;
            let switch: Vec<f64> = (0..4000)
                .map(|k| 0.45 * modulus * [-1.0, 1.0][k / 37 % 2] + random.between(-dither, dither))
                .map(f64::round)
                .collect();
            assert_eq!(wrap(&switch), None, "{seed}");
            let inside: Vec<f64> = x
                .iter()
                .map(|v| (0.4 * modulus * (v / size).sin()).round())
                .collect();
            assert_eq!(wrap(&inside), None, "{seed}");
        }
        assert!(found >= 55, "{found} of 60");
    }

    #[test]
    fn steps_spikes_and_switches_are_no_counters() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(500 + seed);
            let size = random.decades(6.0);
            let mut x = motion(&mut random, 4000, size);
            let noise = random.noise(4000, 1e-4 * size);
            x.iter_mut().zip(&noise).for_each(|(x, e)| *x += e);
            let mut spike = x.clone();
            spike[2000] += 50.0 * size;
            let square: Vec<f64> = (0..4000)
                .map(|k| size * f64::from(k / 300 % 2) + noise[k as usize])
                .collect();
            let counts: Vec<f64> = (0..4000).map(|k| f64::from(1000 * (k / 300 % 2))).collect();
            alarms += [x, spike, square, counts]
                .iter()
                .filter(|x| wrap(x).is_some())
                .count();
        }
        assert!(alarms <= 8, "{alarms} of 800");
    }
}
