//! Coordinates of the positions that make B and C smooth functions of p: changes that commute with A.

use super::model::Modal;
use super::sides::Weights;
use super::{Place, ShapesAt};
use crate::FitError;
use lpv_core::linalg::{least_squares, symmetric_eigen};
use nalgebra::{DMatrix, DVector};

/// Gauss-Newton iterations of a change.
const ITERATIONS: usize = 100;

/// Part of the squares that a step must win.
const SETTLED: f64 = 1e-4;

/// Length over which B and C change, in halves of the range of p.
const LENGTH: f64 = 3.0;

/// Dampings of a step that are tried.
const TRIALS: usize = 12;

/// All positions with the B of the one that knows it best, as near in weighted squares as a change of coordinates gets, or with its C where
/// inputs see the shapes: linear least squares in the change, or in its inverse.
pub(super) fn aligned(
    modal: &Modal,
    places: &[Place],
    shapes: ShapesAt,
    weights: &Weights,
) -> Result<Option<Vec<Place>>, FitError> {
    let mut found = places.to_vec();
    for block in modal.blocks() {
        let size = block.1;
        let [lb, rb, lc, rc] = weights.of_block(block)?;
        let generators = modal.generators(block);
        let [to_b, to_c] = places[weights.best_known(block, shapes)].block(block);
        for place in &mut found {
            let [b, c] = place.block(block);
            let on_b = shapes.has_outputs();
            let of = |change: &DMatrix<f64>| match on_b {
                true => &lb * (change * &b) * &rb,
                false => &lc * (&c * change) * &rc,
            };
            let goal = match on_b {
                true => &lb * &to_b * &rb,
                false => &lc * &to_c * &rc,
            };
            let columns: Vec<DVector<f64>> = generators
                .iter()
                .map(|e| DVector::from_column_slice(of(e).as_slice()))
                .collect();
            let target = DMatrix::from_column_slice(goal.len(), 1, goal.as_slice());
            let solved = least_squares(DMatrix::from_columns(&columns), &target, 1e-14)
                .map_err(|_| no_coordinates())?;
            let change = generators
                .iter()
                .zip(solved.iter())
                .fold(DMatrix::zeros(size, size), |sum, (e, v)| sum + e * *v);
            let Some(back) = change.clone().try_inverse() else {
                return Ok(None);
            };
            let (left, right) = if on_b { (change, back) } else { (back, change) };
            place.set_block(block, &[left * b, c * right]);
        }
    }
    Ok(Some(found))
}

fn no_coordinates() -> FitError {
    FitError::NoConvergence {
        operation: "the coordinates in which B and C are smooth",
    }
}

/// The position in the middle.
fn nearest_to_zero(deltas: &[f64]) -> usize {
    let by_size = |a: &usize, b: &usize| deltas[*a].abs().total_cmp(&deltas[*b].abs());
    (0..deltas.len()).min_by(by_size).unwrap_or(0)
}

/// Each position with B and C as near to those of its neighbour towards the middle as they come.
pub(super) fn chained(modal: &Modal, places: &[Place], deltas: &[f64]) -> Option<Vec<Place>> {
    let middle = nearest_to_zero(deltas);
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| deltas[*a].total_cmp(&deltas[*b]));
    let at = order.iter().position(|i| *i == middle)?;
    let mut found = places.to_vec();
    for step in order[at..].windows(2) {
        found[step[1]] = nearest(modal, &found[step[1]], &found[step[0]])?;
    }
    for step in order[..=at].windows(2).rev() {
        found[step[0]] = nearest(modal, &found[step[0]], &found[step[1]])?;
    }
    Some(found)
}

/// Takes over every block that has a constant B in the first of two sets of coordinates, or a constant C in the second, up to this sum
/// of squares: a rigid body has, whose directions are the same wherever its sensors are. Each set with its weights.
pub(super) fn constant_sides(
    modal: &Modal,
    sets: [(&[Place], &Weights); 2],
    enough: f64,
    turned: &mut [Place],
    settled: &mut [bool],
) {
    for (block, settled) in modal.blocks().zip(settled) {
        let missed = |(places, weights): (&[Place], &Weights), shapes| {
            let found = weights.constant_block(places, block, shapes);
            found.map_or(f64::INFINITY, |(_, missed)| missed)
        };
        let of = [
            missed(sets[0], ShapesAt::Outputs),
            missed(sets[1], ShapesAt::Inputs),
        ];
        let (from, _) = sets[usize::from(of[1] < of[0])];
        if of[0].min(of[1]) <= enough {
            *settled = true;
            for (place, from) in turned.iter_mut().zip(from) {
                place.set_block(block, &from.block(block));
            }
        }
    }
}

/// All positions in the coordinates in which B and C are smoothest over p, block by block from the best of several starts: the squares of
/// `sum_i R_iq [X_i B_i, C_i X_i^-1]` are least, R the [roughness]. Blocks that are settled stay.
pub(super) fn smoothed(
    modal: &Modal,
    starts: &[Vec<Place>],
    deltas: &[f64],
    settled: &[bool],
) -> Result<Option<Vec<Place>>, FitError> {
    let Some(mut best) = starts.first().cloned() else {
        return Ok(None);
    };
    let rough = roughness(deltas)?;
    for (block, settled) in modal.blocks().zip(settled) {
        let mut least = f64::INFINITY;
        for start in starts.iter().filter(|_| !*settled) {
            let (found, cost) = smooth_block(modal, block, start, &rough)?;
            if cost < least {
                least = cost;
                for (place, found) in best.iter_mut().zip(found) {
                    place.set_block(block, &found.block(block));
                }
            }
        }
    }
    Ok(Some(best))
}

/// One block of [`smoothed`] by Levenberg and Marquardt, and the squares that are left.
fn smooth_block(
    modal: &Modal,
    block: (usize, usize),
    start: &[Place],
    rough: &DMatrix<f64>,
) -> Result<(Vec<Place>, f64), FitError> {
    let count = start.len();
    let mut found = start.to_vec();
    let generators = modal.generators(block);
    let (ny, nu) = (start[0].c.nrows(), start[0].b.ncols());
    let of_place = block.1 * (ny + nu);
    let sizes = [0, 1].map(|side| {
        let squares = start.iter().map(|place| place.block(block)[side].norm_squared());
        (squares.sum::<f64>() / count as f64)
            .sqrt()
            .max(f64::MIN_POSITIVE)
    });
    let column = |[b, c]: &[DMatrix<f64>; 2]| {
        DVector::from_iterator(
            of_place,
            b.iter()
                .map(|v| v / sizes[0])
                .chain(c.iter().map(|v| v / sizes[1])),
        )
    };
    let cost = |found: &[Place]| -> f64 {
        let own: Vec<DVector<f64>> = found.iter().map(|place| column(&place.block(block))).collect();
        (0..rough.ncols())
            .map(|q| {
                let sum = own.iter().enumerate().map(|(i, x)| x * rough[(i, q)]);
                sum.fold(DVector::zeros(of_place), |sum, x| sum + x)
                    .norm_squared()
            })
            .sum()
    };
    let mut last = cost(&found);
    let mut damping = 1e-2;
    for _ in 0..ITERATIONS {
        let mut design = DMatrix::zeros(rough.ncols() * of_place, count * generators.len());
        let mut target = DMatrix::zeros(rough.ncols() * of_place, 1);
        for (i, place) in found.iter().enumerate() {
            let parts = place.block(block);
            let own = column(&parts);
            let [b, c] = &parts;
            for q in 0..rough.ncols() {
                let mut rows = target.rows_mut(q * of_place, of_place);
                rows -= &own * rough[(i, q)];
            }
            for (k, e) in generators.iter().enumerate() {
                let change = column(&[e * b, -(c * e)]);
                for q in 0..rough.ncols() {
                    design
                        .view_mut((q * of_place, i * generators.len() + k), (of_place, 1))
                        .copy_from(&(&change * rough[(i, q)]));
                }
            }
        }
        let before = last;
        for _ in 0..TRIALS {
            let step = damped(&design, &target, damping)?;
            let moved = changed(&found, block, &generators, &step);
            let now = moved.as_deref().map_or(f64::INFINITY, cost);
            if let (Some(moved), true) = (moved, now < last) {
                (found, last) = (moved, now);
                damping *= 0.2;
                break;
            }
            damping *= 5.0;
        }
        if last > (1.0 - SETTLED) * before {
            break;
        }
    }
    Ok((found, last))
}

/// A step of Levenberg and Marquardt: columns of equal length, damped by this part of it.
fn damped(design: &DMatrix<f64>, target: &DMatrix<f64>, damping: f64) -> Result<DMatrix<f64>, FitError> {
    let (rows, columns) = design.shape();
    let mut all = DMatrix::zeros(rows + columns, columns);
    let lengths: Vec<f64> = design
        .column_iter()
        .map(|c| c.norm().max(f64::MIN_POSITIVE))
        .collect();
    for (j, length) in lengths.iter().enumerate() {
        all.view_mut((0, j), (rows, 1))
            .copy_from(&(design.column(j) / *length));
        all[(rows + j, j)] = damping;
    }
    let target = target.clone().resize_vertically(rows + columns, 0.0);
    let mut step = least_squares(all, &target, 1e-12).map_err(|_| no_coordinates())?;
    step.row_iter_mut()
        .zip(&lengths)
        .for_each(|(mut row, length)| row /= *length);
    Ok(step)
}

/// All positions after a change `1 + sum e_k E_k` of one block each; none where one cannot be inverted.
fn changed(
    places: &[Place],
    block: (usize, usize),
    generators: &[DMatrix<f64>],
    step: &DMatrix<f64>,
) -> Option<Vec<Place>> {
    let mut found = places.to_vec();
    for (i, place) in found.iter_mut().enumerate() {
        let [b, c] = place.block(block);
        let mut e = DMatrix::identity(block.1, block.1);
        for (k, g) in generators.iter().enumerate() {
            e += g * step[i * generators.len() + k];
        }
        let back = e.clone().try_inverse()?;
        place.set_block(block, &[e * b, c * back]);
    }
    Some(found)
}

/// `K^(-1/2)` of the covariance `exp(-(d_i - d_j)^2 / 2 l^2)` of smooth functions on these positions: the squares of what it makes of a
/// function are the less the smoother the function is.
fn roughness(deltas: &[f64]) -> Result<DMatrix<f64>, FitError> {
    /// Part of the largest eigenvalue below which all is alike rough.
    const LEAST: f64 = 1e-12;
    let count = deltas.len();
    let k = DMatrix::from_fn(count, count, |i, j| {
        (-0.5 * ((deltas[i] - deltas[j]) / LENGTH).powi(2)).exp()
    });
    let eigen = symmetric_eigen(k)?;
    let floor = LEAST * eigen.eigenvalues.max();
    let scaled = eigen.eigenvalues.map(|v| v.max(floor).sqrt().recip());
    Ok(eigen.eigenvectors * DMatrix::from_diagonal(&scaled))
}

/// `X B` and `C X^-1` nearest to another position, X in the commutant of A: squares relative to the sizes of B and C there.
fn nearest(modal: &Modal, place: &Place, to: &Place) -> Option<Place> {
    let mut found = place.clone();
    for block in modal.blocks() {
        let size = block.1;
        let [goal_b, goal_c] = to.block(block);
        let [wb, wc] = [1.0 / norm(&goal_b), 1.0 / norm(&goal_c)];
        let generators = modal.generators(block);
        let [mut b, mut c] = found.block(block);
        for _ in 0..ITERATIONS {
            // (1 + E) B - B_goal and C (1 - E) - C_goal, linear in E.
            let rows = b.len() + c.len();
            let mut design = DMatrix::zeros(rows, generators.len());
            for (k, e) in generators.iter().enumerate() {
                let (eb, ce) = (e * &b * wb, &c * e * (-wc));
                let values = eb.iter().chain(ce.iter());
                values.enumerate().for_each(|(i, v)| design[(i, k)] = *v);
            }
            let (left_b, left_c) = ((&goal_b - &b) * wb, (&goal_c - &c) * wc);
            let target = DMatrix::from_iterator(rows, 1, left_b.iter().chain(left_c.iter()).copied());
            let step = least_squares(design, &target, 1e-12).ok()?;
            let mut e = DMatrix::zeros(size, size);
            for (g, v) in generators.iter().zip(step.iter()) {
                e += g * *v;
            }
            // Far from the goal a whole step may turn the block inside out.
            let length = e.norm();
            if length > 0.5 {
                e *= 0.5 / length;
            }
            let change = DMatrix::identity(size, size) + &e;
            let back = change.clone().try_inverse()?;
            b = change * b;
            c *= back;
            if length < 1e-12 {
                break;
            }
        }
        found.set_block(block, &[b, c]);
    }
    let finite = |m: &DMatrix<f64>| m.iter().all(|v| v.is_finite());
    (finite(&found.b) && finite(&found.c)).then_some(found)
}

fn norm(m: &DMatrix<f64>) -> f64 {
    m.norm().max(f64::MIN_POSITIVE)
}
