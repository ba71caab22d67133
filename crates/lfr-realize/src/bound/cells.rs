//! The response of an LFR on one line as a function of delta, with a bound on every cell.

use lpv_core::{Clock, Lfr};
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// `F = n22 + n21 Delta (I - n11 Delta)^-1 n12` on one line: the states are closed.
pub(super) struct Line {
    n11: DMatrix<C64>,
    n12: DMatrix<C64>,
    n21: DMatrix<C64>,
    n22: DMatrix<C64>,
    /// Parameter of each delta.
    parameter: Vec<usize>,
}

/// A box of deltas, one number a parameter: `centre + sum tau_j direction_j`, `|tau_j| <= 1`.
#[derive(Clone)]
pub(super) struct Cell {
    pub(super) centre: Vec<f64>,
    pub(super) directions: Vec<Vec<f64>>,
}

/// The response at the centre of a cell, the terms of its power series, and a bound on what both leave out.
pub(super) struct Local {
    pub(super) value: DMatrix<C64>,
    /// One matrix a product of `tau_j`, in the same order for every model.
    pub(super) terms: Vec<DMatrix<C64>>,
    pub(super) rest: f64,
}

/// Order up to which terms are known, by the number of directions: few dozens of terms.
fn order(directions: usize) -> i32 {
    match directions {
        0 | 1 => 8,
        2 => 4,
        3 => 3,
        4..=6 => 2,
        _ => 1,
    }
}

impl Line {
    /// None where the line is a pole at delta zero.
    pub(super) fn new<K: Clock>(lfr: &Lfr<K>, frequency_hz: f64) -> Option<Self> {
        let m = lfr.blocks();
        let complex = |m: &DMatrix<f64>| m.map(|v| C64::new(v, 0.0));
        let mut resolvent = -complex(&m.a);
        for i in 0..lfr.states() {
            resolvent[(i, i)] += lfr.clock().point(frequency_hz);
        }
        let (x1, x2) = if lfr.states() == 0 {
            (complex(&m.b1), complex(&m.b2))
        } else {
            let lu = resolvent.lu();
            (lu.solve(&complex(&m.b1))?, lu.solve(&complex(&m.b2))?)
        };
        let (c1, c2) = (complex(&m.c1), complex(&m.c2));
        let line = Self {
            n11: complex(&m.d11) + &c1 * &x1,
            n12: complex(&m.d12) + c1 * &x2,
            n21: complex(&m.d21) + &c2 * x1,
            n22: complex(&m.d22) + c2 * x2,
            parameter: lfr
                .deltas()
                .iter()
                .flat_map(|d| std::iter::repeat_n(d.parameter, d.repetitions))
                .collect(),
        };
        line.n22
            .iter()
            .all(|v| v.re.is_finite() && v.im.is_finite())
            .then_some(line)
    }

    /// With `P = (I - n11 D)^-1`, `L = n21 (I - D n11)^-1`, `R = P n12` and `G = P n11`, D being Delta at the centre,
    /// `F(D + H) - F(D) = L H (I - G H)^-1 R = L H R + L H G H R + ...`. The terms up to order m are computed; the rest is at
    /// most `|L| |H| |R| (|H| |G|)^m / (1 - |H| |G|)`, infinite where the cell is too large for that. Any diagonal scaling
    /// of the channels leaves F alone; the one that makes columns of L as long as rows of R is used.
    pub(super) fn expand(&self, cell: &Cell) -> Option<Local> {
        let nd = self.parameter.len();
        if nd == 0 {
            let flat = DMatrix::zeros(self.n22.nrows(), self.n22.ncols());
            return Some(Local {
                value: self.n22.clone(),
                terms: vec![flat],
                rest: 0.0,
            });
        }
        let value_of = |v: &[f64], j: usize| C64::new(v[self.parameter[j]], 0.0);
        let gap = DMatrix::from_fn(nd, nd, |i, j| {
            let one = C64::new(f64::from(u8::from(i == j)), 0.0);
            one - self.n11[(i, j)] * value_of(&cell.centre, j)
        });
        let lu = gap.lu();
        let (r, g) = (lu.solve(&self.n12)?, lu.solve(&self.n11)?);
        let scaled = |m: &DMatrix<C64>, v: &[f64]| {
            DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * value_of(v, j))
        };
        let at_centre = scaled(&self.n21, &cell.centre);
        let value = &self.n22 + &at_centre * &r;
        let l = &self.n21 + at_centre * &g;
        let order = order(cell.directions.len());
        let steps: Vec<_> = cell
            .directions
            .iter()
            .map(|v| (scaled(&l, v), scaled(&g, v)))
            .collect();
        let (mut terms, mut tails) = (Vec::new(), vec![r.clone()]);
        for k in 1..=order {
            let mut longer = Vec::new();
            for tail in &tails {
                for (out, on) in &steps {
                    terms.push(out * tail);
                    if k < order {
                        longer.push(on * tail);
                    }
                }
            }
            tails = longer;
        }
        let radius = (0..nd)
            .map(|j| {
                cell.directions
                    .iter()
                    .map(|v| v[self.parameter[j]].abs())
                    .sum::<f64>()
            })
            .fold(0.0, f64::max);
        let scale: Vec<f64> = (0..nd)
            .map(|j| {
                let ratio = (l.column(j).norm() / r.row(j).norm()).sqrt();
                if ratio.is_normal() { ratio } else { 1.0 }
            })
            .collect();
        let square = |total: f64, v: C64, factor: f64| total + v.norm_sqr() * factor * factor;
        let (mut norm_l, mut norm_r, mut norm_g) = (0.0, 0.0, 0.0);
        for j in 0..nd {
            norm_l = l
                .column(j)
                .iter()
                .fold(norm_l, |t, v| square(t, *v, scale[j].recip()));
            norm_r = r.row(j).iter().fold(norm_r, |t, v| square(t, *v, scale[j]));
            for i in 0..nd {
                norm_g = square(norm_g, g[(i, j)], scale[i] / scale[j]);
            }
        }
        let [norm_l, norm_r, norm_g] = [norm_l, norm_r, norm_g].map(f64::sqrt);
        let room = 1.0 - radius * norm_g;
        let rest = if room > 0.0 {
            norm_l * radius * norm_r * (radius * norm_g).powi(order) / room
        } else {
            f64::INFINITY
        };
        Some(Local { value, terms, rest })
    }
}

impl Cell {
    /// The two halves along the longest direction.
    pub(super) fn split(&self) -> [Self; 2] {
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
        let longest = (0..self.directions.len())
            .max_by(|&i, &j| length(&self.directions[i]).total_cmp(&length(&self.directions[j])))
            .unwrap_or(0);
        [-0.5, 0.5].map(|side| {
            let mut half = self.clone();
            for (i, c) in half.centre.iter_mut().enumerate() {
                *c += side * self.directions[longest][i];
            }
            half.directions[longest].iter_mut().for_each(|v| *v *= 0.5);
            half
        })
    }
}
