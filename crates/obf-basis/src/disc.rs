//! Geometry of the unit disc: pseudo-hyperbolic distance, Moebius charts, discs.

use crate::PoleUnit;
use num_complex::Complex;

/// Pseudo-hyperbolic distance `kappa(z, l) = |z - l| / |1 - z conj(l)|`, between 0 and 1 inside the unit disc.
///
/// NaN where a part is NaN, or both points are the same point of the unit circle; above 1 if exactly one point lies
/// outside.
pub fn pseudo_hyperbolic_distance(z: Complex<f64>, l: Complex<f64>) -> f64 {
    if z.norm_sqr() < 1.0 && l.norm_sqr() < 1.0 {
        kappa_squared(z, l).sqrt()
    } else {
        (z - l).norm() / (1.0 - z * l.conj()).norm()
    }
}

/// `kappa^2` inside the unit disc, from `|1 - z conj(l)|^2 = |z - l|^2 + (1 - |z|^2)(1 - |l|^2)`: a sum of positive
/// terms cannot cancel, so the result stays in [0, 1] however close the points are to the circle.
pub(crate) fn kappa_squared(z: Complex<f64>, l: Complex<f64>) -> f64 {
    let gap = (z - l).norm_sqr();
    gap / (gap + (1.0 - z.norm_sqr()) * (1.0 - l.norm_sqr()))
}

/// Chart centred at `v`: `(z - v) / (1 - conj(v) z)` keeps kappa and sends `v` to 0.
pub(crate) fn to_chart(v: Complex<f64>, z: Complex<f64>) -> Complex<f64> {
    (z - v) / (1.0 - v.conj() * z)
}

/// Back from the chart centred at `v`: `(w + v) / (1 + conj(v) w)`.
pub(crate) fn from_chart(v: Complex<f64>, w: Complex<f64>) -> Complex<f64> {
    (w + v) / (1.0 + v.conj() * w)
}

/// A Euclidean disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disc {
    pub(crate) centre: Complex<f64>,
    pub(crate) radius: f64,
}

impl Disc {
    /// `{v : kappa(z, v) <= r}` for `0 <= r < 1`: centre `z (1 - r^2) / (1 - r^2 |z|^2)`, radius
    /// `r (1 - |z|^2) / (1 - r^2 |z|^2)`.
    pub(crate) fn hyperbolic(z: Complex<f64>, r: f64) -> Self {
        let z2 = z.norm_sqr();
        let scale = 1.0 / (1.0 - r * r * z2);
        Self {
            centre: z * ((1.0 - r * r) * scale),
            radius: r * (1.0 - z2) * scale,
        }
    }

    pub(crate) fn contains(&self, v: Complex<f64>) -> bool {
        (v - self.centre).norm_sqr() <= self.radius * self.radius
    }
}

/// Logarithm of the distance of `z` to a unit: `kappa(z, a)` for a real pole, the product
/// `kappa(z, v) kappa(z, conj v)` for a pair, so that the sum over units is the logarithm of the n-width product.
pub(crate) fn log_distance(z: Complex<f64>, unit: PoleUnit) -> f64 {
    match unit {
        PoleUnit::Real(a) => log_kappa(z, Complex::new(a, 0.0)),
        PoleUnit::Pair(v) => 0.5 * (kappa_squared(z, v) * kappa_squared(z, v.conj())).ln(),
    }
}

/// `ln kappa(z, l)`, minus infinity where the points are equal.
pub(crate) fn log_kappa(z: Complex<f64>, l: Complex<f64>) -> f64 {
    0.5 * kappa_squared(z, l).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::c64;
    use proptest::prelude::*;

    #[test]
    fn by_hand() {
        assert_eq!(pseudo_hyperbolic_distance(c64(0.5, 0.0), c64(0.0, 0.0)), 0.5);
        // (0.8 - 0.5) / (1 - 0.4) = 0.5
        assert!((pseudo_hyperbolic_distance(c64(0.8, 0.0), c64(0.5, 0.0)) - 0.5).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn the_disc_is_the_level_set(re in -0.7..0.7f64, im in -0.7..0.7f64, r in 0.01..0.99f64, angle in 0.0..6.3f64) {
            let z = c64(re, im);
            let disc = Disc::hyperbolic(z, r);
            let v = disc.centre + Complex::from_polar(disc.radius, angle);
            prop_assert!((pseudo_hyperbolic_distance(z, v) - r).abs() < 1e-10);
        }

        #[test]
        fn charts_are_isometries(a in -0.7..0.7f64, b in -0.7..0.7f64, c in -0.7..0.7f64, d in -0.7..0.7f64) {
            let (v, z, l) = (c64(a, b), c64(c, d), c64(b, c));
            let moved = pseudo_hyperbolic_distance(to_chart(v, z), to_chart(v, l));
            prop_assert!((moved - pseudo_hyperbolic_distance(z, l)).abs() < 1e-12);
            prop_assert!((from_chart(v, to_chart(v, z)) - z).norm() < 1e-12);
        }
    }
}
