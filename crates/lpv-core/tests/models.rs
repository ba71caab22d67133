//! Identities that tie the representations together, cases by hand, and wild inputs.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{
    BasisKind, Clock, Continuous, CoreError, Discrete, Frf, FunctionBasis, Lfr, LpvStateSpace,
    MatrixFunction, Model, SchedulingRange, SeriesExpansion, StateSpace, WellPosedness,
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

#[test]
fn zero_order_hold_of_a_double_integrator_by_hand() {
    let plant = StateSpace::new(
        dmatrix![0.0, 1.0; 0.0, 0.0],
        dmatrix![0.0; 1.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        Continuous,
    )
    .unwrap();
    let t = 0.05;
    let sampled = plant.zero_order_hold(Discrete::new(t).unwrap()).unwrap();
    assert!((sampled.a() - dmatrix![1.0, t; 0.0, 1.0]).norm() < 1e-15);
    assert!((sampled.b() - dmatrix![0.5 * t * t; t]).norm() < 1e-15);
    // The response is (T^2 / 2) (z + 1) / (z - 1)^2, equation (12).
    let z = sampled.clock().point(1.3);
    let expected = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (0.5 * t * t);
    let found = sampled.frequency_response(&[1.3]).unwrap().line(0)[(0, 0)];
    assert!((found - expected).norm() < 1e-13 * expected.norm());
}

#[test]
fn tustin_maps_the_imaginary_axis_to_the_unit_circle() {
    let plant = StateSpace::new(
        matrix(4, 4, 1),
        matrix(4, 2, 2),
        matrix(3, 4, 3),
        matrix(3, 2, 4),
        Continuous,
    )
    .unwrap();
    let clock = Discrete::new(0.1).unwrap();
    let sampled = plant.tustin(clock).unwrap();
    let f = 1.7;
    let warped = (std::f64::consts::PI * f * 0.1).tan() / (std::f64::consts::PI * 0.1);
    let error = sampled.frequency_response(&[f]).unwrap().line(0)
        - plant.frequency_response(&[warped]).unwrap().line(0);
    assert!(error.norm() < 1e-12, "{error}");
}

#[test]
fn schur_response_is_the_dense_one() {
    for n in [0, 1, 2, 5, 12] {
        let s = StateSpace::new(
            matrix(n, n, 1),
            matrix(n, 2, 2),
            matrix(3, n, 3),
            matrix(3, 2, 4),
            Discrete::new(1.0).unwrap(),
        )
        .unwrap();
        let f = s.frequency_response(&[0.0, 0.1, 0.3, 0.5]).unwrap();
        for (k, &hz) in f.frequencies_hz().iter().enumerate() {
            let z = s.clock().point(hz);
            let pencil = DMatrix::<Complex<f64>>::identity(n, n) * z - s.a().map(Complex::from);
            let state = if n == 0 {
                DMatrix::zeros(0, 2)
            } else {
                pencil.lu().solve(&s.b().map(Complex::from)).unwrap()
            };
            let dense = s.c().map(Complex::from) * state + s.d().map(Complex::from);
            assert!((f.line(k) - dense).norm() < 1e-11);
        }
    }
}

#[test]
fn a_pole_on_a_line_is_named() {
    let integrator = StateSpace::new(
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![1.0],
        dmatrix![0.0],
        Discrete::new(1.0).unwrap(),
    )
    .unwrap();
    let refused = integrator.frequency_response(&[0.0, 0.1]).unwrap_err();
    assert_eq!(refused, CoreError::PoleOnLine { frequency_hz: 0.0 });
}

#[test]
fn series_and_parallel_responses_multiply_and_add() {
    let clock = Discrete::new(1.0).unwrap();
    let f = StateSpace::new(
        matrix(3, 3, 1) * 0.5,
        matrix(3, 2, 2),
        matrix(2, 3, 3),
        matrix(2, 2, 4),
        clock,
    )
    .unwrap();
    let g = StateSpace::new(
        matrix(2, 2, 5) * 0.5,
        matrix(2, 2, 6),
        matrix(2, 2, 7),
        matrix(2, 2, 8),
        clock,
    )
    .unwrap();
    let at = |s: &StateSpace<Discrete>| s.frequency_response(&[0.2]).unwrap().line(0).into_owned();
    assert!((at(&f.then(&g).unwrap()) - at(&g) * at(&f)).norm() < 1e-12);
    assert!((at(&f.plus(&g).unwrap()) - at(&g) - at(&f)).norm() < 1e-12);
}

#[test]
fn ill_posed_at_a_known_position() {
    // y = u / (1 - 2 delta), delta = p on [-1, 1]: singular at p = 0.5.
    let one = dmatrix![1.0];
    let none = |r, c| DMatrix::zeros(r, c);
    let blocks = lpv_core::LfrBlocks {
        a: none(0, 0),
        b1: none(0, 1),
        b2: none(0, 1),
        c1: none(1, 0),
        d11: dmatrix![2.0],
        d12: one.clone(),
        c2: none(1, 0),
        d21: dmatrix![2.0],
        d22: one,
    };
    let delta = lpv_core::DeltaBlock {
        parameter: 0,
        repetitions: 1,
    };
    let lfr = Lfr::new(
        blocks,
        vec![delta],
        SchedulingRange::interval(-1.0, 1.0).unwrap(),
        Discrete::new(1.0).unwrap(),
    )
    .unwrap();
    assert_eq!(
        lfr.well_posedness().unwrap(),
        WellPosedness::Fails { p: vec![0.5] }
    );
    assert_eq!(
        lfr.frozen(&[0.5]).unwrap_err(),
        CoreError::IllPosed { p: vec![0.5] }
    );
    assert!((lfr.frozen(&[0.25]).unwrap().d()[(0, 0)] - 2.0).abs() < 1e-14);
    assert_eq!(lfr.to_state_space().unwrap_err(), CoreError::NotPolynomial);
}

#[test]
fn spline_reproduces_cubics_and_passes_its_knots() {
    let knots = vec![-1.0, -0.2, 0.1, 0.9, 1.5, 2.0];
    let basis = FunctionBasis::new(BasisKind::Spline { knots: knots.clone() }).unwrap();
    let cubic = |x: f64| 1.0 - x + 0.5 * x * x - 2.0 * x * x * x;
    for x in [-1.0, -0.7, 0.0, 0.5, 1.2, 2.0] {
        let value: f64 = basis
            .evaluate(&[x])
            .iter()
            .zip(&knots)
            .map(|(w, &k)| w * cubic(k))
            .sum();
        assert!((value - cubic(x)).abs() < 1e-12);
    }
    for (n, degree) in [(2, 1), (3, 2)] {
        let knots: Vec<f64> = (0..n).map(|k| k as f64 * 0.7).collect();
        let basis = FunctionBasis::new(BasisKind::Spline { knots: knots.clone() }).unwrap();
        let value: f64 = basis
            .evaluate(&[0.3])
            .iter()
            .zip(&knots)
            .map(|(w, k)| w * k.powi(degree))
            .sum();
        assert!((value - 0.3_f64.powi(degree)).abs() < 1e-14);
    }
}

#[test]
fn series_expansion_has_the_response_of_its_state_space() {
    let clock = Discrete::new(1.0).unwrap();
    let range = SchedulingRange::interval(0.0, 1.0).unwrap();
    let rigid = StateSpace::new(
        matrix(2, 2, 1) * 0.4,
        matrix(2, 2, 2),
        matrix(2, 2, 3),
        DMatrix::zeros(2, 2),
        clock,
    )
    .unwrap();
    let basis = StateSpace::new(
        matrix(3, 3, 4) * 0.4,
        matrix(3, 1, 5),
        DMatrix::identity(3, 3),
        DMatrix::zeros(3, 1),
        clock,
    )
    .unwrap();
    let weights = MatrixFunction::polynomial(vec![matrix(2, 6, 6), matrix(2, 6, 7)]).unwrap();
    let direct = MatrixFunction::constant(matrix(2, 2, 8)).unwrap();
    let series = SeriesExpansion::new(
        rigid.clone(),
        basis.clone(),
        direct.clone(),
        weights.clone(),
        range,
    )
    .unwrap();
    let model = series.to_state_space().unwrap();
    assert_eq!(model.states(), 2 + 2 * 3);
    let p = [0.3];
    let found = model
        .frozen(&p)
        .unwrap()
        .frequency_response(&[0.15])
        .unwrap()
        .line(0)
        .into_owned();
    let phi = basis.frequency_response(&[0.15]).unwrap();
    let w = weights.evaluate(&p);
    let mut expected = rigid.frequency_response(&[0.15]).unwrap().line(0).into_owned()
        + direct.evaluate(&p).map(Complex::from);
    for i in 0..3 {
        expected += w.columns(2 * i, 2).map(Complex::from) * phi.line(0)[(i, 0)];
    }
    assert!((found - expected).norm() < 1e-12);
}

#[test]
fn moving_p_of_a_continuous_model_against_the_sampled_one() {
    // With constant p the integrator must give the exact zero-order-hold response.
    let part = |r, c, s| MatrixFunction::polynomial(vec![matrix(r, c, s), matrix(r, c, s + 1)]).unwrap();
    let model = LpvStateSpace::new(
        part(3, 3, 1),
        part(3, 1, 10),
        part(1, 3, 20),
        part(1, 1, 30),
        SchedulingRange::interval(-1.0, 1.0).unwrap(),
        Continuous,
    )
    .unwrap();
    let clock = Discrete::new(0.1).unwrap();
    let u = matrix(1, 40, 50);
    let p = DMatrix::from_element(1, 40, 0.4);
    let x0 = DVector::zeros(3);
    let moving = model.simulate_held(&x0, &u, &p, clock, 1e-11).unwrap();
    let exact = model
        .frozen(&[0.4])
        .unwrap()
        .zero_order_hold(clock)
        .unwrap()
        .simulate(&x0, &u)
        .unwrap();
    assert!((moving.outputs - &exact.outputs).amax() < 1e-9 * exact.outputs.amax());
}

#[test]
fn json_round_trip_is_exact_and_names_errors() {
    let model = polynomial_model(2, [-0.3, 0.3], 7);
    let lfr = static_lfr(dmatrix![0.5], &[0], SchedulingRange::interval(-0.3, 0.3).unwrap());
    for m in [
        Model::DiscreteLpv(model.clone()),
        Model::DiscreteLfr(lfr),
        Model::DiscreteStateSpace(model.frozen(&[0.1]).unwrap()),
    ] {
        let text = m.to_json().unwrap();
        assert_eq!(Model::from_json(&text).unwrap(), m);
    }
    let text = Model::DiscreteLpv(model).to_json().unwrap();
    let other = text.replacen("\"version\": 1", "\"version\": 9", 1);
    assert!(matches!(
        Model::from_json(&other),
        Err(CoreError::Schema { version: 9, .. })
    ));
    let broken = text.replacen("\"shape\"", "\"shap\"", 1);
    let message = Model::from_json(&broken).unwrap_err().to_string();
    assert!(message.contains("line") && message.contains("shap"), "{message}");
}

#[test]
fn eigenvalues_of_a_badly_scaled_matrix() {
    // diag(1, 2, 3) hidden behind a scaling over eight decades.
    let d = DMatrix::from_diagonal(&DVector::from_vec(vec![1e-4, 1.0, 1e4]));
    let t = dmatrix![1.0, 0.5, 0.2; 0.1, 1.0, 0.3; 0.4, 0.2, 1.0];
    let core = &t
        * DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 2.0, 3.0]))
        * t.clone().try_inverse().unwrap();
    let hidden = &d * core * d.clone().try_inverse().unwrap();
    for (found, expected) in lpv_core::linalg::eigenvalues(&hidden)
        .unwrap()
        .iter()
        .zip([1.0, 2.0, 3.0])
    {
        assert!(
            (found.re - expected).abs() < 1e-10 && found.im.abs() < 1e-10,
            "{found}"
        );
    }
}

/// Rings, whose eigenvalues are the roots of one, that feed a chain, whose eigenvalues are zero, all states in disorder.
#[test]
fn eigenvalues_of_rings_that_feed_a_chain() {
    let (rings, n) = ([0..3, 3..8], 14);
    let place = |i: usize| (5 * i + 3) % n;
    let mut a = DMatrix::zeros(n, n);
    let mut expected = vec![num_complex::Complex::new(0.0, 0.0); n - 8];
    for ring in rings {
        for i in ring.clone() {
            let next = if i + 1 < ring.end { i + 1 } else { ring.start };
            a[(place(next), place(i))] = 1.0;
            let turn = std::f64::consts::TAU * (i - ring.start) as f64 / ring.len() as f64;
            expected.push(num_complex::Complex::cis(turn));
        }
        a[(place(8), place(ring.start))] = 1e6;
    }
    for i in 9..n {
        a[(place(i), place(i - 1))] = 1e3;
    }
    let found = lpv_core::linalg::eigenvalues(&a).unwrap();
    assert_eq!(found.len(), n);
    assert_eq!(found.iter().filter(|l| l.norm() == 0.0).count(), n - 8);
    for l in expected {
        assert!(
            found.iter().any(|f| (f - l).norm() < 1e-13),
            "{l} not in {found:?}"
        );
    }
}

/// Nearly triangular matrices whose scales balancing takes apart, and those whose eigenvalues are the same many times over.
#[test]
fn eigenvalues_of_fill_and_of_equal_ones_are_found() {
    for e in [1e-17, 1e-30, 1e-40, 1e-200] {
        let a = dmatrix![0.3, -0.3, -0.3, 0.1; -e, 0.4, -0.3, 0.2; e, 2.0 * e, 0.3, -0.2; e, -e, e, 0.3];
        let found = lpv_core::linalg::eigenvalues(&a).unwrap();
        let sum: f64 = found.iter().map(|l| l.re).sum();
        assert!((sum - 1.3).abs() < 1e-14, "{e}: {found:?}");
    }
    for n in [16, 22, 23, 40, 44, 60] {
        let a = DMatrix::identity(n, n) - DMatrix::from_element(n, n, 2.0 / n as f64);
        let found = lpv_core::linalg::eigenvalues(&a).unwrap();
        assert!((found[0] + 1.0).norm() < 1e-12, "{n}: {}", found[0]);
        assert!(found[1..].iter().all(|l| (l - 1.0).norm() < 1e-12), "{n}");
    }
    // A large coupling and a small one, whose product alone counts.
    let found = lpv_core::linalg::eigenvalues(&dmatrix![0.0, 1e200; 1e-200, 0.0]).unwrap();
    assert!((found[0] + 1.0).norm() < 1e-14 && (found[1] - 1.0).norm() < 1e-14);
}

#[test]
fn gramian_solves_its_equation() {
    let (a, b) = (matrix(5, 5, 3) * 0.35, matrix(5, 2, 4));
    let x = lpv_core::linalg::discrete_gramian(&a, &b).unwrap();
    assert!((&a * &x * a.transpose() + &b * b.transpose() - &x).norm() < 1e-12 * x.norm());
    assert!(matches!(
        lpv_core::linalg::discrete_gramian(&DMatrix::identity(2, 2), &matrix(2, 1, 1)),
        Err(CoreError::Unstable { .. })
    ));
}

#[test]
fn relative_error_counts_the_matrix_as_one() {
    let c = |v: [f64; 2]| v.map(Complex::from).to_vec();
    let truth = Frf::new(vec![1.0], 2, 1, c([3.0, 4.0])).unwrap();
    let other = Frf::new(vec![1.0], 2, 1, c([3.0, 4.5])).unwrap();
    assert!((other.relative_error(&truth).unwrap()[0] - 0.1).abs() < 1e-15);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn wild_numbers_never_panic(values in proptest::collection::vec(prop_oneof![any::<f64>(), -2.0..2.0_f64], 4..20), n in 0_usize..3, p in any::<f64>()) {
        let take = |r: usize, c: usize| DMatrix::from_iterator(r, c, values.iter().copied().cycle().take(r * c));
        let _ = Discrete::new(values[0]);
        let _ = SchedulingRange::interval(values[0], values[1]);
        let _ = FunctionBasis::new(BasisKind::Spline { knots: values.clone() });
        let _ = FunctionBasis::new(BasisKind::Matern { knots: values.clone(), length_scale: values[0] });
        let _ = lpv_core::linalg::discrete_gramian(&take(n, n), &take(n, 1));
        let _ = Frf::new(values.clone(), 1, 1, values.iter().map(|&v| Complex::new(v, p)).collect());
        if let Ok(s) = StateSpace::new(take(n, n), take(n, 1), take(2, n), take(2, 1), Continuous) {
            let _ = s.poles();
            let _ = s.frequency_response(&values);
            let _ = s.zero_order_hold(Discrete::new(0.1).unwrap());
            let _ = s.tustin(Discrete::new(0.1).unwrap());
        }
        let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
        let f = |r, c| MatrixFunction::polynomial(vec![take(r, c), take(r, c)]);
        if let (Ok(a), Ok(b), Ok(c), Ok(d)) = (f(n, n), f(n, 1), f(2, n), f(2, 1)) {
            let model = LpvStateSpace::new(a, b, c, d, range, Discrete::new(1.0).unwrap()).unwrap();
            let _ = model.frozen(&[p]);
            let _ = model.simulate(&DVector::zeros(n), &take(1, 5), &take(1, 5));
        }
    }

    #[test]
    fn wild_text_is_refused_in_words(text in ".{0,200}") {
        prop_assert!(Model::from_json(&text).is_err());
    }
}

fn scalar(degree_coefficients: &[f64]) -> MatrixFunction {
    MatrixFunction::polynomial(degree_coefficients.iter().map(|&v| dmatrix![v]).collect()).unwrap()
}

fn static_lfr(d11: DMatrix<f64>, parameters: &[usize], range: SchedulingRange) -> Lfr<Discrete> {
    let nd = d11.nrows();
    let blocks = lpv_core::LfrBlocks {
        a: DMatrix::zeros(0, 0),
        b1: DMatrix::zeros(0, nd),
        b2: DMatrix::zeros(0, 1),
        c1: DMatrix::zeros(nd, 0),
        d11,
        d12: DMatrix::from_element(nd, 1, 1.0),
        c2: DMatrix::zeros(1, 0),
        d21: DMatrix::from_element(1, nd, 1.0),
        d22: dmatrix![1.0],
    };
    let deltas = parameters
        .iter()
        .map(|&parameter| lpv_core::DeltaBlock {
            parameter,
            repetitions: 1,
        })
        .collect();
    Lfr::new(blocks, deltas, range, Discrete::new(1.0).unwrap()).unwrap()
}

#[test]
fn systems_with_different_clocks_are_not_joined() {
    let at = |t: f64| StateSpace::gain(dmatrix![1.0], Discrete::new(t).unwrap()).unwrap();
    let (slow, fast) = (at(0.1), at(0.05));
    let refused = |r: Result<_, CoreError>| matches!(r, Err(CoreError::DifferentClocks { .. }));
    assert!(refused(slow.then(&fast).map(drop)));
    assert!(refused(slow.plus(&fast).map(drop)));
    assert!(refused(slow.beside(&fast).map(drop)));
    let range = SchedulingRange::interval(0.0, 1.0).unwrap();
    let lfr = |s: &StateSpace<Discrete>| Lfr::from_lti(s, range.clone()).unwrap();
    assert!(refused(lfr(&slow).then(&lfr(&fast)).map(drop)));
    assert!(refused(lfr(&slow).plus(&lfr(&fast)).map(drop)));
    // The rounding of a rate is no difference; two continuous systems have none.
    assert!(at(0.1).then(&at(0.1 * (1.0 + 1e-15))).is_ok());
    let continuous = StateSpace::gain(dmatrix![1.0], Continuous).unwrap();
    assert!(continuous.then(&continuous).is_ok());
}

#[test]
fn a_rational_lfr_is_not_taken_for_a_polynomial() {
    // D11 = 0.5 I: the Frobenius norm makes its powers look small, but 1 / (1 - delta / 2) is no polynomial.
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    for n in [1, 10, 50] {
        let lfr = static_lfr(DMatrix::identity(n, n) * 0.5, &vec![0; n], range.clone());
        assert_eq!(lfr.to_state_space().unwrap_err(), CoreError::NotPolynomial, "{n}");
    }
    // Powers that overflow are no proof of nilpotency either.
    let lfr = static_lfr(
        DMatrix::from_diagonal_element(2, 2, 1e200),
        &[0, 0],
        range.clone(),
    );
    assert!(lfr.to_state_space().is_err());
    let nilpotent = static_lfr(dmatrix![0.0, 3.0; 0.0, 0.0], &[0, 0], range);
    let polynomial = nilpotent.to_state_space().unwrap();
    // 1 + 2 delta + 3 delta^2.
    assert!((polynomial.frozen(&[0.5]).unwrap().d()[(0, 0)] - 2.75).abs() < 1e-14);
}

#[test]
fn many_parameters_do_not_fill_the_memory() {
    // 20 parameters have 2^20 corners and 5^20 grid points. D11 couples all of them.
    let n = 20;
    let range = SchedulingRange::new(vec![[-1.0, 1.0]; n]).unwrap();
    let coupled = DMatrix::from_fn(n, n, |i, j| if i == j { 0.0 } else { 0.4 });
    let lfr = static_lfr(coupled.clone(), &(0..n).collect::<Vec<_>>(), range.clone());
    assert!(matches!(
        lfr.well_posedness(),
        Err(CoreError::Dimension { found: 20, .. })
    ));
    // Only parameters that enter count, and the others stay at the centre.
    let two = static_lfr(dmatrix![0.0, 2.0; -0.4, 0.0], &[3, 17], range.clone());
    assert!(matches!(
        two.well_posedness().unwrap(),
        WellPosedness::Proven { .. }
    ));
    let two = static_lfr(dmatrix![0.0, 2.0; -0.6, 0.0], &[3, 17], range.clone());
    assert!(matches!(
        two.well_posedness().unwrap(),
        WellPosedness::Fails { .. } | WellPosedness::Sampled { .. }
    ));
    let small = static_lfr(coupled * 0.1, &(0..n).collect::<Vec<_>>(), range);
    assert!(matches!(
        small.well_posedness().unwrap(),
        WellPosedness::Proven { .. }
    ));
}

#[test]
fn functions_of_another_kind_are_not_added_by_index() {
    // Two functions each, but W_0 in a spline and W in powers: their coefficients must not be added.
    let clock = Discrete::new(1.0).unwrap();
    let range = SchedulingRange::interval(0.0, 1.0).unwrap();
    let nothing = StateSpace::gain(dmatrix![0.0], clock).unwrap();
    let with_feed_through =
        StateSpace::new(dmatrix![0.5], dmatrix![1.0], dmatrix![1.0], dmatrix![0.7], clock).unwrap();
    let spline = FunctionBasis::new(BasisKind::Spline {
        knots: vec![0.0, 1.0],
    })
    .unwrap();
    let direct = MatrixFunction::new(spline, vec![dmatrix![1.0], dmatrix![2.0]]).unwrap();
    let series = |direct: &MatrixFunction, weights| {
        SeriesExpansion::new(
            nothing.clone(),
            with_feed_through.clone(),
            direct.clone(),
            weights,
            range.clone(),
        )
        .unwrap()
        .to_state_space()
    };
    assert!(matches!(
        series(&direct, scalar(&[1.0, 1.0])),
        Err(CoreError::DifferentFunctions { .. })
    ));
    // A constant W adds to any W_0: D(p) = (1 + p) + 0.7 * 2.
    let model = series(&direct, scalar(&[2.0])).unwrap();
    assert!((model.frozen(&[0.5]).unwrap().d()[(0, 0)] - 2.9).abs() < 1e-14);
}

#[test]
fn empty_signals_and_empty_systems_run() {
    let model = LpvStateSpace::new(
        scalar(&[-1.0, 0.2]),
        scalar(&[1.0]),
        scalar(&[1.0]),
        scalar(&[0.0]),
        SchedulingRange::interval(-1.0, 1.0).unwrap(),
        Continuous,
    )
    .unwrap();
    let clock = Discrete::new(0.1).unwrap();
    let none = DMatrix::zeros(1, 0);
    let x0 = DVector::from_element(1, 2.0);
    let run = model.simulate_held(&x0, &none, &none, clock, 1e-9).unwrap();
    assert_eq!((run.outputs.shape(), run.final_state[0]), ((1, 0), 2.0));
    // With one sample the outputs say nothing about the integration; the final state must.
    let one = dmatrix![0.0];
    let run = model.simulate_held(&x0, &one, &one, clock, 1e-10).unwrap();
    assert!((run.final_state[0] - 2.0 * (-0.1_f64).exp()).abs() < 1e-9);

    let gain = StateSpace::gain(dmatrix![2.0, 3.0], clock).unwrap();
    let run = gain
        .simulate(&DVector::zeros(0), &dmatrix![1.0, 0.0; 0.0, 1.0])
        .unwrap();
    assert_eq!(run.outputs, dmatrix![2.0, 3.0]);
    let nowhere = SchedulingRange::new(Vec::new()).unwrap();
    let lfr = Lfr::from_lti(&gain, nowhere).unwrap();
    assert_eq!(lfr.frozen(&[]).unwrap(), gain);
    assert_eq!(lfr.to_state_space().unwrap().frozen(&[]).unwrap(), gain);
    let run = lfr
        .simulate(&DVector::zeros(0), &DMatrix::zeros(2, 3), &DMatrix::zeros(0, 3))
        .unwrap();
    assert_eq!(run.outputs.shape(), (1, 3));
    let autonomous = StateSpace::new(
        dmatrix![0.5],
        DMatrix::zeros(1, 0),
        dmatrix![1.0],
        DMatrix::zeros(1, 0),
        clock,
    )
    .unwrap();
    let run = autonomous
        .simulate(&DVector::from_element(1, 1.0), &DMatrix::zeros(0, 3))
        .unwrap();
    assert_eq!(run.outputs, dmatrix![1.0, 0.5, 0.25]);
    assert!(autonomous.frequency_response(&[0.0, 1.0]).is_ok());
    let silent = StateSpace::new(
        dmatrix![0.5],
        dmatrix![1.0],
        DMatrix::zeros(0, 1),
        DMatrix::zeros(0, 1),
        Continuous,
    )
    .unwrap();
    assert_eq!(silent.frequency_response(&[0.0, 1.0]).unwrap().len(), 2);
    assert!(silent.zero_order_hold(clock).is_ok() && silent.tustin(clock).is_ok());
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let clock = Discrete::new(0.1).unwrap();
    let lti = StateSpace::new(dmatrix![0.5], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0], clock).unwrap();
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let lfr = Lfr::from_lti(&lti, range.clone()).unwrap();
    let lpv = lfr.to_state_space().unwrap();
    let (zero, nan) = (DVector::zeros(1), DVector::from_element(1, f64::NAN));
    let (u, bad) = (dmatrix![1.0, 1.0], dmatrix![0.0, f64::NAN]);
    let not_finite = |r: Result<_, CoreError>| matches!(r, Err(CoreError::NotFinite { .. }));
    assert!(not_finite(lti.simulate(&nan, &u).map(drop)));
    assert!(not_finite(lti.simulate(&zero, &bad).map(drop)));
    assert!(not_finite(lfr.simulate(&nan, &u, &u).map(drop)));
    assert!(not_finite(lpv.simulate(&nan, &u, &u).map(drop)));
    let outside = |r: Result<_, CoreError>| matches!(r, Err(CoreError::OutsideRange { .. }));
    assert!(outside(lfr.simulate(&zero, &u, &bad).map(drop)));
    assert!(outside(lpv.simulate(&zero, &u, &bad).map(drop)));
    assert!(outside(lfr.frozen(&[f64::NAN]).map(drop)));
    assert!(not_finite(
        lpv_core::linalg::discrete_gramian(&dmatrix![0.5], &dmatrix![f64::NAN]).map(drop)
    ));
    let frf = Frf::zeros(vec![1.0], 1, 1).unwrap();
    assert!(not_finite(
        lpv_core::FrfEstimate::with_unit_covariance(frf, Some(f64::NAN.into())).map(drop)
    ));

    // A response that overflows is no agreement between two runs of the integrator.
    let explosive = LpvStateSpace::new(
        scalar(&[1e30]),
        scalar(&[1.0]),
        scalar(&[1.0]),
        scalar(&[0.0]),
        range,
        Continuous,
    )
    .unwrap();
    let long = DMatrix::from_element(1, 12, 1.0);
    assert!(matches!(
        explosive.simulate_held(&zero, &long, &(&long * 0.0), clock, 1e-6),
        Err(CoreError::Integration { .. })
    ));
}

#[test]
fn bounds_and_powers_at_the_edge_of_the_numbers() {
    let wide = SchedulingRange::interval(0.8e308, 1.7e308).unwrap();
    assert!((wide.normalise(&[1.7e308])[0] - 1.0).abs() < 1e-12);
    for (lower, upper) in [(0.0, 5e-324), (1.0, 1.0 + f64::EPSILON), (-1.7e308, 1.7e308)] {
        assert!(SchedulingRange::interval(lower, upper).is_err());
    }
    let monomials = |exponents| FunctionBasis::new(BasisKind::Monomials { exponents });
    assert!(monomials(vec![vec![u32::MAX, u32::MAX]]).is_err());
    assert!(
        FunctionBasis::new(BasisKind::Spline {
            knots: (0..5000).map(f64::from).collect(),
        })
        .is_err()
    );
    assert!(
        FunctionBasis::new(BasisKind::Spline {
            knots: vec![0.0, 1e200],
        })
        .is_err()
    );
    // A parameter that is missing counts as zero.
    let basis = monomials(vec![vec![], vec![1], vec![0, 2]]).unwrap();
    assert_eq!(basis.evaluate(&[]), [1.0, 0.0, 0.0]);
    assert_eq!(basis.evaluate(&[3.0]), [1.0, 3.0, 0.0]);
    assert_eq!(lpv_core::matern52(f64::INFINITY), 0.0);
    assert_eq!(lpv_core::matern52(1e200), 0.0);
    assert!(lpv_core::matern52(f64::NAN).is_nan());
}

#[test]
fn responses_on_other_lines_are_not_compared() {
    let at = |f: f64| Frf::new(vec![f], 1, 1, vec![Complex::from(1.0)]).unwrap();
    assert!(matches!(
        at(1.0).relative_error(&at(1.001)),
        Err(CoreError::Frequency { index: 0, .. })
    ));
    assert_eq!(at(1.0).relative_error(&at(1.0 + 1e-15)).unwrap(), [0.0]);
}

#[test]
fn an_ill_posed_instant_is_refused_in_simulation_as_when_frozen() {
    // I - D11 is singular, and elimination leaves rounding where a zero should be.
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let third = 1.0 / 3.0;
    let d11 = dmatrix![third, third, third; third, third, third; third, third, third];
    let lfr = static_lfr(d11, &[0, 0, 0], range);
    let p = [1.0];
    assert!(matches!(lfr.frozen(&p), Err(CoreError::IllPosed { .. })));
    assert!(matches!(
        lfr.simulate(&DVector::zeros(0), &dmatrix![1.0], &dmatrix![1.0]),
        Err(CoreError::IllPosed { .. })
    ));
}

#[test]
fn a_record_with_an_absurd_period_is_refused() {
    let record = lpv_core::Record {
        name: String::new(),
        kind: lpv_core::RecordKind::Periodic { period: usize::MAX },
        purpose: lpv_core::Purpose::Estimation,
        position: Some(0.0.into()),
        outputs: lpv_core::Signals::new(&["y"], vec![vec![0.0; 4]]),
        inputs: lpv_core::Signals::default(),
        references: lpv_core::Signals::default(),
        scheduling: lpv_core::Signals::default(),
        auxiliary: lpv_core::Signals::default(),
        injection: lpv_core::Signals::default(),
    };
    assert!(matches!(record.check(), Err(CoreError::Dimension { .. })));
    let nowhere = lpv_core::Record {
        kind: lpv_core::RecordKind::Transient,
        position: Some(f64::NAN.into()),
        ..record
    };
    assert!(matches!(nowhere.check(), Err(CoreError::NotFinite { .. })));
}
