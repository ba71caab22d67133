//! Linear machines with known truth: springs and masses, sampled exactly, and their responses.
//!
//! Written for the bench alone: nothing here comes from the code that it judges.

use super::draw::Draw;
use lpv_core::nalgebra::{Complex, DMatrix, DVector};

pub(crate) type C64 = Complex<f64>;

/// `x' = A x + B u`, `y = C x + D u`; in seconds, or in steps once it is sampled.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
}

impl Linear {
    /// The system at the instants `k h`, its input held in between.
    pub(crate) fn sampled(&self, h: f64) -> Self {
        let (n, m) = (self.a.nrows(), self.b.ncols());
        let mut joint = DMatrix::zeros(n + m, n + m);
        joint.view_mut((0, 0), (n, n)).copy_from(&(&self.a * h));
        joint.view_mut((0, n), (n, m)).copy_from(&(&self.b * h));
        // A diagonal change of the states, so that stiff springs in small units do not drown the rest.
        let scale = balance(&joint);
        let balanced = DMatrix::from_fn(n + m, n + m, |i, j| joint[(i, j)] * scale[j] / scale[i]);
        let power = balanced.exp();
        let back = DMatrix::from_fn(n + m, n + m, |i, j| power[(i, j)] * scale[i] / scale[j]);
        Self {
            a: back.view((0, 0), (n, n)).into_owned(),
            b: back.view((0, n), (n, m)).into_owned(),
            c: self.c.clone(),
            d: self.d.clone(),
        }
    }

    /// `C (z I - A)^-1 B + D` of a sampled system at `f h` cycles a sample.
    pub(crate) fn response(&self, cycles: f64) -> Option<DMatrix<C64>> {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * cycles);
        let n = self.a.nrows();
        let complex = |m: &DMatrix<f64>| m.map(|v| C64::new(v, 0.0));
        let shifted = DMatrix::from_fn(n, n, |i, j| {
            C64::new(-self.a[(i, j)], 0.0) + if i == j { z } else { C64::new(0.0, 0.0) }
        });
        let solved = shifted.lu().solve(&complex(&self.b))?;
        Some(complex(&self.c) * solved + complex(&self.d))
    }

    /// The largest modulus of the eigenvalues of a sampled system.
    pub(crate) fn radius(&self) -> f64 {
        self.a
            .clone()
            .complex_eigenvalues()
            .iter()
            .fold(0.0, |r, v| r.max(v.norm()))
    }

    /// Output and next state.
    pub(crate) fn step(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        &self.a * x + &self.b * u
    }
}

/// Powers of two that bring rows and columns of a matrix to like sizes.
fn balance(m: &DMatrix<f64>) -> Vec<f64> {
    let n = m.nrows();
    let mut scale = vec![1.0_f64; n];
    for _ in 0..20 {
        for i in 0..n {
            let mut row = 0.0;
            let mut column = 0.0;
            for j in (0..n).filter(|j| *j != i) {
                row += (m[(i, j)] * scale[j] / scale[i]).abs();
                column += (m[(j, i)] * scale[i] / scale[j]).abs();
            }
            // An input has no row, a last output no column: what is left is brought to one.
            let factor = match (row > 0.0, column > 0.0) {
                (true, true) => (row / column).sqrt(),
                (true, false) => row,
                (false, true) => 1.0 / column,
                (false, false) => 1.0,
            };
            scale[i] *= 2.0_f64.powf(factor.log2().round());
        }
    }
    scale
}

/// `M q'' + D q' + K q = B u`, `y = C q` (or `C q'`).
#[derive(Debug, Clone)]
pub(crate) struct Mechanics {
    pub(crate) m: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
    pub(crate) k: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) measures_speed: bool,
}

impl Mechanics {
    /// The first-order form; none where a mass is zero.
    pub(crate) fn linear(&self) -> Option<Linear> {
        let n = self.m.nrows();
        let inverse = self.m.clone().try_inverse()?;
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        a.view_mut((0, n), (n, n)).fill_with_identity();
        a.view_mut((n, 0), (n, n)).copy_from(&(-(&inverse * &self.k)));
        a.view_mut((n, n), (n, n)).copy_from(&(-(&inverse * &self.d)));
        let mut b = DMatrix::zeros(2 * n, self.b.ncols());
        b.view_mut((n, 0), (n, self.b.ncols()))
            .copy_from(&(&inverse * &self.b));
        let mut c = DMatrix::zeros(self.c.nrows(), 2 * n);
        let at = if self.measures_speed { n } else { 0 };
        c.view_mut((0, at), (self.c.nrows(), n)).copy_from(&self.c);
        let d = DMatrix::zeros(self.c.nrows(), self.b.ncols());
        Some(Linear { a, b, c, d })
    }
}

/// One axis: a free mass (or one on a spring to ground) with flexible modes on it, each seen by the output with its own sign.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    /// Whole mass or inertia.
    pub(crate) mass: f64,
    /// Viscous friction to ground, force a speed.
    pub(crate) viscous: f64,
    /// Stiffness to ground, force a length.
    pub(crate) stiffness: f64,
    /// Frequency in Hz, damping ratio, share of the mode in the output (of 1 / mass).
    pub(crate) modes: Vec<[f64; 3]>,
    /// Whether the output is the speed.
    pub(crate) measures_speed: bool,
}

impl Axis {
    /// A free mass with one mode, in any units, sampled at `rate`.
    pub(crate) fn free(draw: &mut Draw, rate: f64) -> Self {
        let mass = draw.decades(1e-2, 1e2);
        let frequency = rate * draw.decades(0.03, 0.2);
        let damping = draw.decades(0.005, 0.05);
        Self {
            mass,
            viscous: 0.0,
            stiffness: 0.0,
            modes: vec![[frequency, damping, draw.sign() * draw.uniform(0.3, 1.0)]],
            measures_speed: false,
        }
    }
    /// Modes alone, no rigid body: `count` of them, apart from each other, within the band of `rate`.
    pub(crate) fn flexible(draw: &mut Draw, rate: f64, count: usize) -> Self {
        let (low, high) = (0.02_f64, 0.25_f64);
        let ratio = (high / low).powf(1.0 / count as f64);
        let modes = (0..count)
            .map(|k| {
                let cycles = low * ratio.powf(k as f64 + draw.uniform(0.25, 0.75));
                [rate * cycles, draw.decades(0.005, 0.05), draw.uniform(0.3, 1.0)]
            })
            .collect();
        Self {
            mass: draw.decades(1e-2, 1e2),
            viscous: 0.0,
            stiffness: f64::NAN,
            modes,
            measures_speed: false,
        }
    }
    /// In first-order form, each mode scaled to frequencies near one, so that no unit shows in the conditioning.
    pub(crate) fn linear(&self) -> Linear {
        let rigid = usize::from(!self.stiffness.is_nan());
        let n = self.modes.len() + rigid;
        let (mut a, mut b, mut c) = (
            DMatrix::zeros(2 * n, 2 * n),
            DMatrix::zeros(2 * n, 1),
            DMatrix::zeros(1, 2 * n),
        );
        let mut add = |i: usize, stiffness: f64, damping: f64, gain: f64| {
            let (q, v) = (2 * i, 2 * i + 1);
            a[(q, v)] = 1.0;
            a[(v, q)] = -stiffness;
            a[(v, v)] = -damping;
            b[(v, 0)] = gain / self.mass;
            c[(0, if self.measures_speed { v } else { q })] = 1.0;
        };
        if rigid == 1 {
            add(0, self.stiffness / self.mass, self.viscous / self.mass, 1.0);
        }
        for (i, [frequency, damping, gain]) in self.modes.iter().enumerate() {
            let w = std::f64::consts::TAU * frequency;
            add(i + rigid, w * w, 2.0 * damping * w, *gain);
        }
        Linear {
            a,
            b,
            c,
            d: DMatrix::zeros(1, 1),
        }
    }
}
