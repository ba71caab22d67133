#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use super::*;
use crate::search::{Bounds, local_directions, moved};

/// Numbers without a pattern that a test could lean on.
fn numbers(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, k| {
        let angle = 12.9898 * (i as f64 + 1.0) + 78.233 * (k as f64 + seed);
        (43758.5453 * angle.sin()).fract()
    })
}

fn example() -> (Problem, Point) {
    let run = |samples: usize, seed: f64| Run {
        known: numbers(2, samples, seed),
        outputs: numbers(3, samples, seed + 0.3),
    };
    let runs = vec![run(100, 0.1), run(70, 0.7)];
    let problem = Problem {
        runs,
        direct: 1,
        offset: Offset::Estimated,
        region: Region::circle(1.0),
    };
    let n = 4;
    let mut matrix = numbers(n + 3, n + 3, 3.0) * 0.4;
    matrix.view_mut((n, n + 1), (3, 1)).fill(0.0);
    matrix.view_mut((0, n + 2), (n, 1)).fill(0.0);
    let initial = vec![DVector::from_element(n, 0.5), DVector::from_element(n, -0.2)];
    let point = problem.point(Predictor { states: n, matrix }, initial).unwrap();
    (problem, point)
}

#[test]
fn gradients_agree_with_central_differences() {
    let (problem, point) = example();
    let directions = local_directions(&problem, &point.predictor);
    let equations = Equations::new(&problem, &point, &directions, InitialStates::Estimated).unwrap();
    let n = point.predictor.states;
    let cost_at = |coefficients: DVector<f64>, initial: Vec<DVector<f64>>| {
        let step = Step {
            coefficients,
            initial,
        };
        moved(&problem, &point, &directions, &step, Bounds::Refused)
            .unwrap()
            .cost
    };
    let still = || vec![DVector::zeros(n); 2];
    let h = 1e-5;
    // d ln det / d theta = -2 / N times J' r, whitened.
    let scale = -2.0 / problem.samples() as f64;
    for j in 0..directions.ncols() {
        let unit = |h: f64| DVector::from_fn(directions.ncols(), |i, _| if i == j { h } else { 0.0 });
        let slope = (cost_at(unit(h), still()) - cost_at(unit(-h), still())) / (2.0 * h);
        let exact = scale * equations.gradient[j];
        assert!(
            (slope - exact).abs() < 1e-7 * (1.0 + exact.abs()),
            "direction {j}: {slope} {exact}"
        );
    }
    for (r, run) in equations.runs.iter().enumerate() {
        for j in 0..n {
            let unit = |h: f64| {
                let mut initial = still();
                initial[r][j] = h;
                cost_at(DVector::zeros(directions.ncols()), initial)
            };
            let (slope, exact) = ((unit(h) - unit(-h)) / (2.0 * h), scale * run.gradient[j]);
            assert!(
                (slope - exact).abs() < 1e-7 * (1.0 + exact.abs()),
                "run {r}, state {j}: {slope} {exact}"
            );
        }
    }
}

#[test]
fn local_directions_are_orthonormal_and_leave_the_similarity_orbit_out() {
    let (problem, point) = example();
    let (p, n) = (&point.predictor, point.predictor.states);
    let directions = local_directions(&problem, p);
    // n (n_w + n_y), the free entries of D, and d.
    assert_eq!(directions.ncols(), n * (2 + 3) + 3 + 3);
    let gram = directions.tr_mul(&directions);
    assert!((gram - DMatrix::identity(directions.ncols(), directions.ncols())).amax() < 1e-12);
    let t = numbers(n, n, 5.0);
    let mut tangent = DMatrix::zeros(n + 3, n + 3);
    tangent
        .view_mut((0, 0), (n, n))
        .copy_from(&(&t * p.a() - p.a() * &t));
    tangent.view_mut((0, n), (n, 2)).copy_from(&(&t * p.b()));
    tangent.view_mut((n, 0), (3, n)).copy_from(&-(p.c() * &t));
    let along = directions.tr_mul(&DVector::from_column_slice(tangent.as_slice()));
    assert!(along.amax() < 1e-12);
}

#[test]
fn a_step_without_damping_solves_what_is_linear() {
    let (mut problem, point) = example();
    // Outputs of the filter itself with another B, D and other initial states.
    let n = point.predictor.states;
    let mut truth = point.predictor.clone();
    truth
        .matrix
        .view_mut((0, n), (n, 2))
        .copy_from(&numbers(n, 2, 9.0));
    truth
        .matrix
        .view_mut((n, n), (3, 1))
        .copy_from(&numbers(3, 1, 8.0));
    truth
        .matrix
        .view_mut((n, n + 2), (3, 1))
        .copy_from(&numbers(3, 1, 7.0));
    let states = [DVector::from_element(n, 2.0), DVector::from_element(n, 3.0)];
    for (run, x) in problem.runs.iter_mut().zip(&states) {
        run.outputs = truth.simulate(x, &run.known).0;
    }
    let found = crate::start::polished(&problem, &point.predictor).unwrap();
    assert!((&found.predictor.matrix - &truth.matrix).amax() < 1e-6);
    assert!((&found.initial[1] - &states[1]).amax() < 1e-6);
}

#[test]
fn balancing_and_reflection_keep_what_they_promise() {
    let (problem, point) = example();
    let (balanced, initial) = point.predictor.balanced(&point.initial).unwrap();
    let moved = problem.point(balanced.clone(), initial).unwrap();
    assert!((moved.cost - point.cost).abs() < 1e-10);
    let (a, b) = (balanced.a().into_owned(), balanced.b().into_owned());
    let gramian = lpv_core::linalg::discrete_gramian(&a, &b).unwrap();
    for i in 0..gramian.nrows() {
        for j in 0..i {
            assert!(gramian[(i, j)].abs() < 1e-10 * gramian.amax());
        }
    }
    // Eigenvalues 2 and 0.5 +- 1.2 i (modulus 1.3) go to 1 / 2 and 1 / 1.3; 0.3 stays.
    let blocks = [
        2.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.2, 0.0, 0.0, -1.2, 0.5, 0.0, 0.0, 0.0, 0.0, 0.3,
    ];
    let m = DMatrix::from_row_slice(4, 4, &blocks);
    let q = (DMatrix::identity(4, 4) + numbers(4, 4, 2.0) * 0.3).qr().q();
    let inside = crate::predictor::reflected(&(&q * m * q.transpose()), Region::circle(0.99)).unwrap();
    let mut radii: Vec<f64> = lpv_core::linalg::eigenvalues(&inside)
        .unwrap()
        .iter()
        .map(|z| z.norm())
        .collect();
    radii.sort_by(f64::total_cmp);
    for (found, expected) in radii.iter().zip([0.3, 0.5, 1.0 / 1.3, 1.0 / 1.3]) {
        assert!((found - expected).abs() < 1e-10, "{radii:?}");
    }
}

#[test]
fn predictions_in_chunks_are_those_of_one_sample_after_the_other() {
    let (_, point) = example();
    for samples in [1, 63, 64, 65, 1000, 5000] {
        let w = numbers(2, samples, 0.2);
        let (plain, _) = point.predictor.simulate(&point.initial[0], &w);
        let fast = point.predictor.predictions(&point.initial[0], &w);
        assert!(
            (&fast - &plain).amax() < 1e-12 * plain.amax(),
            "{samples} samples"
        );
    }
}
