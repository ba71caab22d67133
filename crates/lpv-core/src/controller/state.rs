//! A controller while it runs.

use crate::linalg::least_squares;
use crate::{Record, Signals};
use nalgebra::{DMatrix, DVector};

/// Samples by which a state at the start is told: so many a delay, and so many more.
const SAMPLES: usize = 4;
const LEAST: usize = 8;
/// Part of the inputs that counts as nothing.
const NOTHING: f64 = 1e-3;
/// Factor by which a state must lower the squares that rest leaves.
const EXPLAINED: f64 = 10.0;

/// The controller while it runs: direct form II transposed, one state a delay, shared by both numerators.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerState {
    pub(super) loops: Vec<Loop>,
    pub(super) limit: f64,
}

impl ControllerState {
    /// One sample: reads r(k), y(k), writes u(k) behind the saturation, without injection.
    ///
    /// The slices hold one number a loop. Missing entries of `r` and `y` count as zero, further ones are not used;
    /// entries of `u` beyond the loops stay as they are. The state is that of the linear controller: the saturation
    /// is not fed back (no anti-windup), as the formula of the format says.
    pub fn step(&mut self, r: &[f64], y: &[f64], u: &mut [f64]) {
        for (i, lp) in self.loops.iter_mut().enumerate() {
            let v = lp.step(r.get(i).copied().unwrap_or(0.0), y.get(i).copied().unwrap_or(0.0));
            if let Some(u) = u.get_mut(i) {
                *u = v.clamp(-self.limit, self.limit);
            }
        }
    }

    /// The controller as a record finds it, if that is not at rest: the state from which it gives the logged inputs of the first
    /// samples, by least squares; saturated samples do not count. None where rest explains them as well, within a thousandth
    /// of the inputs, or no state does.
    pub fn begun(&self, record: &Record) -> Option<Self> {
        let mut begun = self.clone();
        begun.reset();
        let mut moves = false;
        for i in 0..begun.loops.len() {
            let n = begun.loops[i].s.len() - 1;
            let Some(inputs) = record.inputs.columns.get(i).filter(|_| n > 0) else {
                continue;
            };
            let samples = inputs.len().min(SAMPLES * n + LEAST);
            let at = |signals: &Signals, k: usize| signals.columns.get(i).map_or(0.0, |c| c[k]);
            let mut forced = begun.loops[i].clone();
            let mut free: Vec<Loop> = (0..n)
                .map(|j| {
                    let mut free = begun.loops[i].clone();
                    free.s[j] = 1.0;
                    free
                })
                .collect();
            let (mut rows, mut right) = (Vec::new(), Vec::new());
            for (k, input) in inputs.iter().enumerate().take(samples) {
                let told = input - at(&record.injection, k);
                let gap = told - forced.step(at(&record.references, k), at(&record.outputs, k));
                let row: Vec<f64> = free.iter_mut().map(|f| f.step(0.0, 0.0)).collect();
                if told.abs() < self.limit {
                    rows.extend(row);
                    right.push(gap);
                }
            }
            let rows = DMatrix::from_row_slice(right.len(), n, &rows);
            let right = DVector::from_vec(right);
            let size = inputs.iter().map(|u| u * u).sum::<f64>() / inputs.len() as f64;
            let count = right.len() as f64;
            let Ok(state) = least_squares(rows.clone(), &right, 1e-12) else {
                continue;
            };
            let left = (&right - rows * &state).norm_squared();
            let seen = right.norm_squared() > NOTHING * NOTHING * count * size;
            if seen && EXPLAINED * left < right.norm_squared() && state.iter().all(|s| s.is_finite()) {
                begun.loops[i].s[..n].copy_from_slice(state.as_slice());
                moves = true;
            }
        }
        moves.then_some(begun)
    }

    /// The same at rest, without its saturation.
    #[must_use]
    pub fn unsaturated(&self) -> Self {
        let mut other = Self {
            limit: f64::INFINITY,
            ..self.clone()
        };
        other.reset();
        other
    }

    /// Back to rest.
    pub fn reset(&mut self) {
        for lp in &mut self.loops {
            lp.s.fill(0.0);
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Loop {
    b_r: Vec<f64>,
    b_y: Vec<f64>,
    a: Vec<f64>,
    /// Delays, with a zero behind the last that the recursion reads.
    pub(super) s: Vec<f64>,
}

impl Loop {
    /// Pads all polynomials to one length and divides by the first coefficient of A.
    pub(super) fn new(b_r: &[f64], b_y: &[f64], a: &[f64]) -> Self {
        let n = b_r.len().max(b_y.len()).max(a.len());
        let scaled = |p: &[f64]| {
            let mut p: Vec<f64> = p.iter().map(|c| c / a[0]).collect();
            p.resize(n, 0.0);
            p
        };
        Self {
            b_r: scaled(b_r),
            b_y: scaled(b_y),
            a: scaled(a),
            s: vec![0.0; n],
        }
    }

    fn step(&mut self, r: f64, y: f64) -> f64 {
        let v = self.b_r[0] * r - self.b_y[0] * y + self.s[0];
        for k in 1..self.a.len() {
            self.s[k - 1] = self.b_r[k] * r - self.b_y[k] * y - self.a[k] * v + self.s[k];
        }
        v
    }
}
