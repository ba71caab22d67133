//! Fourier transforms of two real signals at once, in registers of eight numbers.
//!
//! Two real signals `a` and `b` are one complex signal `z = a + j b` of `N = 8 M` samples, whose transform tells both:
//! `A_k = (Z_k + conj Z_(N-k)) / 2`, `B_k = (Z_k - conj Z_(N-k)) / 2j`. Sample `8 m + l` is lane `l` of point `m`
//! (\[cooley1965\] with a first factor of 8, in the form of \[bailey1990\]):
//!
//! `Z_(k + M j) = sum_l W_8^(l j) W_N^(l k) A_l(k)`, `A_l(k) = sum_m W_M^(m k) z(8 m + l)`, `W_n = exp(-2 pi j / n)`.
//!
//! The sums over `m` are transforms of `M` points that never mix lanes, in place by factors of 8, one of them 4 or 16 ([`points`]), which leaves their
//! results in the order of reversed digits. The sum over the lanes, which mixes them, is left to where the spectra are taken up
//! ([`Blocks`]): 64 lines at a time together with those that mirror them, so that a spectrum is never written as a whole.
//!
//! What rounding leaves of one signal in the other is small beside it only if both are of one size. So each is multiplied by a
//! power of two first, which is undone when they are apart ([`crate::waiting`]).
//!
//! This needs the instructions of AVX-512 and a period of `2^10` or more samples, a power of two; [`Plan::new`] tells. Other
//! machines and periods take the library of [`crate::spectra`].

mod blocks;
mod points;
mod register;

pub(crate) use blocks::Blocks;
pub(crate) use points::Centred;
use pulp::{f64x8, x86::V4};
use std::f64::consts::PI;
use std::sync::Arc;

/// Lanes of a register.
const LANES: usize = 8;

/// Real and imaginary part, eight lanes of each.
type Point = [f64x8; 2];

/// `exp(-2 pi j k / n)` by `k`, below a quarter of a turn, `n` a multiple of 8.
fn quarter(n: usize) -> Vec<[f64; 2]> {
    let eighth = (0..=n / 8).map(|k| (2.0 * PI * k as f64 / n as f64).sin_cos());
    let mut all: Vec<[f64; 2]> = eighth.map(|(sin, cos)| [cos, -sin]).collect();
    // What is above mirrors what is below.
    for k in n / 8 + 1..n / 4 {
        let [cos, minus_sin] = all[n / 4 - k];
        all.push([-minus_sin, -cos]);
    }
    all
}

/// `exp(-2 pi j k / n)`, from those of the first quarter.
fn rotation(quarter: &[[f64; 2]], k: usize) -> [f64; 2] {
    let [re, im] = quarter[k % quarter.len()];
    match k / quarter.len() % 4 {
        0 => [re, im],
        1 => [im, -re],
        2 => [-re, -im],
        _ => [-im, re],
    }
}

/// A factor `r` of the points.
#[derive(Debug, Clone)]
struct Factor {
    /// 4, 8 or 16.
    count: usize,
    /// `W_B^(c i)`, `B` the points that it splits, `c` among its `B / r` butterflies, `i` from 1 to `r - 1`.
    rotations: Vec<[f64; 2]>,
}

/// Factors of so many points: 8, with a first one of 4 or, near the end, one of 16 where that saves a pass. Further up, 16 points
/// would be as far apart as puts all of them in the same place of a cache.
fn factors(points: usize) -> Vec<usize> {
    let twos = points.trailing_zeros() as usize;
    match twos % 3 {
        1 => [vec![8; twos / 3 - 2], vec![16, 8]].concat(),
        2 => [vec![4], vec![8; twos / 3]].concat(),
        _ => vec![8; twos / 3],
    }
}

/// What transforms of one length share.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    simd: V4,
    /// `M`, points of a transform.
    points: usize,
    /// All factors of the points but the last, which is 8.
    factors: Vec<Factor>,
    /// `W_N^(8 l g) / (2 N)` by `g` up to `M / 8`: lanes `l`, real and imaginary part.
    coarse: Vec<Point>,
    /// `W_N^(l i)` by `i`.
    fine: [Point; LANES],
    /// Where the transform over points leaves its value `8 g`.
    places: Vec<usize>,
    /// Where value `8 g + i` is, from there.
    offsets: [usize; LANES],
}

impl Plan {
    /// For signals of a length, if that and the machine are as needed.
    pub(crate) fn new(length: usize) -> Option<Arc<Self>> {
        let simd = V4::try_new()?;
        if length < 1 << 10 || !length.is_power_of_two() {
            return None;
        }
        let points = length / LANES;
        let factors = factors(points);
        let roots = quarter(length);
        let mut split = points;
        let mut of = |&count: &usize| {
            let step = length / split;
            split /= count;
            let turns = (0..split).flat_map(|c| (1..count).map(move |i| c * i * step));
            let rotations = turns.map(|k| rotation(&roots, k)).collect();
            Factor { count, rotations }
        };
        let all = factors[..factors.len() - 1].iter().map(&mut of).collect();
        let lanes = |k: usize, scale: f64| -> Point {
            let mut parts = [[0.0; LANES]; 2];
            for l in 0..LANES {
                let [re, im] = rotation(&roots, l * k);
                [parts[0][l], parts[1][l]] = [re * scale, im * scale];
            }
            [pulp::cast(parts[0]), pulp::cast(parts[1])]
        };
        let place = |mut k: usize| {
            let (mut place, mut split) = (0, points);
            for factor in &factors {
                split /= factor;
                place += (k % factor) * split;
                k /= factor;
            }
            place
        };
        let groups = points / 64;
        Some(Arc::new(Self {
            simd,
            points,
            factors: all,
            coarse: (0..=points / 8)
                .map(|g| lanes(8 * g, 0.5 / length as f64))
                .collect(),
            fine: std::array::from_fn(|i| lanes(i, 1.0)),
            places: (0..groups).map(|g| place(8 * g)).collect(),
            offsets: std::array::from_fn(place),
        }))
    }

    /// Numbers that the points of a pair take.
    pub(crate) fn size(&self) -> usize {
        2 * LANES * self.points
    }
}
