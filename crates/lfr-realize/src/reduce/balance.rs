//! Balanced truncation: of one frozen model, and of states and deltas of an LFR by averaged Gramians.

use super::rigid::Split;
use crate::RealizeError;
use lfr_fit::{Candidate, FitError, RandomChannels, Sampling, sampled};
use lpv_core::linalg::{discrete_gramian, eigenvalues, svd, symmetric_eigen};
use lpv_core::{DeltaBlock, Discrete, Lfr, LfrBlocks, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// Hankel singular values below this part of the largest are rounding.
const RANK: f64 = 1e-12;

/// Left and right factors of the projection that balances a pair of Gramians and keeps the largest `order` Hankel singular
/// values: `left^T right = I`.
struct Projection {
    left: DMatrix<f64>,
    right: DMatrix<f64>,
}

impl Projection {
    /// The square-root method: no inverse of a Gramian.
    fn new(reachable: &DMatrix<f64>, observable: &DMatrix<f64>, order: usize) -> Option<Self> {
        let (x, y) = (factor(reachable)?, factor(observable)?);
        let svd = svd(y.transpose() * &x).ok()?;
        let (u, v, values) = (svd.u?, svd.v_t?, svd.singular_values);
        let rank = values
            .iter()
            .take(order)
            .take_while(|s| **s > RANK * values[0])
            .count();
        let scale = DMatrix::from_diagonal(&values.rows(0, rank).map(|s| s.sqrt().recip()));
        Some(Self {
            left: y * u.columns(0, rank) * &scale,
            right: x * v.rows(0, rank).transpose() * scale,
        })
    }
}

/// F with `F F^T = m`, for a Gramian.
fn factor(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let eigen = symmetric_eigen(m.clone()).ok()?;
    Some(&eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt())))
}

/// Poles of the balanced truncation of a stable model to `order` states, or to its rank if that is lower.
pub(crate) fn dominant_poles(model: &StateSpace<Discrete>, order: usize) -> Result<Vec<C64>, RealizeError> {
    let reachable = discrete_gramian(model.a(), model.b())?;
    let observable = discrete_gramian(&model.a().transpose(), &model.c().transpose())?;
    let projection = Projection::new(&reachable, &observable, order).ok_or(FitError::NoConvergence {
        operation: "the balancing of the model at the centre",
    })?;
    Ok(eigenvalues(
        &(projection.left.transpose() * model.a() * projection.right),
    )?)
}

/// An LFR cut to some flexible states and deltas by one projection of each that does not depend on p: their Gramians
/// are averages over positions and lines, relative to the response, one block for the states and one for each parameter.
///
/// `gamma` is the gain of the integrators, which the deltas must not touch. None where that or a factorisation fails:
/// the structure does not allow it.
pub(crate) fn truncated<K: Sampling>(
    lfr: &Lfr<K>,
    clock: Discrete,
    gamma: Option<&DMatrix<f64>>,
    states: usize,
    deltas: &[DeltaBlock],
    samples: &[(Vec<f64>, lpv_core::Frf)],
) -> Option<Candidate<K>> {
    let m = flexible_blocks(lfr, clock, gamma.is_some())?;
    let (n, nu, ny, nc) = (m.a.nrows(), m.b2.ncols(), m.c2.nrows(), m.d11.nrows());
    if n == 0 || nc == 0 {
        return None;
    }
    let complex = |m: &DMatrix<f64>| m.map(|v| C64::new(v, 0.0));
    let mut gramians = [n, n, nc, nc].map(|size| DMatrix::<f64>::zeros(size, size));
    let parameter: Vec<usize> = lfr
        .deltas()
        .iter()
        .flat_map(|d| std::iter::repeat_n(d.parameter, d.repetitions))
        .collect();
    for (p, frf) in samples {
        let normal = lfr.range().normalise(p);
        let delta: Vec<f64> = parameter.iter().map(|&j| normal[j]).collect();
        let gap = DMatrix::from_fn(nc, nc, |i, j| {
            f64::from(u8::from(i == j)) - m.d11[(i, j)] * delta[j]
        });
        let loops = gap.try_inverse()?;
        let mut k = loops.clone();
        for (mut row, d) in k.row_iter_mut().zip(&delta) {
            row *= *d;
        }
        let (a, b) = (&m.a + &m.b1 * &k * &m.c1, &m.b2 + &m.b1 * &k * &m.d12);
        let (c, through) = (&m.c2 + &m.d21 * &k * &m.c1, &loops * &m.c1);
        for (line, &f) in frf.frequencies_hz().iter().enumerate() {
            let size = frf.line(line).norm();
            let mut resolvent = -complex(&a);
            for i in 0..n {
                resolvent[(i, i)] += lfr.clock().point(f);
            }
            let inverse = resolvent.try_inverse()?;
            let x = &inverse * complex(&b);
            let y = complex(&c) * inverse;
            let z = complex(&through) * &x + complex(&(&loops * &m.d12));
            let w = &y * complex(&(&m.b1 * &k)) + complex(&(&m.d21 * &k));
            let add = |to: &mut DMatrix<f64>, by: DMatrix<C64>| *to += by.map(|v| v.re / size);
            add(&mut gramians[0], &x * x.adjoint());
            add(&mut gramians[1], y.adjoint() * y);
            add(&mut gramians[2], &z * z.adjoint());
            add(&mut gramians[3], w.adjoint() * w);
        }
    }
    let state = Projection::new(&gramians[0], &gramians[1], states)?;
    let kept = state.left.ncols();
    // One block a wanted parameter; a channel that no direction is left for stays without effect, and random.
    let wanted: usize = deltas.iter().map(|d| d.repetitions).sum();
    let (mut left, mut right) = (DMatrix::zeros(nc, wanted), DMatrix::zeros(nc, wanted));
    let mut found = vec![false; wanted];
    let mut at = 0;
    for block in deltas {
        let own: Vec<usize> = (0..nc).filter(|&j| parameter[j] == block.parameter).collect();
        if !own.is_empty() {
            let part = |g: &DMatrix<f64>| g.select_rows(&own).select_columns(&own);
            let channel = Projection::new(&part(&gramians[2]), &part(&gramians[3]), block.repetitions)?;
            for j in 0..channel.left.ncols() {
                found[at + j] = true;
                for (row, &i) in own.iter().enumerate() {
                    left[(i, at + j)] = channel.left[(row, j)];
                    right[(i, at + j)] = channel.right[(row, j)];
                }
            }
        }
        at += block.repetitions;
    }
    let (sl, sr) = (state.left.transpose(), &state.right);
    let local = StateSpace::new(
        &sl * &m.a * sr,
        &sl * &m.b2,
        &m.c2 * sr,
        m.d22.clone(),
        lfr.clock(),
    )
    .ok()?;
    let random = RandomChannels { seed: 0, size: 1e-3 };
    let start = Candidate::flexible(&local, gamma, deltas, lfr.range().clone(), random).ok()?;
    let mut whole = start.matrix().clone();
    let rigid = start.states() - kept;
    let (first_w, first_z) = (start.states() + nu, start.states() + ny);
    let (b1, d21) = (sl * &m.b1 * &right, &m.d21 * &right);
    let (c1, d12) = (left.transpose() * &m.c1 * sr, left.transpose() * &m.d12);
    let d11 = left.transpose() * &m.d11 * &right;
    for j in (0..wanted).filter(|&j| found[j]) {
        whole
            .view_mut((rigid, first_w + j), (kept, 1))
            .copy_from(&b1.column(j));
        whole
            .view_mut((start.states(), first_w + j), (ny, 1))
            .copy_from(&d21.column(j));
        whole
            .view_mut((first_z + j, rigid), (1, kept))
            .copy_from(&c1.row(j));
        whole
            .view_mut((first_z + j, start.states()), (1, nu))
            .copy_from(&d12.row(j));
    }
    whole.view_mut((first_z, first_w), d11.shape()).copy_from(&d11);
    start.with_entries(whole).ok()
}

/// The nine matrices without integrators; none if a delta touches one.
fn flexible_blocks<K: Sampling>(lfr: &Lfr<K>, clock: Discrete, has_rigid: bool) -> Option<LfrBlocks> {
    let m = lfr.blocks();
    if !has_rigid {
        return Some(m.clone());
    }
    // The projections are those of the sampled A, which has the invariant subspaces of A.
    let nominal = StateSpace::new(
        m.a.clone(),
        m.b2.clone(),
        m.c2.clone(),
        m.d22.clone(),
        lfr.clock(),
    )
    .ok()?;
    let bases = Split::bases(&sampled(&nominal, clock).ok()??)?;
    // A B1 or C1 of rounding alone touches nothing.
    let small =
        |part: DMatrix<f64>, of: &DMatrix<f64>| part.amax() <= 1e-9 * of.amax().max(1e-6 * m.a.amax());
    let touched = !small(bases.left.transpose() * &m.b1, &m.b1) || !small(&m.c1 * &bases.right, &m.c1);
    if touched {
        return None;
    }
    let (u, v) = (bases.left_rest, bases.right_rest);
    let left = (u.transpose() * &v).try_inverse()? * u.transpose();
    Some(LfrBlocks {
        a: &left * &m.a * &v,
        b1: &left * &m.b1,
        b2: &left * &m.b2,
        c1: &m.c1 * &v,
        c2: &m.c2 * &v,
        ..m.clone()
    })
}
