//! Does a signal stay at its extreme value? The rules are documented at [`crate::RecordError::Clipped`].

/// A plateau at an extreme value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clipped {
    pub(crate) extreme: f64,
    pub(crate) samples: usize,
}

/// Signals with fewer different values are switching signals.
const LEVELS: usize = 16;

/// Clipping of a steady periodic signal, by counting; takes the signal in parts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ends {
    samples: usize,
    last: Option<f64>,
    /// The first different values, up to [`LEVELS`].
    seen: Vec<f64>,
    ends: [End; 2],
}

/// The largest value so far and the next ones, the first two with how often they came.
#[derive(Debug, Clone, Copy)]
struct End {
    top: (f64, usize),
    next: (f64, usize),
    third: f64,
    /// Steps by which the largest value was reached: their sum and number.
    entered: (f64, usize),
}

impl Default for End {
    fn default() -> Self {
        let none = (f64::NEG_INFINITY, 0);
        Self {
            top: none,
            next: none,
            third: f64::NEG_INFINITY,
            entered: (0.0, 0),
        }
    }
}

impl End {
    fn push(&mut self, before: Option<f64>, v: f64) {
        if v > self.top.0 {
            (self.third, self.next, self.top) = (self.next.0, self.top, (v, 1));
            self.entered = (0.0, 0);
        } else if v == self.top.0 {
            self.top.1 += 1;
        } else if v > self.next.0 {
            (self.third, self.next) = (self.next.0, (v, 1));
        } else if v == self.next.0 {
            self.next.1 += 1;
        } else if v > self.third {
            self.third = v;
        }
        if let Some(before) = before.filter(|b| v == self.top.0 && *b != v) {
            self.entered = (self.entered.0 + (v - before), self.entered.1 + 1);
        }
    }

    /// Whether a smooth peak through a coarse converter looks like this: its three largest values are whole steps apart, and
    /// the largest is reached by single ones.
    fn is_rounded(&self) -> bool {
        const WHOLE: f64 = 1e-3;
        const STEPS: f64 = 1.5;
        let (a, b) = (self.top.0 - self.next.0, self.next.0 - self.third);
        let ratio = a.max(b) / a.min(b);
        let coarse = (ratio - ratio.round()).abs() < WHOLE;
        coarse && self.entered.0 <= STEPS * self.entered.1 as f64 * a.min(b)
    }
}

/// Samples that are looked at together.
const PART: usize = 64;

/// Upwards and downwards.
const SIGNS: [f64; 2] = [1.0, -1.0];

impl Ends {
    pub(crate) fn push(&mut self, x: &[f64]) {
        self.samples += x.len();
        add_levels(&mut self.seen, x);
        for (end, sign) in self.ends.iter_mut().zip(SIGNS) {
            // Most parts have nothing as large as the three largest: that is seen of many samples at once.
            let mut before = self.last;
            for part in x.chunks(PART) {
                let third = end.third;
                if part.iter().fold(false, |any, v| any | (sign * v >= third)) {
                    for v in part {
                        end.push(before.map(|b| sign * b), sign * v);
                        before = Some(*v);
                    }
                }
                before = part.last().copied();
            }
        }
        self.last = x.last().copied().or(self.last);
    }

    pub(crate) fn clipped(&self) -> Option<Clipped> {
        const SHARE: f64 = 1e-3;
        if self.seen.len() < LEVELS {
            return None;
        }
        self.ends.iter().zip(SIGNS).find_map(|(end, sign)| {
            let ((top, count), (_, next)) = (end.top, end.next);
            let often = count >= 5 && count as f64 > SHARE * self.samples as f64 && count > 4 * next;
            let clipped = often && !end.is_rounded();
            clipped.then_some(Clipped {
                extreme: sign * top,
                samples: count,
            })
        })
    }
}

/// Clipping of a signal that may rest, by plateaus that are entered and left at speed.
pub(crate) fn transient(x: &[f64]) -> Option<Clipped> {
    const SHARE: f64 = 2e-3;
    const SLOPE: f64 = 0.3;
    if switches(x) || piecewise_linear(x) || held(x) {
        return None;
    }
    let steps = || x.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0);
    let converter_step = steps().fold(f64::INFINITY, f64::min);
    let moving = steps().count();
    let rms = (steps().map(|d| d * d).sum::<f64>() / moving as f64).sqrt();
    let steep = |d: f64| d.abs() > SLOPE * rms && d.abs() > 3.0 * converter_step;
    let [low, high] = range(x);
    // Plateaus below, above and in between: how many, and how many samples they have.
    let mut plateaus = [(0, 0); 3];
    let mut k = 0;
    while k < x.len() {
        let start = k;
        while k < x.len() && x[k] == x[start] {
            k += 1;
        }
        if k >= start + 3 && start >= 2 && k + 1 < x.len() {
            // One step further out than the edge, too, because the plateau has cut the step at the edge.
            let entered = steep(x[start] - x[start - 1]) || steep(x[start - 1] - x[start - 2]);
            let left = steep(x[k] - x[k - 1]) || steep(x[k + 1] - x[k]);
            if entered && left {
                let which = if x[start] == low {
                    0
                } else {
                    1 + usize::from(x[start] != high)
                };
                plateaus[which].0 += 1;
                plateaus[which].1 += k - start;
            }
        }
    }
    // A signal that also stays at other values on the way is coarse, or rests.
    let elsewhere = plateaus[2].0;
    [(high, plateaus[1]), (low, plateaus[0])]
        .into_iter()
        .find(|(_, (count, samples))| {
            *count > elsewhere && *samples >= 5 && *samples as f64 > SHARE * x.len() as f64
        })
        .map(|(extreme, (_, samples))| Clipped { extreme, samples })
}

/// Whether the signal jumps from level to level: most of its samples repeat the one before, and it moves at least now and
/// then. A plateau at the top is then one level of many.
fn held(x: &[f64]) -> bool {
    let repeats = x.windows(2).filter(|w| w[0] == w[1]).count();
    // Rest at the ends of a move is one long plateau and no level of many.
    let jumps = x.windows(2).filter(|w| w[0] != w[1]).count();
    let single = x.windows(3).filter(|w| w[0] != w[1] && w[1] != w[2]).count();
    2 * repeats > x.len() && 4 * single < jumps
}

fn switches(x: &[f64]) -> bool {
    let mut seen = Vec::with_capacity(LEVELS);
    add_levels(&mut seen, x);
    seen.len() < LEVELS
}

/// Different values of a signal, until there are [`LEVELS`] of them.
fn add_levels(seen: &mut Vec<f64>, x: &[f64]) {
    for v in x {
        if seen.len() == LEVELS {
            return;
        }
        if !seen.contains(v) {
            seen.push(*v);
        }
    }
}

/// Smallest and largest value.
fn range(x: &[f64]) -> [f64; 2] {
    x.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
        [l.min(*v), h.max(*v)]
    })
}

/// Whether more than half of the moving samples continue the line through the two before.
fn piecewise_linear(x: &[f64]) -> bool {
    let [low, high] = range(x);
    let width = high - low;
    let (mut straight, mut moving) = (0usize, 0usize);
    for w in x.windows(3) {
        if w[1] != w[0] {
            moving += 1;
            straight += usize::from((w[2] - 2.0 * w[1] + w[0]).abs() < 1e-9 * width);
        }
    }
    2 * straight > moving
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    #[test]
    fn held_levels_are_not_clipped_and_a_clipped_move_still_is() {
        // White levels, each held for seven samples.
        let levels: Vec<f64> = (0..210u64)
            .flat_map(|k| [((k * 7919) % 1009) as f64; 7])
            .collect();
        assert_eq!(transient(&levels), None);
        // Rest, then a swing that is cut, then rest.
        let swing: Vec<f64> = (0..1000)
            .map(|k| match k {
                0..300 | 700.. => 0.0,
                _ => (TAU * f64::from(k - 300) / 40.0).sin().min(0.8),
            })
            .collect();
        assert!(transient(&swing).is_some());
    }

    /// In two parts.
    fn periodic(x: &[f64]) -> Option<Clipped> {
        let mut ends = Ends::default();
        let (a, b) = x.split_at(x.len() / 3);
        ends.push(a);
        ends.push(b);
        ends.clipped()
    }

    fn multisine(n: usize, period: usize) -> Vec<f64> {
        let f = |k: usize, line: f64, phase: f64| (TAU * line * k as f64 / period as f64 + phase).sin();
        (0..n)
            .map(|k| f(k, 3.0, 0.2) + 0.7 * f(k, 7.0, 1.3) + 0.5 * f(k, 11.0, 2.9))
            .collect()
    }

    #[test]
    fn finds_cut_multisines_and_passes_whole_and_coarse_ones() {
        let x = multisine(4 * 512, 512);
        assert_eq!(periodic(&x), None);
        let cut: Vec<f64> = x.iter().map(|v| v.min(1.4)).collect();
        let found = periodic(&cut).unwrap();
        assert_eq!(found.extreme, 1.4);
        assert_eq!(found.samples, x.iter().filter(|v| **v >= 1.4).count());
        let low: Vec<f64> = x.iter().map(|v| v.max(-1.2)).collect();
        assert_eq!(periodic(&low).unwrap().extreme, -1.2);
        let coarse: Vec<f64> = x.iter().map(|v| (v * 20.0).round() / 20.0).collect();
        assert_eq!(periodic(&coarse), None);
        let binary: Vec<f64> = x.iter().map(|v| v.signum()).collect();
        assert_eq!(periodic(&binary), None);
    }

    /// A smooth peak through a coarse converter stays at its rounded extreme for some samples, in each period alike.
    #[test]
    fn a_rounded_extreme_is_not_clipping() {
        let mut cut_found = 0;
        for n in 0..200 {
            let period = 200 + 23 * n;
            let x: Vec<f64> = multisine(period, period).repeat(6);
            for steps in [15.0, 40.0, 130.0, 1000.0] {
                let coarse: Vec<f64> = x.iter().map(|v| (v * steps).round() / steps).collect();
                assert_eq!(periodic(&coarse), None, "period {period}, {steps} steps a unit");
            }
            let cut: Vec<f64> = x.iter().map(|v| v.min(1.3)).collect();
            cut_found += usize::from(periodic(&cut).is_some());
        }
        assert_eq!(cut_found, 200);
    }

    #[test]
    fn rest_is_not_clipping_but_a_cut_motion_is() {
        // Smooth back-and-forth with rests at both ends, through a coarse encoder.
        let smooth = |s: f64| s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
        let mut x = Vec::new();
        for _ in 0..3 {
            x.extend((0..200).map(|k| smooth(f64::from(k) / 200.0)));
            x.extend([1.0; 80]);
            x.extend((0..200).map(|k| 1.0 - smooth(f64::from(k) / 200.0)));
            x.extend([0.0; 80]);
        }
        let encoder: Vec<f64> = x.iter().map(|v| (v * 1e5).round() / 1e5).collect();
        assert_eq!(transient(&x), None);
        assert_eq!(transient(&encoder), None);
        let cut: Vec<f64> = encoder.iter().map(|v| v.min(0.7)).collect();
        assert_eq!(transient(&cut).unwrap().extreme, 0.7);
    }

    #[test]
    fn trapezoid_profiles_pass() {
        let profile = |k: usize| (k % 400) as f64;
        let x: Vec<f64> = (0..2000)
            .map(|k| (profile(k) / 50.0).min(1.0).min((400.0 - profile(k)) / 50.0))
            .collect();
        assert_eq!(transient(&x), None);
    }

    proptest! {
        #[test]
        fn wild_signals_never_panic(x in prop::collection::vec(any::<f64>(), 0..200)) {
            let _ = periodic(&x);
            let _ = transient(&x);
        }
    }
}
