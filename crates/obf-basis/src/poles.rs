//! Sets of stable poles, closed under conjugation.

use crate::BasisError;
use num_complex::Complex;

/// Largest number of poles in a set, and so of functions in a basis.
pub const MAX_FUNCTIONS: usize = 1024;

/// Largest distance between a pole and the conjugate of its partner, in units of the larger modulus.
const CONJUGATE_TOLERANCE: f64 = 1e-9;

/// The smallest real building block: a real pole, or a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoleUnit {
    /// One real pole.
    Real(f64),
    /// `z` and its conjugate, `Im z >= 0`; `Im z = 0` is a double real pole.
    Pair(Complex<f64>),
}

impl PoleUnit {
    /// Number of poles: 1 or 2.
    pub fn order(self) -> usize {
        match self {
            Self::Real(_) => 1,
            Self::Pair(_) => 2,
        }
    }

    /// The member in the closed upper half plane.
    pub fn upper(self) -> Complex<f64> {
        match self {
            Self::Real(a) => Complex::new(a, 0.0),
            Self::Pair(z) => z,
        }
    }
}

/// Poles strictly inside the unit circle, closed under conjugation, in a fixed order.
///
/// Repeated poles are allowed and count as often as they occur.
#[derive(Debug, Clone, PartialEq)]
pub struct PoleSet {
    units: Vec<PoleUnit>,
    poles: Vec<Complex<f64>>,
}

impl PoleSet {
    /// Poles given one by one, every complex one with its conjugate anywhere in the list. A pair takes the place of
    /// its first member and is symmetrised (partners may differ by rounding, up to 1e-9).
    ///
    /// # Errors
    /// [`BasisError::Empty`], [`BasisError::NotFinite`], [`BasisError::NotInside`], [`BasisError::NoConjugate`],
    /// [`BasisError::Functions`].
    pub fn new(poles: &[Complex<f64>]) -> Result<Self, BasisError> {
        check_inside("pole set", poles)?;
        let mut used = vec![false; poles.len()];
        let mut units = Vec::with_capacity(poles.len());
        for i in 0..poles.len() {
            if used[i] {
                continue;
            }
            used[i] = true;
            let z = poles[i];
            if z.im == 0.0 {
                units.push(PoleUnit::Real(z.re));
                continue;
            }
            let partner = (i + 1..poles.len())
                .filter(|&j| !used[j] && poles[j].im * z.im < 0.0)
                .min_by(|&a, &b| {
                    (poles[a].conj() - z)
                        .norm()
                        .total_cmp(&(poles[b].conj() - z).norm())
                })
                .filter(|&j| {
                    (poles[j].conj() - z).norm() <= CONJUGATE_TOLERANCE * z.norm().max(poles[j].norm())
                });
            let Some(j) = partner else {
                return Err(BasisError::NoConjugate {
                    index: i,
                    re: z.re,
                    im: z.im,
                });
            };
            used[j] = true;
            let mean = 0.5 * (z + poles[j].conj());
            units.push(PoleUnit::Pair(Complex::new(mean.re, mean.im.abs())));
        }
        Self::from_units(units)
    }

    /// One member of every pair; a pole with `Im z = 0` is a single real pole.
    ///
    /// # Errors
    /// As [`PoleSet::new`], and [`BasisError::LowerHalf`].
    pub fn from_upper_half(upper: &[Complex<f64>]) -> Result<Self, BasisError> {
        check_inside("pole set", upper)?;
        if let Some(index) = upper.iter().position(|z| z.im < 0.0) {
            return Err(BasisError::LowerHalf {
                index,
                im: upper[index].im,
            });
        }
        Self::from_units(
            upper
                .iter()
                .map(|&z| {
                    if z.im == 0.0 {
                        PoleUnit::Real(z.re)
                    } else {
                        PoleUnit::Pair(z)
                    }
                })
                .collect(),
        )
    }

    /// Real poles and pairs in the given order.
    ///
    /// # Errors
    /// As [`PoleSet::from_upper_half`].
    pub fn from_units(units: Vec<PoleUnit>) -> Result<Self, BasisError> {
        let upper: Vec<_> = units.iter().map(|u| u.upper()).collect();
        check_inside("pole set", &upper)?;
        if let Some(index) = upper.iter().position(|z| z.im < 0.0) {
            return Err(BasisError::LowerHalf {
                index,
                im: upper[index].im,
            });
        }
        let functions = units.iter().map(|u| u.order()).sum();
        if functions > MAX_FUNCTIONS {
            return Err(BasisError::Functions {
                functions,
                limit: MAX_FUNCTIONS,
            });
        }
        let mut poles = Vec::with_capacity(functions);
        for unit in &units {
            poles.push(unit.upper());
            if let PoleUnit::Pair(z) = unit {
                poles.push(z.conj());
            }
        }
        Ok(Self { units, poles })
    }

    /// The set repeated, as a Hambo basis needs it.
    ///
    /// # Errors
    /// [`BasisError::Functions`] unless the result has between 1 and [`MAX_FUNCTIONS`] poles.
    pub fn repeated(&self, repetitions: usize) -> Result<Self, BasisError> {
        let functions = self.len().saturating_mul(repetitions);
        if functions == 0 || functions > MAX_FUNCTIONS {
            return Err(BasisError::Functions {
                functions,
                limit: MAX_FUNCTIONS,
            });
        }
        Self::from_units(self.units.repeat(repetitions))
    }

    /// Number of poles, conjugates counted.
    #[allow(clippy::len_without_is_empty, reason = "a pole set is never empty")]
    pub fn len(&self) -> usize {
        self.poles.len()
    }

    /// Real poles and pairs, in order.
    pub fn units(&self) -> &[PoleUnit] {
        &self.units
    }

    /// Every pole; the members of a pair are neighbours, the upper one first.
    pub fn as_slice(&self) -> &[Complex<f64>] {
        &self.poles
    }

    /// The poles in the closed upper half plane, one a unit.
    pub fn upper_half(&self) -> Vec<Complex<f64>> {
        self.units.iter().map(|u| u.upper()).collect()
    }
}

/// Refuses an empty list and every entry that is not finite or not strictly inside the unit circle.
pub(crate) fn check_inside(what: &'static str, poles: &[Complex<f64>]) -> Result<(), BasisError> {
    if poles.is_empty() {
        return Err(BasisError::Empty { what });
    }
    for (index, z) in poles.iter().enumerate() {
        if !(z.re.is_finite() && z.im.is_finite()) {
            return Err(BasisError::NotFinite {
                what,
                index,
                re: z.re,
                im: z.im,
            });
        }
        // 1 - |z|^2 is what every formula divides by, so it is what must be positive after rounding.
        if z.norm_sqr() >= 1.0 || z.norm() >= 1.0 {
            return Err(BasisError::NotInside {
                what,
                index,
                radius: z.norm(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::c64;

    #[test]
    fn pairs_are_found_and_keep_their_place() {
        let set = PoleSet::new(&[c64(0.1, -0.2), c64(0.5, 0.0), c64(0.1, 0.2)]).unwrap();
        assert_eq!(set.units(), &[PoleUnit::Pair(c64(0.1, 0.2)), PoleUnit::Real(0.5)]);
        assert_eq!(set.len(), 3);
        assert_eq!(set.as_slice()[1], c64(0.1, -0.2));
    }

    #[test]
    fn refusals_name_the_pole() {
        let outside = PoleSet::new(&[c64(0.5, 0.0), c64(1.0, 0.0)]).unwrap_err();
        assert_eq!(
            outside,
            BasisError::NotInside {
                what: "pole set",
                index: 1,
                radius: 1.0
            }
        );
        assert!(outside.to_string().contains("pole 1: |z| = 1.000000"));
        assert!(matches!(PoleSet::new(&[]), Err(BasisError::Empty { .. })));
        assert!(matches!(
            PoleSet::new(&[c64(0.5, 0.1), c64(0.5, -0.2)]),
            Err(BasisError::NoConjugate { index: 0, .. })
        ));
        assert!(matches!(
            PoleSet::from_upper_half(&[c64(0.5, 0.1), c64(0.5, -0.2)]),
            Err(BasisError::LowerHalf { index: 1, .. })
        ));
        assert!(matches!(
            PoleSet::new(&[c64(f64::NAN, 0.0)]),
            Err(BasisError::NotFinite { index: 0, .. })
        ));
    }

    #[test]
    fn repetition_is_limited() {
        let set = PoleSet::new(&[c64(0.5, 0.0)]).unwrap();
        assert_eq!(set.repeated(3).unwrap().len(), 3);
        assert!(set.repeated(0).is_err());
        assert!(set.repeated(usize::MAX).is_err());
    }
}
