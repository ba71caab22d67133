//! Models and data for the tests of the inner modules.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use crate::sampling::Sampling;
use crate::{Candidate, Channel, FrozenData};
use lpv_core::{Discrete, Frf, FrfEstimate, LfrBlocks, SchedulingRange};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn random(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
}

pub(crate) fn clock() -> Discrete {
    Discrete::new(0.5).unwrap()
}

/// Three states, two inputs and outputs, on p in [1, 3]; `poles` on the diagonal of A make it stable.
pub(crate) fn candidate<K: Sampling>(
    clock: K,
    poles: [f64; 3],
    channels: &[Channel],
    seed: u64,
) -> Candidate<K> {
    let (mut rng, nc) = (rng(seed), channels.len());
    let blocks = LfrBlocks {
        a: DMatrix::from_diagonal(&DVector::from_row_slice(&poles)) + random(3, 3, &mut rng) * 0.1,
        b1: random(3, nc, &mut rng) * 0.2,
        b2: random(3, 2, &mut rng),
        c1: random(nc, 3, &mut rng) * 0.5,
        d11: random(nc, nc, &mut rng) * 0.2,
        d12: random(nc, 2, &mut rng),
        c2: random(2, 3, &mut rng),
        d21: random(2, nc, &mut rng) * 0.2,
        d22: random(2, 2, &mut rng) * 0.1,
    };
    let in_d22 = |i: usize, j: usize| (3..5).contains(&i) && (3..5).contains(&j);
    let free = DMatrix::from_fn(5 + nc, 5 + nc, |i, j| !in_d22(i, j));
    let range = SchedulingRange::interval(1.0, 3.0).unwrap();
    Candidate::new(&blocks, free, channels.to_vec(), range, clock).unwrap()
}

/// Responses of a candidate at five positions, on lines up to Nyquist.
pub(crate) fn responses<K: Sampling>(candidate: &Candidate<K>, lines: usize) -> Vec<(Vec<f64>, Frf)> {
    let frequencies_hz: Vec<f64> = (0..lines).map(|k| (k as f64 + 0.5) / lines as f64).collect();
    let at = |p: f64| {
        let frozen = candidate.frozen(&[p]).unwrap();
        let s =
            lpv_core::linalg::from_blocks(&[&[frozen.a(), frozen.b()], &[frozen.c(), frozen.d()]]).unwrap();
        let sampled = crate::sampling::hold::Hold::sample(
            frozen.clock(),
            &s,
            3,
            clock(),
            crate::sampling::hold::Derivative::Skip,
        );
        let s = sampled.unwrap().s;
        let part = |at, size| s.view(at, size).into_owned();
        let system = lpv_core::StateSpace::new(
            part((0, 0), (3, 3)),
            part((0, 3), (3, 2)),
            part((3, 0), (2, 3)),
            part((3, 3), (2, 2)),
            clock(),
        );
        (
            vec![p],
            system.unwrap().frequency_response(&frequencies_hz).unwrap(),
        )
    };
    [1.0, 1.4, 2.1, 2.6, 3.0].map(at).to_vec()
}

/// The responses with a covariance that is neither diagonal nor constant, and as an estimate with errors of `noise`
/// standard deviations.
pub(crate) fn estimates(
    responses: &[(Vec<f64>, Frf)],
    noise: f64,
    seed: u64,
) -> Vec<(Vec<f64>, FrfEstimate)> {
    let mut rng = rng(seed);
    let mut complex = |n: usize| {
        DMatrix::from_fn(n, n, |_, _| {
            Complex::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
        })
    };
    let one = |(p, frf): &(Vec<f64>, Frf)| {
        let (mut c, mut s) = (Vec::new(), Vec::new());
        let mut frf = frf.clone();
        for k in 0..frf.len() {
            let positive =
                |m: DMatrix<Complex<f64>>| &m * m.adjoint() + DMatrix::identity(2, 2) * Complex::from(0.1);
            c.extend(positive(complex(2)).iter().copied());
            s.extend(positive(complex(2)).iter().copied());
            let error = complex(2) * Complex::from(noise);
            frf.line_slice_mut(k)
                .iter_mut()
                .zip(error.iter())
                .for_each(|(v, e)| *v += e);
        }
        (
            p.clone(),
            FrfEstimate::new(frf, c, s, f64::INFINITY, None).unwrap(),
        )
    };
    responses.iter().map(one).collect()
}

pub(crate) fn weighted(responses: &[(Vec<f64>, Frf)], noise: f64, seed: u64) -> FrozenData {
    FrozenData::weighted(clock(), &estimates(responses, noise, seed), 0.0).unwrap()
}
