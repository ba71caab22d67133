//! The exact LFR of an LPV state space: identities between the two, and cases by hand.

use lfr_realize::exact_lfr;
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{
    BasisKind, Continuous, Discrete, FunctionBasis, LpvStateSpace, MatrixFunction, SchedulingRange,
    StateSpace, WellPosedness,
};
use proptest::prelude::*;

fn matrix(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    // A small linear congruence: tests need variety, not quality.
    let mut state = seed
        .wrapping_mul(6364136223846793005)
        .wrapping_add(1442695040888963407);
    DMatrix::from_fn(rows, columns, |_, _| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as f64 / (1_u64 << 31) as f64 * 2.0 - 1.0
    })
}

fn polynomial_model(degree: usize, range: [f64; 2], seed: u64) -> LpvStateSpace<Discrete> {
    let part = |rows, columns, s| {
        MatrixFunction::polynomial(
            (0..=degree)
                .map(|k| matrix(rows, columns, seed + 100 * s as u64 + k as u64) * 0.3)
                .collect(),
        )
        .unwrap()
    };
    LpvStateSpace::new(
        part(3, 3, 1),
        part(3, 2, 2),
        part(2, 3, 3),
        part(2, 2, 4),
        SchedulingRange::interval(range[0], range[1]).unwrap(),
        Discrete::new(0.05).unwrap(),
    )
    .unwrap()
}

fn distance(a: &StateSpace<Discrete>, b: &StateSpace<Discrete>) -> f64 {
    [(a.a(), b.a()), (a.b(), b.b()), (a.c(), b.c()), (a.d(), b.d())]
        .iter()
        .map(|(x, y)| (*x - *y).norm())
        .sum()
}

#[test]
fn the_smallest_lfr_of_a_known_polynomial() {
    // y = (1 + 2 p + 3 p^2) u needs two deltas.
    let c = |v: f64| DMatrix::from_element(1, 1, v);
    let empty = |r, k| MatrixFunction::constant(DMatrix::zeros(r, k)).unwrap();
    let model = LpvStateSpace::new(
        empty(0, 0),
        empty(0, 1),
        empty(1, 0),
        MatrixFunction::polynomial(vec![c(1.0), c(2.0), c(3.0)]).unwrap(),
        SchedulingRange::interval(-0.5, 2.0).unwrap(),
        Discrete::new(1.0).unwrap(),
    )
    .unwrap();
    let lfr = exact_lfr(&model).unwrap();
    assert_eq!(lfr.delta_count(), 2);
    for p in [-0.5, 0.0, 0.7, 2.0] {
        assert!((lfr.frozen(&[p]).unwrap().d()[(0, 0)] - (1.0 + 2.0 * p + 3.0 * p * p)).abs() < 1e-13);
    }
}

#[test]
fn two_parameters_realised_by_horner() {
    let basis = FunctionBasis::new(BasisKind::Monomials {
        exponents: vec![vec![0, 0], vec![1, 0], vec![1, 1], vec![0, 2], vec![2, 1]],
    })
    .unwrap();
    let part = |r, c, s| {
        MatrixFunction::new(
            basis.clone(),
            (0..5_u64).map(|k| matrix(r, c, s + k) * 0.2).collect(),
        )
        .unwrap()
    };
    let range = SchedulingRange::new(vec![[-1.0, 0.5], [2.0, 3.0]]).unwrap();
    let model = LpvStateSpace::new(
        part(2, 2, 1),
        part(2, 1, 20),
        part(1, 2, 40),
        part(1, 1, 60),
        range.clone(),
        Continuous,
    )
    .unwrap();
    let lfr = exact_lfr(&model).unwrap();
    for p in range.grid(4) {
        let (x, y) = (model.frozen(&p).unwrap(), lfr.frozen(&p).unwrap());
        assert!(
            (x.a() - y.a()).norm() + (x.b() - y.b()).norm() + (x.c() - y.c()).norm() + (x.d() - y.d()).norm()
                < 1e-12
        );
    }
    assert!(matches!(
        lfr.well_posedness().unwrap(),
        WellPosedness::Proven { .. } | WellPosedness::Sampled { .. }
    ));
}

#[test]
fn a_high_degree_chain_is_proven_well_posed() {
    // D11 of a Clenshaw chain is nilpotent; computed eigenvalues of the full matrix are of size eps^(1/n), which
    // passes 1 for long chains.
    for degree in [17, 60, 120] {
        let coefficients: Vec<f64> = (0..=degree).map(|k| 1.0 / (1.0 + k as f64)).collect();
        let kind = BasisKind::Chebyshev {
            degree,
            range: SchedulingRange::interval(-1.0, 1.0).unwrap(),
        };
        let d = MatrixFunction::new(
            FunctionBasis::new(kind).unwrap(),
            coefficients.iter().map(|&v| dmatrix![v]).collect(),
        )
        .unwrap();
        let none = |r, c| MatrixFunction::constant(DMatrix::zeros(r, c)).unwrap();
        let model = LpvStateSpace::new(
            none(0, 0),
            none(0, 1),
            none(1, 0),
            d,
            SchedulingRange::interval(-1.0, 1.0).unwrap(),
            Discrete::new(1.0).unwrap(),
        )
        .unwrap();
        let lfr = exact_lfr(&model).unwrap();
        assert_eq!(lfr.delta_count(), degree);
        assert_eq!(
            lfr.well_posedness().unwrap(),
            WellPosedness::Proven { margin: 1.0 }
        );
    }
}

/// A stiff spring along p: the error falls with the fourth power of the sample time, towards the adaptive
/// integration of the same model in state-space form.
#[test]
fn fourth_order_against_the_runge_kutta_reference() {
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let a = MatrixFunction::polynomial(vec![
        dmatrix![0.0, 1.0; -9.0, -0.1],
        dmatrix![0.1, 0.0; -3.0, 0.0],
    ])
    .unwrap();
    let b =
        MatrixFunction::polynomial(vec![dmatrix![0.0; 1.0], dmatrix![0.0; 0.5], dmatrix![0.2; 0.1]]).unwrap();
    let c = MatrixFunction::polynomial(vec![dmatrix![1.0, 0.0], dmatrix![0.2, 0.0]]).unwrap();
    let d = MatrixFunction::constant(dmatrix![0.0]).unwrap();
    let model = LpvStateSpace::new(a, b, c, d, range, Continuous).unwrap();
    let lfr = exact_lfr(&model).unwrap();
    let error = |factor: usize| {
        // Inputs are held over the long interval, whatever the samples are.
        let n = 40 * factor;
        let clock = Discrete::new(0.2 / factor as f64).unwrap();
        let u = DMatrix::from_fn(1, n, |_, k| if (k / factor) % 7 < 3 { 1.0 } else { -0.5 });
        let p = DMatrix::from_fn(1, n, |_, k| (1.3 * clock.sample_time() * k as f64).sin());
        let x0 = DVector::from_row_slice(&[0.3, -0.2]);
        let own = lfr.simulate_held(&x0, &u, &p, clock).unwrap();
        let fine = 64 / factor;
        let clock_fine = Discrete::new(0.2 / 64.0).unwrap();
        let u_fine = DMatrix::from_fn(1, 40 * 64, |_, k| u[k / fine]);
        let p_fine = DMatrix::from_fn(1, 40 * 64, |_, k| {
            (1.3 * clock_fine.sample_time() * k as f64).sin()
        });
        let truth = model
            .simulate_held(&x0, &u_fine, &p_fine, clock_fine, 1e-11)
            .unwrap();
        (0..n - 1)
            .map(|k| (own.outputs[k] - truth.outputs[k * fine]).abs())
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(1), error(2));
    assert!(coarse < 2e-4, "{coarse}");
    assert!(coarse / fine > 10.0, "{coarse} {fine}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn polynomial_models_survive_the_way_to_lfr_and_back(
        degree in 0_usize..5, lower in -2.0..1.0_f64, width in 0.1..3.0_f64, seed in 0_u64..1000, t in 0.0..1.0_f64,
    ) {
        let model = polynomial_model(degree, [lower, lower + width], seed);
        let p = [lower + t * width];
        let lfr = exact_lfr(&model).unwrap();
        let scale = 1.0 + model.frozen(&p).unwrap().a().norm();
        prop_assert!(distance(&model.frozen(&p).unwrap(), &lfr.frozen(&p).unwrap()) < 1e-10 * scale);
        prop_assert!(lfr.delta_count() <= 5 * degree);
        let posed = matches!(lfr.well_posedness().unwrap(), WellPosedness::Proven { .. });
        prop_assert!(posed);
        let back = lfr.to_state_space().unwrap();
        prop_assert!(distance(&model.frozen(&p).unwrap(), &back.frozen(&p).unwrap()) < 1e-9 * scale);
    }

    #[test]
    fn lfr_and_state_space_simulate_alike(seed in 0_u64..1000) {
        let model = polynomial_model(2, [-0.3, 0.3], seed);
        let lfr = exact_lfr(&model).unwrap();
        let u = matrix(2, 30, seed);
        let p = matrix(1, 30, seed + 1) * 0.3;
        let x0 = DVector::zeros(3);
        let y = model.simulate(&x0, &u, &p).unwrap().outputs;
        prop_assert!((lfr.simulate(&x0, &u, &p).unwrap().outputs - &y).amax() < 1e-10 * (1.0 + y.amax()));
    }

    #[test]
    fn lfr_series_and_parallel_are_those_of_the_frozen_systems(seed in 0_u64..1000, t in -1.0..1.0_f64) {
        let (f, g) = (polynomial_model(1, [-1.0, 1.0], seed), polynomial_model(2, [-1.0, 1.0], seed + 5));
        let (lf, lg) = (exact_lfr(&f).unwrap(), exact_lfr(&g).unwrap());
        let (sf, sg) = (f.frozen(&[t]).unwrap(), g.frozen(&[t]).unwrap());
        let series = lf.then(&lg).unwrap().frozen(&[t]).unwrap();
        let parallel = lf.plus(&lg).unwrap().frozen(&[t]).unwrap();
        prop_assert!(distance(&series, &sf.then(&sg).unwrap()) < 1e-10);
        prop_assert!(distance(&parallel, &sf.plus(&sg).unwrap()) < 1e-10);
    }

    #[test]
    fn wild_numbers_never_panic(values in proptest::collection::vec(prop_oneof![any::<f64>(), -2.0..2.0_f64], 4..20), n in 0_usize..3) {
        let take = |r: usize, c: usize| DMatrix::from_iterator(r, c, values.iter().copied().cycle().take(r * c));
        let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
        let f = |r, c| MatrixFunction::polynomial(vec![take(r, c), take(r, c)]);
        if let (Ok(a), Ok(b), Ok(c), Ok(d)) = (f(n, n), f(n, 1), f(2, n), f(2, 1)) {
            let model = LpvStateSpace::new(a, b, c, d, range, Discrete::new(1.0).unwrap()).unwrap();
            if let Ok(lfr) = exact_lfr(&model) {
                let _ = lfr.well_posedness();
                let _ = lfr.to_state_space();
                let _ = lfr.tabulate(3);
            }
        }
    }
}
