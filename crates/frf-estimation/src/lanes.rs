//! Numbers of several lines at a time, one a lane of a register; of one line with [`pulp::Scalar`].
//!
//! Whatever the register, each lane has the bits of scalar arithmetic: nothing is contracted.

use num_complex::Complex;
use pulp::{Scalar, Simd};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Most lanes that a register of doubles has.
pub(crate) const WIDEST: usize = 8;

/// Real numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lanes<S: Simd>(S, S::f64s);

/// Complex numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ComplexLanes<S: Simd> {
    pub(crate) re: Lanes<S>,
    pub(crate) im: Lanes<S>,
}

impl<S: Simd> Lanes<S> {
    /// As many of these as there are lanes.
    #[inline(always)]
    pub(crate) fn new(simd: S, values: [f64; WIDEST]) -> Self {
        const { assert!(S::F64_LANES <= WIDEST) };
        Self(simd, S::as_simd_f64s(&values).0[0])
    }

    /// One number in all lanes.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self(simd, simd.splat_f64s(value))
    }

    /// By lane; zero where there is none.
    #[inline(always)]
    pub(crate) fn values(self) -> [f64; WIDEST] {
        let mut values = [0.0; WIDEST];
        S::as_mut_simd_f64s(&mut values).0[0] = self.1;
        values
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_f64s(self.1))
    }

    #[inline(always)]
    fn exchange_where_larger(self, than: Self, one: &mut Self, other: &mut Self) {
        let simd = self.0;
        let is_larger = simd.greater_than_f64s(self.1, than.1);
        let (x, y) = (one.1, other.1);
        one.1 = simd.select_f64s(is_larger, y, x);
        other.1 = simd.select_f64s(is_larger, x, y);
    }

    /// Zero where it is not above zero.
    #[inline(always)]
    pub(crate) fn positive_part(self) -> Self {
        let Self(simd, lanes) = self;
        let zero = simd.splat_f64s(0.0);
        Self(
            simd,
            simd.select_f64s(simd.greater_than_f64s(lanes, zero), lanes, zero),
        )
    }
}

impl<S: Simd> ComplexLanes<S> {
    /// One number in all lanes.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: Complex<f64>) -> Self {
        Self {
            re: Lanes::splat(simd, value.re),
            im: Lanes::splat(simd, value.im),
        }
    }

    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        Self::splat(simd, Complex::new(0.0, 0.0))
    }

    #[inline(always)]
    pub(crate) fn conj(self) -> Self {
        Self {
            re: self.re,
            im: -self.im,
        }
    }

    #[inline(always)]
    pub(crate) fn norm_sqr(self) -> Lanes<S> {
        self.re * self.re + self.im * self.im
    }

    #[inline(always)]
    pub(crate) fn inv(self) -> Self {
        let square = self.norm_sqr();
        Self {
            re: self.re / square,
            im: -self.im / square,
        }
    }

    /// Exchanges the lanes in which `a` is larger than `b`.
    #[inline(always)]
    pub(crate) fn exchange_where(a: Lanes<S>, b: Lanes<S>, one: &mut Self, other: &mut Self) {
        a.exchange_where_larger(b, &mut one.re, &mut other.re);
        a.exchange_where_larger(b, &mut one.im, &mut other.im);
    }
}

impl ComplexLanes<Scalar> {
    /// Of one line.
    pub(crate) fn one(value: Complex<f64>) -> Self {
        Self::splat(Scalar::new(), value)
    }

    /// That of the line.
    pub(crate) fn value(self) -> Complex<f64> {
        Complex::new(self.re.1, self.im.1)
    }
}

/// Writes what lanes hold line by line: the numbers of the first line, then those of the next one, as many as there is room for.
#[inline(always)]
pub(crate) fn write_lines<S: Simd>(numbers: &[ComplexLanes<S>], out: &mut [Complex<f64>]) {
    let width = numbers.len();
    for (i, number) in numbers.iter().enumerate() {
        let (re, im) = (number.re.values(), number.im.values());
        for (l, line) in out.chunks_exact_mut(width).enumerate() {
            line[i] = Complex::new(re[l], im[l]);
        }
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0, self.0.add_f64s(self.1, other.1))
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0, self.0.sub_f64s(self.1, other.1))
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0, self.0.mul_f64s(self.1, other.1))
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0, self.0.div_f64s(self.1, other.1))
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0, self.0.neg_f64s(self.1))
    }
}

impl<S: Simd> Add for ComplexLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<S: Simd> Sub for ComplexLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            im: self.im - other.im,
        }
    }
}

impl<S: Simd> Mul for ComplexLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }
}

impl<S: Simd> Mul<Lanes<S>> for ComplexLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, scale: Lanes<S>) -> Self {
        Self {
            re: self.re * scale,
            im: self.im * scale,
        }
    }
}

impl<S: Simd> Neg for ComplexLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            im: -self.im,
        }
    }
}

impl<S: Simd> AddAssign for ComplexLanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> SubAssign for ComplexLanes<S> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
