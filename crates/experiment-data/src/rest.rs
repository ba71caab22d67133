//! Whether a scheduling signal rests. Only differences of p count, so that its unit and its zero may be any.

use lpv_core::Position;

/// Part of the range of p within which a signal rests.
pub(crate) const REST: f64 = 1e-3;

/// A range that is not so many times what a signal travels is no scale for it.
pub(crate) const SCALE: f64 = 3.0;

/// Von Neumann's ratio above which a signal looks like noise; it is 2 for white noise and near 0 for a motion.
const NOISE: f64 = 1.0;

/// Where a scheduling signal has been. It may come in parts.
#[derive(Debug, Clone)]
pub struct Travel {
    samples: usize,
    first: f64,
    last: f64,
    low: f64,
    high: f64,
    /// Sums of the distances from the first sample, of their squares, and of those of successive differences.
    sum: f64,
    squares: f64,
    steps: f64,
}

impl Default for Travel {
    fn default() -> Self {
        Self {
            samples: 0,
            first: f64::NAN,
            last: f64::NAN,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            sum: 0.0,
            squares: 0.0,
            steps: 0.0,
        }
    }
}

impl Travel {
    /// Of a whole signal.
    pub fn of(p: &[f64]) -> Self {
        let mut travel = Self::default();
        travel.push(p);
        travel
    }

    /// Takes the next samples.
    pub fn push(&mut self, p: &[f64]) {
        for &v in p {
            if self.samples == 0 {
                (self.first, self.last) = (v, v);
            }
            self.samples += 1;
            (self.low, self.high) = (self.low.min(v), self.high.max(v));
            let away = v - self.first;
            self.sum += away;
            self.squares += away * away;
            self.steps += (v - self.last).powi(2);
            self.last = v;
        }
    }

    /// The smallest value; infinity without samples.
    pub fn low(&self) -> f64 {
        self.low
    }

    /// The largest value; minus infinity without samples.
    pub fn high(&self) -> f64 {
        self.high
    }

    /// The mean; of a constant signal exactly its value.
    pub fn mean(&self) -> f64 {
        self.first + self.sum / self.samples as f64
    }

    /// Whether the signal rests: it stays within a thousandth of the range of p over the bundle, or the bundle has no larger
    /// range and it looks like noise. A signal that is constant up to rounding rests without asking for the range.
    pub fn rests(&self, range: impl FnOnce() -> f64) -> bool {
        let travelled = self.high - self.low;
        if travelled <= rounding(self.low.abs().max(self.high.abs())) {
            return true;
        }
        let range = range();
        travelled <= REST * range || (range <= SCALE * travelled && self.von_neumann() > NOISE)
    }

    /// Mean square successive difference over the variance.
    fn von_neumann(&self) -> f64 {
        self.steps / (self.squares - self.sum * self.sum / self.samples as f64)
    }
}

/// Where a record rests.
#[derive(Debug, Clone, PartialEq)]
pub struct RestingPlace {
    /// The position, declared or else the means of the scheduling signals.
    pub position: Position,
    /// How far each scheduling signal strays while it rests, peak to peak: the resolution of a measured position. Zero for a
    /// declared one.
    pub spread: Vec<f64>,
    /// Whether the description says it.
    pub declared: bool,
}

impl RestingPlace {
    /// A position that the description says.
    pub fn declared(position: Position) -> Self {
        Self {
            spread: vec![0.0; position.len()],
            position,
            declared: true,
        }
    }

    /// The place at which the scheduling signals rest.
    pub fn measured(travels: &[Travel]) -> Self {
        Self {
            position: travels.iter().map(Travel::mean).collect::<Vec<f64>>().into(),
            spread: travels.iter().map(|t| t.high - t.low).collect(),
            declared: false,
        }
    }

    /// Whether two positions agree in every scheduling signal, within the resolution that their records show.
    pub fn agrees(&self, other: &Self) -> bool {
        let agree = |i: usize| {
            let (own, its) = (self.position[i], other.position[i]);
            let resolution = self.spread[i].max(other.spread[i]);
            (own - its).abs() <= resolution + rounding(own.abs().max(its.abs()))
        };
        self.position.len() == other.position.len() && (0..self.position.len()).all(agree)
    }
}

/// What rounding makes of numbers of this size: scaled once, averaged once.
fn rounding(size: f64) -> f64 {
    8.0 * f64::EPSILON * size
}

#[cfg(test)]
mod tests {
    use super::{RestingPlace, Travel};

    /// Multiplicative noise from -1 to 1.
    fn noise(k: usize) -> f64 {
        ((k * 7919 % 101) as f64 - 50.0) / 50.0
    }

    #[test]
    fn what_rests_depends_on_no_zero_and_no_unit() {
        for (zero, unit) in [(0.0, 1.0), (1e6, 1.0), (-3e4, 1e3), (7.0, 1e-9), (60_000.0, 1.0)] {
            let of =
                |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..400).map(|k| zero + unit * f(k)).collect() };
            let range = || 2.0 * unit;
            let (still, trembling, moving) = (
                of(&|_| 0.3),
                of(&|k| 0.3 + 9e-4 * noise(k)),
                of(&|k| (k as f64 / 50.0).sin()),
            );
            assert!(Travel::of(&still).rests(|| 0.0));
            assert!(Travel::of(&trembling).rests(range));
            assert!(Travel::of(&trembling).rests(|| 2e-3 * unit));
            assert!(!Travel::of(&moving).rests(range));
            // A slow motion in a bundle of one place, and one of a twentieth of the range.
            assert!(!Travel::of(&moving).rests(|| 2.0 * unit));
            let slow = of(&|k| 0.05 * (k as f64 / 50.0).sin());
            assert!(!Travel::of(&slow).rests(range));
            let near = of(&|k| 0.3004 + 9e-4 * noise(k));
            let far = of(&|k| 0.31 + 9e-4 * noise(k));
            let [a, b, c] = [&trembling, &near, &far].map(|p| RestingPlace::measured(&[Travel::of(p)]));
            assert!(a.agrees(&b) && !a.agrees(&c), "{a:?} {b:?} {c:?}");
        }
    }
}
