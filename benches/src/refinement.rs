//! A refinement of an LFR on frozen responses: four modes whose couplings depend on p, and a start near the truth.

use crate::{C64, InputError};
use lfr_fit::{Candidate, FrozenData};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{DeltaBlock, Discrete, Frf, Lfr, LfrBlocks, SchedulingRange};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// States.
pub const STATES: usize = 8;
/// Repetitions of delta.
pub const DELTAS: usize = 5;
/// Positions.
pub const POSITIONS: usize = 21;
/// Lines of a position.
pub const LINES: usize = 160;
/// Noise of the responses, relative.
const NOISE: f64 = 1e-3;
/// How far the start is from the truth, entry by entry.
const AWAY: f64 = 0.02;

/// The problem.
#[derive(Debug)]
pub struct Case {
    /// Where the refinement starts.
    pub start: Candidate<Discrete>,
    /// What it is refined on.
    pub data: FrozenData,
    /// The same, with the positions.
    pub responses: Vec<(Vec<f64>, Frf)>,
    /// Responses without noise.
    pub exact: Vec<Frf>,
    truth: Lfr<Discrete>,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// The lines, Hz.
pub fn lines() -> Vec<f64> {
    (0..LINES).map(|k| (k as f64 + 0.5) / 16.0).collect()
}

/// Four modes whose couplings depend on p.
fn truth(rng: &mut ChaCha8Rng) -> Result<Lfr<Discrete>, InputError> {
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

impl Case {
    /// The problem at 21 positions, always the same.
    ///
    /// # Errors
    /// None.
    pub fn new() -> Result<Self, InputError> {
        Self::with_positions(POSITIONS)
    }

    /// The same at as many positions.
    ///
    /// # Errors
    /// None from two positions on.
    pub fn with_positions(positions: usize) -> Result<Self, InputError> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let lfr = truth(&mut rng)?;
        let (mut responses, mut exact) = (Vec::new(), Vec::new());
        for i in 0..positions {
            let p = vec![2.0 * i as f64 / (positions - 1) as f64 - 1.0];
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
        Ok(Self {
            start: with_matrix(&lfr, &matrix)?,
            data: FrozenData::relative(Discrete::from_rate(20.0)?, &responses)?,
            responses,
            exact,
            truth: lfr,
        })
    }

    /// A candidate of the same shape from its one matrix, `x, y, z` by `x, u, w`.
    ///
    /// # Errors
    /// A matrix that is not finite, or of another shape.
    pub fn candidate(&self, matrix: &DMatrix<f64>) -> Result<Candidate<Discrete>, InputError> {
        with_matrix(&self.truth, matrix)
    }
}

/// An LFR of the same shape from its one matrix, `x, y, z` by `x, u, w`.
fn with_matrix(lfr: &Lfr<Discrete>, m: &DMatrix<f64>) -> Result<Candidate<Discrete>, InputError> {
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
