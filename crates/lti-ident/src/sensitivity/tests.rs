#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use super::*;
use crate::Offset;
use crate::predictor::{Predictor, Region};
use crate::problem::Problem;
use crate::search::local_directions;

/// Numbers without a pattern that a test could lean on.
fn numbers(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, k| {
        let angle = 12.9898 * (i as f64 + 1.0) + 78.233 * (k as f64 + seed);
        (43758.5453 * angle.sin()).fract()
    })
}

/// Block diagonal: poles 0.9995, 0.99 twice with one eigenvector, a pair of modulus 0.98, zero twice, -0.5, and as many
/// of them as asked for.
fn poles(n: usize) -> DMatrix<f64> {
    let mut a = DMatrix::zeros(8, 8);
    for (i, v) in [0.9995, 0.99, 0.99, 0.6, 0.6, -0.5, 0.0, 0.0]
        .into_iter()
        .enumerate()
    {
        a[(i, i)] = v;
    }
    (a[(1, 2)], a[(6, 7)]) = (0.1, 0.7);
    (a[(3, 4)], a[(4, 3)]) = (0.77, -0.77);
    a.view((0, 0), (n, n)).into_owned()
}

fn example(n: usize, nw: usize, samples: usize) -> (Problem, Point) {
    let runs = vec![Run {
        known: numbers(nw, samples, 0.1),
        outputs: numbers(3, samples, 0.4),
    }];
    let (direct, offset, region) = (1, Offset::Estimated, Region::circle(1.0));
    let problem = Problem {
        runs,
        direct,
        offset,
        region,
    };
    let q = (DMatrix::identity(n, n) + numbers(n, n, 2.0) * 0.3).qr().q();
    let mut matrix = numbers(n + 3, n + nw + 1, 3.0) * 0.4;
    matrix
        .view_mut((0, 0), (n, n))
        .copy_from(&(&q * poles(n) * q.transpose()));
    matrix.view_mut((n, n + 1), (3, nw - 1)).fill(0.0);
    matrix.view_mut((0, n + nw), (n, 1)).fill(0.0);
    let initial = vec![DVector::from_element(n, 0.5)];
    let point = problem.point(Predictor { states: n, matrix }, initial).unwrap();
    (problem, point)
}

#[test]
fn moments_give_what_simulation_gives() {
    let (estimated, held) = (InitialStates::Estimated, InitialStates::Held);
    // Three known signals and an impulse fill the lanes; four need more.
    for (n, nw, initial) in [
        (1, 2, estimated),
        (2, 3, held),
        (3, 3, estimated),
        (5, 4, estimated),
        (8, 2, held),
        (8, 5, estimated),
    ] {
        let (problem, point) = example(n, nw, 2000);
        let directions = local_directions(&problem, &point.predictor);
        let all = Sensitivities::new(&point, &directions, initial).unwrap();
        let (cascade, tangents) = all.fast.as_ref().unwrap();
        let (run, x, e) = (&problem.runs[0], &point.initial[0], &point.residuals[0]);
        let (h, g) = all.by_moments(cascade, tangents, run, x, e);
        let (h_plain, g_plain) = all.by_simulation(run, x, e);
        assert_eq!(h.shape(), h_plain.shape());
        for i in 0..h.nrows() {
            for j in 0..=i {
                let scale = (h_plain[(i, i)] * h_plain[(j, j)]).sqrt();
                let error = (h[(i, j)] - h_plain[(i, j)]).abs();
                assert!(
                    error < 1e-9 * scale,
                    "{n} states, ({i}, {j}): {error:e} of {scale:e}"
                );
            }
            let scale = (h_plain[(i, i)] * (3.0 * 2000.0)).sqrt();
            let error = (g[i] - g_plain[i]).abs();
            assert!(error < 1e-9 * scale, "{n} states, {i}: {error:e} of {scale:e}");
        }
    }
}

#[test]
fn functions_are_orthonormal_and_solve_their_equations() {
    let a = poles(8);
    let cascade = Cascade::new(&a).unwrap();
    let unit = &cascade.a * cascade.a.transpose() + &cascade.b * cascade.b.transpose();
    assert!((unit - DMatrix::identity(16, 16)).amax() < 1e-14);
    let q = numbers(8, 16, 4.0);
    let x = cascade.stein(q.clone());
    let back = &x - cascade.a.view((0, 0), (8, 8)) * &x * cascade.a.transpose();
    assert!((back - q).amax() < 1e-12 * x.amax());
    // The resolvent at z = 2.
    let at = |m: &DMatrix<f64>| {
        (DMatrix::identity(m.nrows(), m.nrows()) * 2.0 - m)
            .try_inverse()
            .unwrap()
    };
    let f = at(&cascade.a) * &cascade.b;
    let parts = cascade.resolvent(&a).unwrap();
    let sum = parts
        .iter()
        .zip(f.iter())
        .fold(DMatrix::zeros(8, 8), |sum, (z, f)| sum + z * *f);
    assert!((sum - at(&a)).amax() < 1e-10);
    for (k, products) in cascade.products().iter().enumerate() {
        let product = products * &f;
        assert!((product - f.rows(0, 8) * f[k]).amax() < 1e-10, "{k}");
    }
}
