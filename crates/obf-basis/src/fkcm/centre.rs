//! The centre step: the weighted smallest enclosing disc of pseudo-hyperbolic geometry.
//!
//! `min_w max_k ln w_k + ln kappa(zeta_k, w)` is quasi-convex: its sublevel sets are intersections of Euclidean
//! discs. In the plane at most three discs decide (an LP-type problem), so a small working set is solved by bisection
//! with an exact intersection test, and grows by the most violated disc until none is violated.

use crate::disc::{Disc, kappa_squared, log_kappa};
use num_complex::Complex;

/// Width at which the bisection on the logarithmic level stops.
const LEVEL_TOLERANCE: f64 = 1e-10;
/// Levels below this count as zero distance.
const LOWEST_LEVEL: f64 = -600.0;
/// Exchanges before the best centre so far is accepted.
const MAX_EXCHANGES: usize = 48;

/// One weighted point in the chart of the present centre.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighted {
    /// Inside the unit disc.
    point: Complex<f64>,
    log_weight: f64,
    /// `w^2`.
    square: f64,
}

impl Weighted {
    /// Only differences of the logarithms matter; callers make the largest one zero.
    pub(crate) fn new(point: Complex<f64>, log_weight: f64) -> Self {
        Self {
            point,
            log_weight,
            square: (2.0 * log_weight).exp(),
        }
    }
}

/// Minimiser over the unit disc and its level `max_k ln w_k + ln kappa`, never above the level of the origin.
pub(crate) fn centre(points: &[Weighted]) -> (Complex<f64>, f64) {
    let mut at = Complex::new(0.0, 0.0);
    let mut best = (at, f64::INFINITY);
    let mut working: Vec<Weighted> = Vec::with_capacity(8);
    let mut bound = LOWEST_LEVEL;
    for _ in 0..MAX_EXCHANGES {
        let Some((most, level)) = most_violated(points, at) else {
            break;
        };
        if level < best.1 {
            best = (at, level);
        }
        if level <= bound + 2.0 * LEVEL_TOLERANCE {
            break;
        }
        working.push(*most);
        (at, bound) = bisect(&working, bound, best);
        // A disc that the new optimum leaves slack takes no part in the decision. A single one decides by itself.
        if working.len() > 1 {
            working.retain(|k| value(k, at) > bound - 1e-6);
        }
    }
    best
}

/// The same on the real axis, where discs become intervals; for points in a chart with a real centre.
pub(crate) fn real_centre(points: &[Weighted]) -> (f64, f64) {
    let (mut low, mut at) = (LOWEST_LEVEL, 0.0);
    let Some((_, mut high)) = most_violated(points, Complex::new(at, 0.0)) else {
        return (at, f64::NEG_INFINITY);
    };
    while high - low > LEVEL_TOLERANCE {
        let level = next_level(low, high);
        match common_interval(points, level) {
            Some(a) => (high, at) = (level, a),
            None => low = level,
        }
    }
    (at, high)
}

fn common_interval(points: &[Weighted], level: f64) -> Option<f64> {
    let (mut left, mut right) = (-1.0f64, 1.0f64);
    for k in points {
        if let Some(disc) = disc(k, level) {
            let half = disc.radius * disc.radius - disc.centre.im * disc.centre.im;
            if half < 0.0 {
                return None;
            }
            left = left.max(disc.centre.re - half.sqrt());
            right = right.min(disc.centre.re + half.sqrt());
        }
    }
    (left <= right).then_some(0.5 * (left + right))
}

fn value(k: &Weighted, at: Complex<f64>) -> f64 {
    k.log_weight + log_kappa(k.point, at)
}

/// The point whose value is the largest, and that value.
fn most_violated(points: &[Weighted], at: Complex<f64>) -> Option<(&Weighted, f64)> {
    // Squares of the weighted distances are in the order of their logarithms; what is no number is left out.
    let (mut most, mut largest) = (None, f64::NEG_INFINITY);
    for k in points {
        let square = k.square * kappa_squared(k.point, at);
        if square > largest {
            (most, largest) = (Some(k), square);
        }
    }
    most.map(|k| (k, value(k, at)))
}

/// The middle, but a short way down at first: a level far below the optimum tells nothing.
fn next_level(low: f64, high: f64) -> f64 {
    if high - low > 2.0 {
        high - 1.0
    } else {
        0.5 * (low + high)
    }
}

/// A point that the discs of `working` have in common at the smallest level above `low` at which they meet, and that level, by no
/// more than the tolerance too low. `best` is a point and its level, from where on the search goes down.
fn bisect(working: &[Weighted], low: f64, best: (Complex<f64>, f64)) -> (Complex<f64>, f64) {
    if let [only] = working {
        return (only.point, low);
    }
    let (mut low, (mut at, mut high)) = (low, best);
    let mut discs = Vec::with_capacity(working.len());
    while high - low > LEVEL_TOLERANCE {
        let level = next_level(low, high);
        discs.clear();
        discs.extend(working.iter().filter_map(|k| disc(k, level)));
        match common_point(&discs) {
            Some(v) => (high, at) = (level, v),
            None => low = level,
        }
    }
    (at, low)
}

/// `{w : ln w_k + ln kappa(zeta_k, w) <= level}`; none if that is the whole unit disc.
fn disc(k: &Weighted, level: f64) -> Option<Disc> {
    let log_radius = level - k.log_weight;
    (log_radius < 0.0).then(|| Disc::hyperbolic(k.point, log_radius.exp()))
}

/// A point of all discs. Their intersection, if any, has a corner where two circles cross, or is a whole disc.
fn common_point(discs: &[Disc]) -> Option<Complex<f64>> {
    let mut sum = Complex::new(0.0, 0.0);
    let mut found = 0.0;
    let mut try_point = |v: Complex<f64>, skip: (usize, usize)| {
        let inside = discs
            .iter()
            .enumerate()
            .all(|(i, d)| i == skip.0 || i == skip.1 || d.contains(v));
        if inside {
            sum += v;
            found += 1.0;
        }
    };
    for (i, a) in discs.iter().enumerate() {
        try_point(a.centre, (i, i));
        for (j, b) in discs.iter().enumerate().skip(i + 1) {
            let gap = b.centre - a.centre;
            let d2 = gap.norm_sqr();
            let d = d2.sqrt();
            if d > a.radius + b.radius {
                return None;
            }
            if d <= (a.radius - b.radius).abs() || d == 0.0 {
                continue;
            }
            let along = 0.5 * (d2 + (a.radius - b.radius) * (a.radius + b.radius)) / d;
            let across = (a.radius * a.radius - along * along).max(0.0).sqrt();
            let unit = gap / d;
            try_point(a.centre + unit * Complex::new(along, across), (i, j));
            try_point(a.centre + unit * Complex::new(along, -across), (i, j));
        }
    }
    // The intersection is convex: the mean of its points is in it, and nearer to the optimum than a corner.
    if discs.is_empty() {
        return Some(Complex::new(0.0, 0.0));
    }
    (found > 0.0).then(|| sum / found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::c64;
    use proptest::prelude::*;

    fn level_at(points: &[Weighted], at: Complex<f64>) -> f64 {
        points
            .iter()
            .map(|k| value(k, at))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn two_equal_weights_meet_in_the_middle() {
        // kappa(0.6, 0) = kappa(-0.6, 0) = 0.6, and no other point is nearer to both.
        let at = |x| Weighted::new(c64(x, 0.0), 0.0);
        let (v, level) = centre(&[at(0.6), at(-0.6)]);
        assert!(
            v.norm() < 1e-6 && (level - 0.6f64.ln()).abs() < 1e-8,
            "{v} {level}"
        );
        let (v, level) = centre(&[at(0.8), at(0.0)]);
        assert!(
            (v - 0.5).norm() < 1e-5 && (level - 0.5f64.ln()).abs() < 1e-8,
            "{v} {level}"
        );
        let (a, level) = real_centre(&[at(0.8), at(0.0)]);
        assert!((a - 0.5).abs() < 1e-6 && (level - 0.5f64.ln()).abs() < 1e-8);
    }

    proptest! {
        #[test]
        fn no_point_of_a_grid_is_better(
            raw in prop::collection::vec((-0.69..0.69f64, -0.69..0.69f64, -3.0..0.0f64), 1..12),
        ) {
            let points: Vec<_> = raw
                .iter()
                .map(|&(re, im, log_weight)| Weighted::new(c64(re, im), log_weight))
                .collect();
            let (v, level) = centre(&points);
            prop_assert!(v.norm() < 1.0);
            prop_assert!(level_at(&points, v) == level || (level_at(&points, v) - level).abs() < 1e-12);
            let (a, real_level) = real_centre(&points);
            prop_assert!((level_at(&points, c64(a, 0.0)) - real_level).abs() < 1e-6);
            for i in -20..=20 {
                let x = 0.049 * f64::from(i);
                prop_assert!(level_at(&points, c64(x, 0.0)) >= real_level - 1e-7);
                for j in -20..=20 {
                    let other = c64(x, 0.049 * f64::from(j));
                    if other.norm() < 0.99 {
                        prop_assert!(level_at(&points, other) >= level - 1e-7);
                    }
                }
            }
        }
    }
}
