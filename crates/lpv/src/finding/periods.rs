//! A periodic record from period to period: does the excitation keep its period, do the signals keep their level?

use lpv_numerics::statistics::standard_deviation;

/// Phase by which the highest lines turn over a record before it matters, and before nothing can be trusted, rad.
const TURNS: [f64; 2] = [0.02, 0.3];
/// Part of the change from period to period that a shift in time must explain.
const EXPLAINED: f64 = 0.5;
/// Rise over a period, in parts of the rms of the motion within it, from which the saw tooth that it makes bends the response.
const BENDS: f64 = 3e-3;
/// How much larger than its scatter about a line the rise of the means must be.
const STRAIGHT: f64 = 10.0;

/// What is known of one column so far, a period at a time.
#[derive(Debug, Clone, Default)]
pub(super) struct Periods {
    last: Vec<f64>,
    means: Vec<f64>,
    /// Of each change from one period to the next, about its mean: product with the slope of the signal, squares of both.
    changes: Vec<[f64; 3]>,
    /// Rms about the mean of the last period.
    size: f64,
}

/// The excitation does not have the period that is declared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shift {
    /// Samples a period in truth.
    pub(super) period: f64,
    /// Turn of the phase over the record, weighted by power, rad.
    pub(super) turn: f64,
    /// Whether no answer can be trusted.
    pub(super) grave: bool,
}

impl Periods {
    pub(super) fn push(&mut self, x: &[f64]) {
        let n = x.len();
        let mean = lpv_numerics::statistics::mean(x);
        if self.last.len() == n && n > 4 {
            let level = mean - self.means.last().copied().unwrap_or(mean);
            let mut sums = [0.0; 3];
            for t in 0..n {
                let at = |k: usize| self.last[(t + n + k - 2) % n];
                let slope = (8.0 * (at(3) - at(1)) - (at(4) - at(0))) / 12.0;
                let change = x[t] - self.last[t] - level;
                sums[0] += change * slope;
                sums[1] += slope * slope;
                sums[2] += change * change;
            }
            self.changes.push(sums);
        }
        self.size = standard_deviation(x);
        self.means.push(mean);
        self.last.clear();
        self.last.extend_from_slice(x);
    }

    /// Where the changes of the second half are those of a signal that moves against the clock of the samples.
    pub(super) fn shift(&self) -> Option<Shift> {
        let settled = &self.changes[self.changes.len() / 2..];
        let sum = |i: usize| settled.iter().map(|s| s[i]).sum::<f64>();
        let (product, slopes, changes) = (sum(0), sum(1), sum(2));
        if slopes == 0.0 || changes == 0.0 || self.size == 0.0 {
            return None;
        }
        let delay = product / slopes;
        let explained = delay * delay * slopes / changes;
        // Each change by itself says the same.
        let alike = settled.iter().all(|s| s[0] * product > 0.0);
        let n = self.last.len() as f64;
        let speed = (slopes / (settled.len() as f64 * n)).sqrt() / self.size;
        let turn = (delay * speed).abs() * self.changes.len() as f64;
        (explained > EXPLAINED && alike && turn > TURNS[0]).then_some(Shift {
            period: n - delay,
            turn,
            grave: turn > TURNS[1],
        })
    }

    /// Rise over a period of a level that drifts evenly through the second half of the record, and the same over the rms of the
    /// motion; none below what matters.
    pub(super) fn drift(&self) -> Option<[f64; 2]> {
        let means = &self.means[self.means.len() / 2..];
        let count = means.len() as f64;
        if means.len() < 3 || self.size == 0.0 {
            return None;
        }
        let middle = (count - 1.0) / 2.0;
        let mean = lpv_numerics::statistics::mean(means);
        let spread: f64 = (0..means.len()).map(|m| (m as f64 - middle).powi(2)).sum();
        let rise = means
            .iter()
            .enumerate()
            .map(|(m, v)| (m as f64 - middle) * (v - mean))
            .sum::<f64>()
            / spread;
        let left = means
            .iter()
            .enumerate()
            .map(|(m, v)| (v - mean - rise * (m as f64 - middle)).powi(2));
        let scatter = (left.sum::<f64>() / (count - 2.0)).sqrt();
        let part = rise.abs() / self.size;
        (part > BENDS && rise.abs() * spread.sqrt() > STRAIGHT * scatter).then_some([rise, part])
    }
}

#[cfg(test)]
mod tests {
    use super::super::kit::{Plant, Random, multisine};
    use super::*;

    fn watched(x: &[f64], period: usize) -> Periods {
        let mut periods = Periods::default();
        x.chunks(period).for_each(|x| periods.push(x));
        periods
    }

    /// A multisine sampled by a clock of its own.
    fn shifted(random: &mut Random, samples: usize, period: f64, lines: usize) -> Vec<f64> {
        let phases: Vec<f64> = (0..lines).map(|_| random.unit()).collect();
        (0..samples)
            .map(|t| {
                let turns = t as f64 / period;
                phases
                    .iter()
                    .enumerate()
                    .map(|(k, p)| (std::f64::consts::TAU * ((k + 1) as f64 * turns + p)).cos())
                    .sum()
            })
            .collect()
    }

    #[test]
    fn the_true_period_is_told() {
        for seed in 0..30 {
            let mut random = Random::new(seed);
            let period = 500.0 + (200.0 * random.unit()).floor();
            let lines = 20 + (40.0 * random.unit()) as usize;
            for off in [0.5, 0.1, -0.03] {
                let mut x = shifted(&mut random, 8 * period as usize, period + off, lines);
                let noise = 0.05 * off.abs() * random.unit();
                x.iter_mut().for_each(|x| *x += noise * random.normal());
                let scale = random.decades(6.0);
                x.iter_mut().for_each(|x| *x *= scale);
                let found = watched(&x, period as usize).shift();
                let told = found.map_or(f64::NAN, |f| f.period - period);
                assert!((told / off - 1.0).abs() < 0.15, "{seed}, {off}: {found:?}");
            }
        }
    }

    #[test]
    fn a_level_that_drifts_is_told_by_its_rise() {
        for seed in 0..30 {
            let mut random = Random::new(seed);
            let scale = random.decades(6.0);
            let rise = 10f64.powf(random.between(-2.0, 1.0));
            let mut x = multisine(&mut random, 400, 50, 3200);
            x.iter_mut()
                .enumerate()
                .for_each(|(t, x)| *x = scale * (*x + rise * t as f64 / 400.0 + 1e-3 * random.normal()));
            let [found, _] = watched(&x, 400).drift().unwrap();
            assert!((found / (scale * rise) - 1.0).abs() < 0.02, "{seed}");
        }
    }

    #[test]
    fn noise_and_transients_neither_shift_nor_drift() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(700 + seed);
            let plant = Plant::machine(
                random.between(0.01, 0.2),
                random.between(0.01, 0.1),
                [0.98, 0.97],
                random.decades(3.0),
            );
            let period = 512;
            let lines = 20 + (200.0 * random.unit()) as usize;
            let u = multisine(&mut random, period, lines, period * (4 + seed as usize % 6));
            let mut y = plant.open(&u);
            let size = standard_deviation(&y) * 10f64.powf(random.between(-6.0, -0.5));
            y.iter_mut().for_each(|y| *y += size * random.normal());
            let watched = watched(&y, period);
            alarms += usize::from(watched.shift().is_some()) + usize::from(watched.drift().is_some());
        }
        assert!(alarms <= 2, "{alarms} of 200");
    }
}
