//! Starts of the mechanical structure that have the slope of the targets.

use super::Target;
use crate::{Candidate, DeltaSplit, FitError, MechanicalForm, RandomChannels};
use lpv_core::Continuous;
use lpv_core::linalg::{pseudo_inverse, svd};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A start whose slope at the centre is that of the targets, as far as the number of deltas allows.
///
/// With `Z = X E` the acceleration rows, `X = [0; I]` at the centre, the slope is `Z_1 = X_1 E_0 + X_0 E_1`: any `gamma`,
/// the slope of X in the rows of the modes, is balanced by `E_1 = Z_1 - gamma E_0` there. Which one lets E_1 and
/// `[X_1 B_1]` have low rank is not known; the starts differ in it.
pub(super) fn slope_start(
    form: &MechanicalForm,
    split: DeltaSplit,
    targets: &[Target],
    random: RandomChannels,
) -> Result<Candidate<Continuous>, FitError> {
    let plain = form.candidate(split, RandomChannels { size: 0.0, ..random })?;
    let slope = slope(targets);
    let (n, nu, ny) = (plain.states(), plain.inputs(), plain.outputs());
    let nq = n / 2;
    let nm = nq - ny;
    let nd = plain.channels().len() - split.total();
    let sizes = plain.mechanical_sizes();
    let mut m = plain.matrix().clone();
    let (z, w) = (n + ny, n + nu);
    let e0 = m.view((z, 0), (nm, n)).into_owned();
    let inverse = pseudo_inverse(e0.clone(), 1e-12)?;
    let mut rng = ChaCha8Rng::seed_from_u64(random.seed);
    let gamma = DMatrix::from_fn(nm, nm, |_, _| {
        let value: f64 = StandardNormal.sample(&mut rng);
        random.size * value
    });
    let z1 = slope.view((nq, 0), (nq, n));
    // [X_1 B_1], inputs in their typical sizes.
    let mut act = DMatrix::zeros(nq, nm + nu);
    act.view_mut((0, 0), (ny, nm))
        .copy_from(&(z1.rows(0, ny) * inverse));
    act.view_mut((ny, 0), (nm, nm)).copy_from(&gamma);
    for j in 0..nu {
        act.column_mut(nm + j)
            .copy_from(&(slope.view((nq, n + j), (nq, 1)) * (sizes.input[j] / sizes.rate)));
    }
    let forces = (z1.rows(ny, nm) - gamma * e0) / sizes.rate;
    let mut outputs = slope.view((n, 0), (ny, nq)).into_owned();
    for (mut row, scale) in outputs.row_iter_mut().zip(form.scales()) {
        row /= *scale;
    }
    for (k, (left, right)) in low_rank(forces, split.forces)?.into_iter().enumerate() {
        let k = nd + k;
        m.view_mut((z + k, 0), (1, n)).copy_from(&right.transpose());
        m.view_mut((z, w + k), (nm, 1)).copy_from(&(left * sizes.rate));
    }
    for (k, (left, right)) in low_rank(outputs, split.outputs)?.into_iter().enumerate() {
        let k = nd + split.forces + k;
        m.view_mut((z + k, 0), (1, nq)).copy_from(&right.transpose());
        for (i, scale) in form.scales().iter().enumerate() {
            m[(n + i, w + k)] = left[i] * scale;
        }
    }
    for (k, (left, right)) in low_rank(act, split.accelerations)?.into_iter().enumerate() {
        let k = nd + split.forces + split.outputs + k;
        for f in 0..nm {
            m[(z + k, w + f)] = right[f];
        }
        for j in 0..nu {
            m[(z + k, n + j)] = right[nm + j] * sizes.rate / sizes.input[j];
        }
        m.view_mut((nq, w + k), (nq, 1)).copy_from(&left);
    }
    // A little of everything, so that nothing that the slope does not show stays at zero.
    for (at, free) in plain.free().iter().enumerate() {
        if *free && m[at] == 0.0 {
            let value: f64 = StandardNormal.sample(&mut rng);
            m[at] = 1e-3 * value;
        }
    }
    Ok(plain.with_matrix(m))
}

type Triple = (DVector<f64>, DVector<f64>);

/// `sum_k left_k right_k^T`, the balanced singular triples.
fn low_rank(m: DMatrix<f64>, rank: usize) -> Result<Vec<Triple>, FitError> {
    let svd = svd(m)?;
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return Err(FitError::NoConvergence {
            operation: "the singular value decomposition of a slope",
        });
    };
    let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
    order.sort_by(|&i, &j| svd.singular_values[j].total_cmp(&svd.singular_values[i]));
    let triple = |&i: &usize| {
        let root = svd.singular_values[i].sqrt();
        (u.column(i) * root, v.row(i).transpose() * root)
    };
    Ok(order.iter().take(rank).map(triple).collect())
}

/// Slope of S at the centre, of the cubic through the targets.
fn slope(targets: &[Target]) -> DMatrix<f64> {
    // The odd parts of a cubic: least squares of s_1 delta + s_3 delta^3 on the differences of opposite positions.
    let (mut m11, mut m13, mut m33) = (0.0, 0.0, 0.0);
    let zero = DMatrix::zeros(targets[0].s.nrows(), targets[0].s.ncols());
    let (mut r1, mut r3) = (zero.clone(), zero);
    for t in targets {
        let (d, cube) = (t.delta, t.delta.powi(3));
        m11 += d * d;
        m13 += d * cube;
        m33 += cube * cube;
        r1 += &t.s * d;
        r3 += &t.s * cube;
    }
    (r1 * m33 - r3 * m13) / (m11 * m33 - m13 * m13)
}
