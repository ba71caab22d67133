//! Orthonormal basis functions from poles, as a state space whose state is the vector of functions.

use crate::{BasisError, PoleSet, PoleUnit};
use lpv_core::{Discrete, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;

/// Real orthonormal functions `phi_1 .. phi_n` of `H_2`, strictly proper.
#[derive(Debug, Clone, PartialEq)]
pub struct OrthonormalBasis {
    poles: PoleSet,
    state_space: StateSpace<Discrete>,
    inner: StateSpace<Discrete>,
}

impl OrthonormalBasis {
    /// Takenaka-Malmquist functions: the poles in the given order, a real pole one function, a pair two functions of
    /// Kautz type. Between them runs the product of the inner functions of the poles before:
    /// `phi_i = sqrt(1 - a_i^2) / (z - a_i) prod_{j<i} (1 - a_j z) / (z - a_j)` for real poles.
    ///
    /// # Errors
    /// [`BasisError::Core`] if the matrices cannot be represented.
    pub fn takenaka_malmquist(poles: &PoleSet, clock: Discrete) -> Result<Self, BasisError> {
        let n = poles.len();
        let mut a = DMatrix::zeros(n, n);
        let mut b = DMatrix::zeros(n, 1);
        // What the product of the sections so far makes of the input: `c x + d u`.
        let mut c = DMatrix::zeros(1, n);
        let mut d = 1.0;
        let mut at = 0;
        for &unit in poles.units() {
            let section = Section::new(unit);
            let order = unit.order();
            for i in 0..order {
                for j in 0..at {
                    a[(at + i, j)] = section.b[i] * c[(0, j)];
                }
                for j in 0..order {
                    a[(at + i, at + j)] = section.a[i][j];
                }
                b[(at + i, 0)] = section.b[i] * d;
            }
            for j in 0..at {
                c[(0, j)] *= section.d;
            }
            for j in 0..order {
                c[(0, at + j)] = section.c[j];
            }
            d *= section.d;
            at += order;
        }
        let inner = StateSpace::new(a.clone(), b.clone(), c, DMatrix::from_element(1, 1, d), clock)?;
        let state_space = StateSpace::new(a, b, DMatrix::identity(n, n), DMatrix::zeros(n, 1), clock)?;
        Ok(Self {
            poles: poles.clone(),
            state_space,
            inner,
        })
    }

    /// `n` Laguerre functions of a real pole; pole 0 gives the pulses `z^-1 .. z^-n`.
    ///
    /// # Errors
    /// As [`PoleSet::new`] and [`PoleSet::repeated`].
    pub fn laguerre(pole: f64, n: usize, clock: Discrete) -> Result<Self, BasisError> {
        Self::hambo(&PoleSet::from_units(vec![PoleUnit::Real(pole)])?, n, clock)
    }

    /// `2 pairs` Kautz functions of one complex pole (either member of the pair).
    ///
    /// # Errors
    /// As [`PoleSet::new`] and [`PoleSet::repeated`].
    pub fn kautz(pole: Complex<f64>, pairs: usize, clock: Discrete) -> Result<Self, BasisError> {
        let upper = Complex::new(pole.re, pole.im.abs());
        Self::hambo(&PoleSet::from_units(vec![PoleUnit::Pair(upper)])?, pairs, clock)
    }

    /// Generalised orthonormal (Hambo) functions: the inner function of the pole set, repeated (Heuberger, Van den
    /// Hof, Bosgra, IEEE TAC 40(3), 1995).
    ///
    /// # Errors
    /// As [`PoleSet::repeated`].
    pub fn hambo(poles: &PoleSet, repetitions: usize, clock: Discrete) -> Result<Self, BasisError> {
        Self::takenaka_malmquist(&poles.repeated(repetitions)?, clock)
    }

    /// One input, `n_g` states, `C = I`, `D = 0`, `A A^T + B B^T = I`: the state is the vector of basis functions.
    pub fn state_space(&self) -> &StateSpace<Discrete> {
        &self.state_space
    }

    /// The inner function `G_b = prod_j (1 - conj(l_j) z) / (z - l_j)` on the same state; all-pass, so that
    /// `[A B; C D]` is orthogonal.
    pub fn inner_function(&self) -> &StateSpace<Discrete> {
        &self.inner
    }

    /// Number of functions `n_g`.
    pub fn functions(&self) -> usize {
        self.poles.len()
    }

    /// The poles, in the order of the functions.
    pub fn poles(&self) -> &PoleSet {
        &self.poles
    }
}

/// An all-pass section of order 1 or 2 with `[A B; C D]` orthogonal.
struct Section {
    a: [[f64; 2]; 2],
    b: [f64; 2],
    c: [f64; 2],
    d: f64,
}

impl Section {
    fn new(unit: PoleUnit) -> Self {
        match unit {
            PoleUnit::Real(a) => {
                let q = ((1.0 - a) * (1.0 + a)).sqrt();
                Self {
                    a: [[a, 0.0], [0.0, 0.0]],
                    b: [q, 0.0],
                    c: [q, 0.0],
                    d: -a,
                }
            }
            PoleUnit::Pair(z) => {
                // Two-parameter Kautz section: denominator z^2 + b (c - 1) z - c. The square roots of 1 - b^2 and
                // 1 - c^2 come from factors, because b and c are close to one for lightly damped poles.
                let z2 = z.norm_sqr();
                let (b, c) = (2.0 * z.re / (1.0 + z2), -z2);
                let s = (1.0 - z * z).norm() / (1.0 + z2);
                let r = z.norm();
                let q = ((1.0 - r) * (1.0 + r) * (1.0 + z2)).sqrt();
                Self {
                    a: [[-b * c, c * s], [s, b]],
                    b: [q, 0.0],
                    c: [-b * q, s * q],
                    d: -c,
                }
            }
        }
    }
}
