//! The refinement of an LFR on frozen responses, to the same cost.

use super::{C64, Failure, Run, parts, write};
use lfr_realize::{Candidate, FrozenData, RefineSettings, refine};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{DeltaBlock, Discrete, Frf, Lfr, LfrBlocks, SchedulingRange};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::Path;

const STATES: usize = 8;
const DELTAS: usize = 5;
const POSITIONS: usize = 21;
const LINES: usize = 160;
/// Noise of the responses, relative.
const NOISE: f64 = 1e-3;
/// How far the start is from the truth, entry by entry.
const AWAY: f64 = 0.02;
/// Both are done at a cost that is so near the least one.
const DONE: f64 = 1.001;

struct Case {
    start: Candidate<Discrete>,
    data: FrozenData,
    responses: Vec<(Vec<f64>, Frf)>,
    exact: Vec<Frf>,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn lines() -> Vec<f64> {
    (0..LINES).map(|k| (k as f64 + 0.5) / 16.0).collect()
}

/// Four modes whose couplings depend on p.
fn truth(rng: &mut ChaCha8Rng) -> Result<Lfr<Discrete>, Failure> {
    let mut a = DMatrix::zeros(STATES, STATES);
    for (i, angle) in [0.35, 0.55, 0.9, 1.6].into_iter().enumerate() {
        let pole = C64::from_polar(0.985, angle);
        a.view_mut((2 * i, 2 * i), (2, 2))
            .copy_from_slice(&[pole.re, pole.im, -pole.im, pole.re]);
    }
    let mut matrix =
        |rows: usize, columns: usize, size: f64| DMatrix::from_fn(rows, columns, |_, _| size * normal(rng));
    let blocks = LfrBlocks {
        b2: matrix(STATES, 2, 1.0),
        c2: matrix(2, STATES, 1.0),
        d22: DMatrix::zeros(2, 2),
        b1: matrix(STATES, DELTAS, 0.05),
        c1: matrix(DELTAS, STATES, 0.05),
        d12: matrix(DELTAS, 2, 0.3),
        d21: matrix(2, DELTAS, 0.3),
        d11: matrix(DELTAS, DELTAS, 0.1),
        a,
    };
    let deltas = vec![DeltaBlock {
        parameter: 0,
        repetitions: DELTAS,
    }];
    Ok(Lfr::new(
        blocks,
        deltas,
        SchedulingRange::new(vec![[-1.0, 1.0]])?,
        Discrete::from_rate(20.0)?,
    )?)
}

fn case() -> Result<Case, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let lfr = truth(&mut rng)?;
    let (mut responses, mut exact) = (Vec::new(), Vec::new());
    for i in 0..POSITIONS {
        let p = vec![2.0 * i as f64 / (POSITIONS - 1) as f64 - 1.0];
        let frf = lfr.frozen(&p)?.frequency_response(&lines())?;
        let mut noisy = frf.clone();
        for k in 0..LINES {
            let size = NOISE * frf.line(k).norm() / 8.0_f64.sqrt();
            for value in noisy.line_slice_mut(k) {
                *value += C64::new(normal(&mut rng), normal(&mut rng)) * size;
            }
        }
        exact.push(frf);
        responses.push((p, noisy));
    }
    let exact_candidate = Candidate::from_lfr(&lfr)?;
    let mut matrix = exact_candidate.matrix().clone();
    for at in exact_candidate.free_entries() {
        matrix[at] += AWAY * normal(&mut rng);
    }
    Ok(Case {
        start: with_matrix(&lfr, &matrix)?,
        data: FrozenData::relative(Discrete::from_rate(20.0)?, &responses)?,
        responses,
        exact,
    })
}

/// An LFR of the same shape from its one matrix, `x, y, z` by `x, u, w`.
fn with_matrix(lfr: &Lfr<Discrete>, m: &DMatrix<f64>) -> Result<Candidate<Discrete>, Failure> {
    let part = |i: (usize, usize), j: (usize, usize)| m.view((i.0, j.0), (i.1, j.1)).into_owned();
    let (x, y, w) = ((0, STATES), (STATES, 2), (STATES + 2, DELTAS));
    let blocks = LfrBlocks {
        a: part(x, x),
        b2: part(x, y),
        b1: part(x, w),
        c2: part(y, x),
        d22: part(y, y),
        d21: part(y, w),
        c1: part(w, x),
        d12: part(w, y),
        d11: part(w, w),
    };
    let lfr = Lfr::new(blocks, lfr.deltas().to_vec(), lfr.range().clone(), lfr.clock())?;
    Ok(Candidate::from_lfr(&lfr)?)
}

/// The least cost, and the rms that counts as reached.
fn goal(case: &Case) -> Result<(f64, f64), Failure> {
    let settings = RefineSettings::new()
        .tolerance(1e-9)
        .max_iterations(2000)
        .check()?;
    let account = refine(&case.start, &case.data, &settings)?.account;
    let least = account.costs.last().copied().ok_or("no cost")?;
    Ok((DONE * least, DONE.sqrt() * account.rms))
}

pub(super) fn ours() -> Result<Run, Failure> {
    let case = case()?;
    let (_, rms) = goal(&case)?;
    let settings = RefineSettings::new().target(rms).tolerance(1e-9).check()?;
    Ok(Box::new(move || {
        let refined = refine(&case.start, &case.data, &settings)?;
        Ok(refined.candidate.matrix().transpose().as_slice().to_vec())
    }))
}

pub(super) fn export(folder: &Path) -> Result<(), Failure> {
    let case = case()?;
    let (cost, _) = goal(&case)?;
    write(folder, "start", case.start.matrix().transpose().iter().copied())?;
    let free = case.start.free().transpose();
    write(folder, "free", free.iter().map(|f| f64::from(u8::from(*f))))?;
    write(folder, "positions", case.responses.iter().map(|(p, _)| p[0]))?;
    write(folder, "lines", lines())?;
    write(folder, "cost", [cost])?;
    let rows = case.responses.iter().flat_map(|(_, frf)| super::rows_of(frf));
    write(folder, "frf", rows)
}

/// The responses of a result against those without noise.
pub(super) fn error(found: &[f64]) -> Result<f64, Failure> {
    let case = case()?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let lfr = truth(&mut rng)?;
    let n = case.start.matrix().nrows();
    if found.len() != n * n {
        return Err(format!("{} numbers for a matrix of {}", found.len(), n * n).into());
    }
    let candidate = with_matrix(&lfr, &DMatrix::from_row_slice(n, n, found))?;
    let (mut all, mut truth) = (Vec::new(), Vec::new());
    for ((p, _), exact) in case.responses.iter().zip(&case.exact) {
        let frf = candidate.frozen(p)?.frequency_response(&lines())?;
        for k in 0..LINES {
            let size = exact.line(k).norm();
            all.extend(frf.line_slice(k).iter().flat_map(|v| parts(v / size)));
            truth.extend(exact.line_slice(k).iter().flat_map(|v| parts(v / size)));
        }
    }
    super::distance(&all, &truth)
}
