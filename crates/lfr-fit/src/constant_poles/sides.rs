//! B and C as functions of p: polynomials through the positions, and their realisations with few deltas.

use super::model::Modal;
use super::{Place, ShapesAt};
use crate::grow::roots;
use crate::ho_kalman::HoKalman;
use crate::{FitError, FrozenData, sampled};
use lpv_core::CoreError;
use lpv_core::linalg::least_squares;
use nalgebra::{DMatrix, DVector};

/// How far a change of B or of C moves the responses of a position: `tr(left dX right dX^T)` is the sum of squares that it adds there.
/// What a change of B does depends on C, and so on the position and on its coordinates.
pub(super) struct Weights {
    /// On average over the positions.
    b: [DMatrix<f64>; 2],
    c: [DMatrix<f64>; 2],
    /// Left of B and right of C, by position.
    each: Vec<[DMatrix<f64>; 2]>,
}

impl Weights {
    pub(super) fn new(modal: &Modal, places: &[Place], few: &FrozenData) -> Result<Self, FitError> {
        let (m, ny, nu) = (modal.size(), few.outputs(), few.inputs());
        // From what B moves to what C sees.
        let between = Place {
            b: DMatrix::identity(m, m),
            c: DMatrix::identity(m, m),
        };
        let between = sampled(&modal.frozen(&between)?, few.clock())?.ok_or(CoreError::Singular {
            operation: "the hold of a model with constant poles",
        })?;
        let zero = |n: usize| DMatrix::<f64>::zeros(n, n);
        let (mut b, mut c) = ([zero(m), zero(nu)], [zero(ny), zero(m)]);
        let mut each = Vec::with_capacity(places.len());
        // Of each line: what it knows of each coordinate of B and of C, and its weights of inputs and outputs.
        let mut lines: Vec<[(DVector<f64>, DMatrix<f64>); 2]> = Vec::new();
        for (position, place) in few.positions().iter().zip(places) {
            let response = between.frequency_response(position.frf.frequencies_hz())?;
            let complex = |x: &DMatrix<f64>| x.map(super::C64::from);
            let (own_b, own_c) = (complex(&place.b), complex(&place.c));
            let mut own = [zero(m), zero(m)];
            for k in 0..position.frf.len() {
                let (left, right) = position.factors(k);
                let through = response.line(k);
                let moved = through * &own_b * &right;
                let seen = &left * &own_c * through;
                let of_b = (seen.adjoint() * seen).map(|v| v.re);
                let of_c = (&moved * moved.adjoint()).map(|v| v.re);
                lines.push([
                    (of_b.diagonal(), (&right * right.adjoint()).map(|v| v.re)),
                    (of_c.diagonal(), (left.adjoint() * &left).map(|v| v.re)),
                ]);
                own[0] += of_b;
                own[1] += of_c;
            }
            b[0] += &own[0];
            c[1] += &own[1];
            each.push(own);
        }
        let positions = places.len() as f64;
        // Inputs and outputs weigh as on the lines that know the coordinates: those are few, and merged ones weigh by their number.
        let mean = |side: usize, total: &DMatrix<f64>, size: usize| {
            let (mut sum, mut count) = (zero(size), 0.0);
            for line in &lines {
                let (known, weights) = &line[side];
                let shares = known
                    .iter()
                    .enumerate()
                    .map(|(k, v)| v / total[(k, k)].max(f64::MIN_POSITIVE));
                let share: f64 = shares.sum();
                sum += weights * share;
                count += share;
            }
            sum / count.max(f64::MIN_POSITIVE)
        };
        b[1] = mean(0, &b[0], nu);
        c[0] = mean(1, &c[1], ny);
        b[0] /= positions;
        c[1] /= positions;
        Ok(Self { b, c, each })
    }

    /// Of several positions, those that know B of a block best, or C.
    pub(super) fn best_known(&self, (first, size): (usize, usize), shapes: ShapesAt) -> usize {
        let side = usize::from(!shapes.has_outputs());
        let known = |i: &usize| {
            (first..first + size)
                .map(|k| self.each[*i][side][(k, k)])
                .sum::<f64>()
        };
        let all = 0..self.each.len();
        all.max_by(|x, y| known(x).total_cmp(&known(y))).unwrap_or(0)
    }

    /// Roots of the weights of one block of coordinates: left and right of B, left and right of C.
    pub(super) fn of_block(&self, (first, size): (usize, usize)) -> Result<[DMatrix<f64>; 4], FitError> {
        let block = |m: &DMatrix<f64>| m.view((first, first), (size, size)).into_owned();
        let root = |m: &DMatrix<f64>| roots(m).map(|[root, _]| root);
        Ok([
            root(&block(&self.b[0]))?,
            root(&self.b[1])?,
            root(&self.c[0])?,
            root(&block(&self.c[1]))?,
        ])
    }

    /// Numbers in what the shapes move, at one position.
    pub(super) fn unknowns(&self, shapes: ShapesAt) -> usize {
        let size = |[left, right]: &[DMatrix<f64>; 2]| left.nrows() * right.nrows();
        let of = |has: bool, side| if has { size(side) } else { 0 };
        of(shapes.has_outputs(), &self.c) + of(shapes.has_inputs(), &self.b)
    }

    /// Entries of the sides that the shapes move, weighted so that their noise has variance one: for each row of B, or column of C,
    /// the values of each entry over the positions.
    pub(super) fn rows(
        &self,
        places: &[Place],
        shapes: ShapesAt,
    ) -> Result<Vec<Vec<DVector<f64>>>, FitError> {
        let mut found = Vec::new();
        for (has, side, [left, right]) in [
            (shapes.has_inputs(), 0, &self.b),
            (shapes.has_outputs(), 1, &self.c),
        ] {
            if !has {
                continue;
            }
            let ([left, _], [right, _]) = (roots(left)?, roots(right)?);
            // Coordinates in rows on either side.
            let own: Vec<DMatrix<f64>> = places
                .iter()
                .map(|place| match side {
                    0 => &left * &place.b * &right,
                    _ => (&left * &place.c * &right).transpose(),
                })
                .collect();
            let (rows, columns) = own.first().map_or((0, 0), DMatrix::shape);
            let entry = |i: usize, j: usize| DVector::from_iterator(own.len(), own.iter().map(|m| m[(i, j)]));
            found.extend((0..rows).map(|i| (0..columns).map(|j| entry(i, j)).collect()));
        }
        Ok(found)
    }

    /// The side that should be constant at its best, in weighted least squares, and the sum of squares by which it is not. The weights
    /// are those of these places.
    pub(super) fn constant(&self, places: &[Place], shapes: ShapesAt) -> Option<(DMatrix<f64>, f64)> {
        let whole = (0, places.first()?.b.nrows());
        self.constant_block(places, whole, shapes)
    }

    /// The same of one block of coordinates.
    pub(super) fn constant_block(
        &self,
        places: &[Place],
        (first, size): (usize, usize),
        shapes: ShapesAt,
    ) -> Option<(DMatrix<f64>, f64)> {
        let on_b = shapes.has_outputs();
        let weight = |i: usize| {
            let whole = &self.each[i][usize::from(!on_b)];
            whole.view((first, first), (size, size)).into_owned()
        };
        // C from the other side, so that both read alike.
        let value = |place: &Place| match on_b {
            true => place.b.rows(first, size).into_owned(),
            false => place.c.columns(first, size).transpose(),
        };
        let other = if on_b { &self.b[1] } else { &self.c[0] };
        let (mut sum, mut moment) = (DMatrix::zeros(size, size), None);
        for (i, place) in places.iter().enumerate() {
            let weight = weight(i);
            let own = &weight * value(place);
            sum += weight;
            moment = Some(moment.map_or_else(|| own.clone(), |m: DMatrix<f64>| m + &own));
        }
        // Coordinates of equal weight: those of a rigid body and of a mode differ by orders.
        let scale: Vec<f64> = (0..size)
            .map(|k| sum[(k, k)].max(f64::MIN_POSITIVE).sqrt().recip())
            .collect();
        let even = DMatrix::from_fn(size, size, |i, j| sum[(i, j)] * scale[i] * scale[j]);
        let mut moment = moment?;
        moment
            .row_iter_mut()
            .zip(&scale)
            .for_each(|(mut row, s)| row *= *s);
        let mut best = least_squares(even, &moment, 1e-13).ok()?;
        best.row_iter_mut().zip(&scale).for_each(|(mut row, s)| row *= *s);
        let missed = places.iter().enumerate().map(|(i, place)| {
            let change = value(place) - &best;
            (weight(i) * &change * other).dot(&change)
        });
        let missed = missed.sum();
        Some((if on_b { best } else { best.transpose() }, missed))
    }

    /// Sum of squares by which the functions of p miss these places; the weights are theirs.
    pub(super) fn misfit(&self, sides: &Sides, deltas: &[f64], places: &[Place]) -> f64 {
        let at = |((delta, place), [left, right]): ((&f64, &Place), &[DMatrix<f64>; 2])| {
            let (db, dc) = (
                value(&sides.b, *delta) - &place.b,
                value(&sides.c, *delta) - &place.c,
            );
            (left * &db * &self.b[1]).dot(&db) + (&self.c[0] * &dc * right).dot(&dc)
        };
        deltas.iter().zip(places).zip(&self.each).map(at).sum()
    }
}

/// Coefficients of `X(delta) = X_0 + X_1 delta + ...`.
type Polynomial = Vec<DMatrix<f64>>;

fn value(polynomial: &Polynomial, delta: f64) -> DMatrix<f64> {
    let first = polynomial.first().map_or((0, 0), DMatrix::shape);
    let start = DMatrix::zeros(first.0, first.1);
    polynomial.iter().rev().fold(start, |sum, x| sum * delta + x)
}

/// B and C as polynomials.
pub(super) struct Sides {
    b: Polynomial,
    c: Polynomial,
    positions: usize,
}

impl Sides {
    /// Through the positions by least squares; `constant` where the shapes are not.
    pub(super) fn new(
        deltas: &[f64],
        places: &[Place],
        (shapes, constant): (ShapesAt, &DMatrix<f64>),
        degree: usize,
    ) -> Result<Self, FitError> {
        let of = |has: bool, of: fn(&Place) -> &DMatrix<f64>| match has {
            true => polynomial(deltas, &places.iter().map(of).collect::<Vec<_>>(), degree),
            false => Ok(vec![constant.clone()]),
        };
        Ok(Self {
            b: of(shapes.has_inputs(), |p| &p.b)?,
            c: of(shapes.has_outputs(), |p| &p.c)?,
            positions: places.len(),
        })
    }

    /// B and C at a position.
    pub(super) fn at(&self, delta: f64) -> Place {
        Place {
            b: value(&self.b, delta),
            c: value(&self.c, delta),
        }
    }

    /// The realisations of both.
    pub(super) fn hankel(&self, weights: &Weights) -> Result<Hankel, FitError> {
        Ok(Hankel {
            b: HankelSide::new(&self.b, &weights.b)?,
            c: HankelSide::new(&self.c, &weights.c)?,
            positions: self.positions as f64,
        })
    }
}

fn polynomial(deltas: &[f64], samples: &[&DMatrix<f64>], degree: usize) -> Result<Polynomial, FitError> {
    let first = samples.first().ok_or(FitError::Empty { what: "positions" })?;
    let (rows, columns) = first.shape();
    let design = DMatrix::from_fn(deltas.len(), degree + 1, |i, k| deltas[i].powi(k as i32));
    let targets = DMatrix::from_fn(deltas.len(), first.len(), |i, j| samples[i][j]);
    let solved = least_squares(design, &targets, 1e-12).map_err(|_| FitError::NoConvergence {
        operation: "the polynomial through the models of the positions",
    })?;
    Ok((0..=degree)
        .map(|k| DMatrix::from_iterator(rows, columns, solved.row(k).iter().copied()))
        .collect())
}

/// `X(delta) = constant + left Delta (I - inner Delta)^-1 right`.
pub(super) struct Side {
    pub(super) constant: DMatrix<f64>,
    pub(super) left: DMatrix<f64>,
    pub(super) inner: DMatrix<f64>,
    pub(super) right: DMatrix<f64>,
}

impl Side {
    pub(super) fn constant(constant: DMatrix<f64>) -> Self {
        let (rows, columns) = constant.shape();
        Self {
            constant,
            left: DMatrix::zeros(rows, 0),
            inner: DMatrix::zeros(0, 0),
            right: DMatrix::zeros(0, columns),
        }
    }
}

/// B and C with their deltas.
pub(super) struct Realised {
    pub(super) b: Side,
    pub(super) c: Side,
}

/// Realisations that can be cut.
pub(super) struct Hankel {
    b: HankelSide,
    c: HankelSide,
    positions: f64,
}

struct HankelSide {
    constant: DMatrix<f64>,
    /// None for a constant.
    realisation: Option<HoKalman>,
    /// Inverse roots of the weights.
    back: [DMatrix<f64>; 2],
}

impl HankelSide {
    fn new(polynomial: &Polynomial, [left, right]: &[DMatrix<f64>; 2]) -> Result<Self, FitError> {
        let ([left, left_back], [right, right_back]) = (roots(left)?, roots(right)?);
        let (constant, others) = polynomial
            .split_first()
            .ok_or(FitError::Empty { what: "coefficients" })?;
        let weighted: Vec<DMatrix<f64>> = others.iter().map(|x| &left * x * &right).collect();
        Ok(Self {
            constant: constant.clone(),
            realisation: (!weighted.is_empty())
                .then(|| HoKalman::new(&weighted))
                .transpose()?,
            back: [left_back, right_back],
        })
    }

    fn values(&self) -> &[f64] {
        self.realisation.as_ref().map_or(&[], HoKalman::values)
    }

    fn cut(&self, size: usize) -> Side {
        let Some(found) = self.realisation.as_ref().map(|r| r.cut(size)) else {
            return Side::constant(self.constant.clone());
        };
        Side {
            constant: self.constant.clone(),
            left: &self.back[0] * found.left,
            inner: found.inner,
            right: found.right * &self.back[1],
        }
    }
}

impl Hankel {
    /// Deltas that realise the polynomials exactly.
    pub(super) fn rank(&self) -> usize {
        self.b.values().len() + self.c.values().len()
    }

    /// Singular values of both, the largest first.
    fn values(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.b.values().iter().chain(self.c.values()).copied().collect();
        all.sort_by(|a, b| b.total_cmp(a));
        all
    }

    /// Deltas without which the responses miss by about this sum of squares, at least one.
    pub(super) fn enough(&self, room: f64) -> usize {
        let values = self.values();
        let mut tail = 0.0;
        let spare = values.iter().rev().take_while(|v| {
            tail += *v * *v * self.positions;
            tail <= room
        });
        (values.len() - spare.count()).max(1)
    }

    /// With so many deltas, the weakest left out.
    pub(super) fn cut(&self, size: usize) -> Realised {
        let least = self
            .values()
            .into_iter()
            .take(size)
            .next_back()
            .unwrap_or(f64::INFINITY);
        let kept = |side: &HankelSide| side.values().iter().filter(|v| **v >= least).count();
        Realised {
            b: self.b.cut(kept(&self.b)),
            c: self.c.cut(kept(&self.c)),
        }
    }
}
