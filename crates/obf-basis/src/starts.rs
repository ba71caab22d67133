//! Where the searches begin: Leja sequences on the observed poles.

use crate::PoleUnit;
use crate::disc::{log_distance, pseudo_hyperbolic_distance};
use crate::minimax::newton::moved_unit;
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Sorted distinct members of the closed upper half plane: the cost of a real basis is the same at conjugates.
pub(crate) fn distinct_upper(observed: &[Complex<f64>]) -> Vec<Complex<f64>> {
    // Adding zero turns -0 into +0, so that equal poles compare equal.
    let mut upper: Vec<_> = observed
        .iter()
        .map(|z| Complex::new(z.re + 0.0, z.im.abs()))
        .collect();
    upper.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    upper.dedup();
    upper
}

/// How many centres of which kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) pairs: usize,
    pub(crate) reals: usize,
}

impl Shape {
    pub(crate) fn of(units: &[PoleUnit]) -> Self {
        let reals = units.iter().filter(|u| matches!(u, PoleUnit::Real(_))).count();
        Self {
            pairs: units.len() - reals,
            reals,
        }
    }
}

/// Every point a centre, if there are centres enough; spare ones repeat the first point.
pub(crate) fn covering(points: &[Complex<f64>], shape: Shape) -> Option<Vec<PoleUnit>> {
    let (mut pairs, mut reals) = (shape.pairs, shape.reals);
    let mut units = Vec::with_capacity(pairs + reals);
    for &z in points {
        if z.im == 0.0 && reals > 0 {
            reals -= 1;
            units.push(PoleUnit::Real(z.re));
        } else {
            pairs = pairs.checked_sub(1)?;
            units.push(PoleUnit::Pair(z));
        }
    }
    let first = *points.first()?;
    units.extend(std::iter::repeat_n(PoleUnit::Pair(first), pairs));
    units.extend(std::iter::repeat_n(PoleUnit::Real(real_foot(first)), reals));
    Some(units)
}

/// A random generator for start `index`: the seed names the run, the stream the start.
pub(crate) fn generator(seed: u64, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index as u64);
    rng
}

/// A Leja sequence: the first centre is a random observed pole, each next one the observed pole whose product of
/// distances to the centres so far is largest, so the centres spread as the capacity of the set asks. Every centre is
/// moved off its pole by a random kappa up to `jitter`: a centre on a pole would own it for ever.
pub(crate) fn leja(
    points: &[Complex<f64>],
    shape: Shape,
    jitter: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<PoleUnit> {
    let mut units = Vec::with_capacity(shape.pairs + shape.reals);
    let mut sums = vec![0.0; points.len()];
    let (mut pairs, mut reals) = (shape.pairs, shape.reals);
    if points.is_empty() {
        return units;
    }
    let mut next = rng.random_range(0..points.len());
    while pairs + reals > 0 {
        let z = points[next];
        let foot = real_foot(z);
        let near_axis = pseudo_hyperbolic_distance(z, Complex::new(foot, 0.0)) < 0.3;
        let unit = if reals > 0 && (near_axis || pairs == 0) {
            reals -= 1;
            PoleUnit::Real(foot)
        } else if pairs > 0 {
            pairs -= 1;
            PoleUnit::Pair(z)
        } else {
            break;
        };
        let w = Complex::from_polar(
            jitter * rng.random_range(0.05..1.0),
            std::f64::consts::TAU * rng.random_range(0.0..1.0),
        );
        let w = if matches!(unit, PoleUnit::Real(_)) {
            Complex::new(w.re, 0.0)
        } else {
            w
        };
        let unit = moved_unit(unit, w).unwrap_or(unit);
        units.push(unit);
        for (sum, &z) in sums.iter_mut().zip(points) {
            *sum += log_distance(z, unit);
        }
        next = sums
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map_or(0, |(i, _)| i);
    }
    units
}

/// The real number nearest to z in kappa: `2 Re z / (1 + |z|^2 + |1 - z^2|)`.
fn real_foot(z: Complex<f64>) -> f64 {
    2.0 * z.re / (1.0 + z.norm_sqr() + (1.0 - z * z).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::c64;
    use proptest::prelude::*;

    #[test]
    fn conjugates_and_repeats_collapse() {
        let upper = distinct_upper(&[c64(0.5, -0.1), c64(0.2, 0.0), c64(0.5, 0.1), c64(0.2, -0.0)]);
        assert_eq!(upper, [c64(0.2, 0.0), c64(0.5, 0.1)]);
    }

    #[test]
    fn shape_is_kept_and_seed_decides() {
        let points = [c64(0.5, 0.3), c64(0.6, 0.2), c64(-0.4, 0.1)];
        let shape = Shape { pairs: 4, reals: 2 };
        let run = |index| leja(&points, shape, 0.1, &mut generator(7, index));
        assert_eq!(Shape::of(&run(0)), shape);
        assert_eq!(run(1), run(1));
        assert_ne!(run(0), run(1));
    }

    #[test]
    fn enough_centres_cover_every_point() {
        let points = [c64(0.2, 0.0), c64(0.5, 0.1)];
        assert_eq!(covering(&points, Shape { pairs: 0, reals: 2 }), None);
        let units = covering(&points, Shape { pairs: 2, reals: 1 }).unwrap();
        assert_eq!(
            units,
            [
                PoleUnit::Real(0.2),
                PoleUnit::Pair(points[1]),
                PoleUnit::Pair(points[0])
            ]
        );
    }

    proptest! {
        #[test]
        fn the_foot_is_nearest(re in -0.7..0.7f64, im in -0.7..0.7f64, other in -0.99..0.99f64) {
            let z = c64(re, im);
            let d = |a: f64| pseudo_hyperbolic_distance(z, c64(a, 0.0));
            prop_assert!(d(real_foot(z)) <= d(other) + 1e-12);
        }
    }
}
