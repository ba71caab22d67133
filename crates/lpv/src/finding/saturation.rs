//! An amplifier that clips the command that was logged: with the command cut at the right level the response is smooth.

use lpv_core::num_complex::Complex;
use lpv_numerics::statistics::median;
use realfft::RealFftPlanner;

/// Roughness of a response from which a cause is looked for, and the part of it that a cut command must leave.
const ROUGH: f64 = 0.015;
const SMOOTH: f64 = 0.35;
/// Lines that tell a roughness.
const LINES: usize = 20;
/// Levels that are tried, parts of the largest command.
const LEVELS: std::ops::RangeInclusive<usize> = 10..=98;

/// The command beyond which the machine did not follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Saturation {
    /// In the unit of the input.
    pub(super) level: f64,
    /// Median jump of the size of the response from line to line, percent, with the command as it was logged and cut there.
    pub(super) percent: [f64; 2],
}

/// Mean periods of a command and of an output, and the excited lines.
pub(super) fn saturation(u: &[f64], y: &[f64], lines: &[usize]) -> Option<Saturation> {
    let transform = |x: &[f64]| -> Option<Vec<Complex<f64>>> {
        let plan = RealFftPlanner::<f64>::new().plan_fft_forward(x.len());
        let (mut input, mut spectrum) = (x.to_vec(), plan.make_output_vec());
        plan.process(&mut input, &mut spectrum).ok()?;
        Some(spectrum)
    };
    let output = transform(y)?;
    // Lines whose neighbours are as far away on either side.
    let even = |w: &&[usize]| w[1] - w[0] == w[2] - w[1] && w[2] < output.len();
    let triples: Vec<[usize; 3]> = lines
        .windows(3)
        .filter(even)
        .map(|w| [w[0], w[1], w[2]])
        .collect();
    if triples.len() < LINES {
        return None;
    }
    let rough = |u: &[f64]| -> Option<f64> {
        let input = transform(u)?;
        let size = |k: usize| (output[k].norm() / input[k].norm()).ln();
        let jumps = triples
            .iter()
            .map(|[a, b, c]| (size(*b) - 0.5 * (size(*a) + size(*c))).abs());
        Some(median(&jumps.collect::<Vec<_>>()))
    };
    let logged = rough(u)?;
    if logged.is_nan() || logged < ROUGH {
        return None;
    }
    let largest = u.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let at = |level: f64| {
        let cut: Vec<f64> = u.iter().map(|v| v.clamp(-level, level)).collect();
        rough(&cut)
    };
    let tried = LEVELS.step_by(2).filter_map(|part| {
        let level = 0.01 * part as f64 * largest;
        Some((level, at(level)?))
    });
    let (level, left) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (left < SMOOTH * logged).then_some(Saturation {
        level,
        percent: [100.0 * logged, 100.0 * left],
    })
}

#[cfg(test)]
mod tests {
    use super::super::kit::{Plant, Random, multisine};
    use super::*;

    /// The last period of a machine behind an amplifier that clips, noise added.
    fn measured(random: &mut Random, limit: f64, noise: f64) -> [Vec<f64>; 2] {
        let period = 512 + 2 * (256.0 * random.unit()) as usize;
        let lines = 60 + (150.0 * random.unit()) as usize;
        let size = random.decades(3.0);
        let u: Vec<f64> = multisine(random, period, lines, 12 * period)
            .iter()
            .map(|u| size * u)
            .collect();
        let acts: Vec<f64> = u.iter().map(|u| u.clamp(-limit * size, limit * size)).collect();
        let plant = Plant::machine(
            random.between(0.03, 0.2),
            random.between(0.01, 0.05),
            [0.98, 0.97],
            random.decades(3.0),
        );
        let y = plant.open(&acts);
        let scale = noise * lpv_numerics::statistics::standard_deviation(&y);
        let y = y.iter().map(|y| y + scale * random.normal());
        [u[11 * period..].to_vec(), y.skip(11 * period).collect()]
    }

    #[test]
    fn a_clipped_command_is_seen_with_its_level_and_clean_ones_are_not() {
        let (mut found, mut alarms) = (0, 0);
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let noise = 10f64.powf(random.between(-6.0, -1.0));
            let clean = measured(&mut random, f64::INFINITY, noise);
            let lines: Vec<usize> = (1..=60).collect();
            alarms += usize::from(saturation(&clean[0], &clean[1], &lines).is_some());
            if seed < 40 {
                let limit = random.between(0.8, 1.8);
                let [u, y] = measured(&mut random, limit, 0.1 * noise.min(1e-3));
                if let Some(told) = saturation(&u, &y, &lines) {
                    let rms = lpv_numerics::statistics::standard_deviation(&u);
                    assert!(
                        (told.level / (limit * rms) - 1.0).abs() < 0.1,
                        "{seed}: {told:?}, {}",
                        limit * rms
                    );
                    found += 1;
                }
            }
        }
        assert!(found >= 38, "{found} of 40");
        assert!(alarms <= 2, "{alarms} of 200");
    }
}
