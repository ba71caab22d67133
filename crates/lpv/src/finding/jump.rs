//! Positions that jump: what has mass goes no way in no time, so that a sensor lost its place, a reading is wrong, or samples are missing.

/// Times the largest of all other steps that a jump takes at the least.
const JUMP: f64 = 8.0;
/// Most jumps of a record: what jumps more often may be a switch, or a machine that is faster than its log.
const MOST: usize = 8;
/// Fewest other steps that are not zero.
const FEWEST: usize = 64;

/// Where a position jumps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jump {
    /// The largest, in the unit of the signal.
    pub(super) size: f64,
    /// How often.
    pub(super) times: usize,
    /// First sample behind the first, from 0.
    pub(super) sample: usize,
}

/// A few steps far larger than all others.
pub(super) fn jump(x: &[f64]) -> Option<Jump> {
    let steps: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let mut order: Vec<usize> = (0..steps.len()).collect();
    order.sort_by(|a, b| steps[*b].abs().total_cmp(&steps[*a].abs()));
    let size = |i: usize| order.get(i).map_or(0.0, |k| steps[*k].abs());
    let moving = steps.iter().filter(|d| **d != 0.0).count();
    let times = (1..=MOST).find(|n| size(*n) > 0.0 && size(n - 1) > JUMP * size(*n))?;
    (moving >= FEWEST + times).then(|| Jump {
        size: steps[order[0]],
        times,
        sample: order[..times].iter().min().map_or(0, |k| k + 1),
    })
}

#[cfg(test)]
mod tests {
    use super::super::kit::Random;
    use super::*;

    /// Moves there and back with rests between, on the grid of an encoder or with noise.
    fn moves(random: &mut Random, samples: usize) -> (Vec<f64>, f64) {
        let size = random.decades(6.0);
        let grid = size / 10f64.powf(random.between(3.0, 6.0));
        let (mut at, mut speed, mut aim) = (0.0, 0.0, 0.0);
        let noise = random.noise(samples, grid);
        let all = (0..samples).map(|k| {
            if k % 300 == 0 {
                aim = if random.between(0.0, 1.0) < 0.3 {
                    0.0
                } else {
                    size * random.between(-1.0, 1.0) / 200.0
                };
            }
            speed += 0.05 * (aim - speed);
            at += speed;
            ((at + noise[k]) / grid).round() * grid
        });
        (all.collect(), size)
    }

    #[test]
    fn jumps_of_a_sensor_are_found_and_moves_are_none() {
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let (x, size) = moves(&mut random, 3000);
            assert_eq!(jump(&x), None, "{seed}");
            let mut outlier = x.clone();
            outlier[1200] += 0.4 * size;
            let mut lost = x.clone();
            lost[1700..].iter_mut().for_each(|x| *x -= 0.4 * size);
            for (x, times, sample) in [(outlier, 2, 1200), (lost, 1, 1700)] {
                let found = jump(&x).unwrap();
                assert_eq!((found.times, found.sample), (times, sample), "{seed}");
                assert!((found.size.abs() / (0.4 * size) - 1.0).abs() < 0.05);
            }
        }
    }
}
