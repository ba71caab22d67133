//! The regression against a joint solve, the covariance against a Monte Carlo, the interpolations against known functions.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Frf, FrfEstimate, Position, StateSpace};
use lpv_ident::{IdentError, Interpolation, RegressionSettings, RigidTerm, Weighting, recommend, regress};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

type C64 = Complex<f64>;

fn bank() -> StateSpace<Discrete> {
    StateSpace::new(
        dmatrix![0.8, -0.5; 0.5, 0.8],
        dmatrix![1.0; 0.3],
        DMatrix::identity(2, 2),
        DMatrix::zeros(2, 1),
        Discrete::new(1.0).unwrap(),
    )
    .unwrap()
}

fn lines(n: usize) -> Vec<f64> {
    (1..=n).map(|k| 0.49 * k as f64 / n as f64).collect()
}

fn truth(p: f64) -> DMatrix<f64> {
    dmatrix![1.0 + p, 0.2 * p, p * p, 0.1; 0.3, -p, 0.5, 1.0 - p * p]
}

/// `diag(2, 3) phi_R + sum_i W_i(p) phi_i`, two by two.
fn response(p: f64, frequencies: &[f64]) -> Frf {
    let phi = bank().frequency_response(frequencies).unwrap();
    let mut frf = Frf::zeros(frequencies.to_vec(), 2, 2).unwrap();
    for k in 0..frequencies.len() {
        let z = Complex::from_polar(1.0, std::f64::consts::TAU * frequencies[k]);
        let phi_r = (z + 1.0) / ((z - 1.0) * (z - 1.0));
        let mut g = DMatrix::from_diagonal(&DVector::from_vec(vec![phi_r * 2.0, phi_r * 3.0]));
        for i in 0..2 {
            g += truth(p).columns(2 * i, 2).map(C64::from) * phi.line(k)[(i, 0)];
        }
        frf.line_slice_mut(k).copy_from_slice(g.as_slice());
    }
    frf
}

/// Noise with the full Kronecker covariance, different on every line.
fn noisy(p: f64, frequencies: &[f64], scale: f64, rng: &mut ChaCha8Rng) -> FrfEstimate {
    let mut frf = response(p, frequencies);
    let (mut c, mut s) = (Vec::new(), Vec::new());
    for k in 0..frequencies.len() {
        let size = scale * (1.0 + frequencies[k]);
        let lc = DMatrix::from_row_slice(
            2,
            2,
            &[
                C64::new(1.0, 0.0),
                C64::new(0.0, 0.0),
                C64::new(0.4, 0.3),
                C64::new(0.5, 0.0),
            ],
        ) * C64::from(size);
        let ls = DMatrix::from_row_slice(
            2,
            2,
            &[
                C64::new(1.0, 0.0),
                C64::new(0.0, 0.0),
                C64::new(-0.2, 0.6),
                C64::new(2.0, 0.0),
            ],
        );
        let n = DMatrix::from_fn(2, 2, |_, _| {
            let (re, im): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
            C64::new(re, im) * 0.5_f64.sqrt()
        });
        let error = &lc * n * ls.adjoint();
        frf.line_slice_mut(k)
            .iter_mut()
            .zip(error.iter())
            .for_each(|(f, e)| *f += e);
        c.extend((&lc * lc.adjoint()).iter());
        s.extend((&ls * ls.adjoint()).iter());
    }
    FrfEstimate::new(frf, c, s, f64::INFINITY, Some(p.into())).unwrap()
}

fn settings() -> lpv_ident::RegressionSettings {
    RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        ..RegressionSettings::default()
    }
}

#[test]
fn recovers_what_made_the_data() {
    let positions = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let estimates: Vec<_> = positions
        .iter()
        .map(|&p| FrfEstimate::with_unit_covariance(response(p, &lines(60)), Some(p.into())).unwrap())
        .collect();
    let fits = regress(&estimates, &bank(), &settings()).unwrap();
    assert!((fits.gains().0 - DVector::from_vec(vec![2.0, 3.0])).norm() < 1e-11);
    for f in fits.fits() {
        assert!((&f.weights - truth(f.position[0])).norm() < 1e-10);
        assert!(f.cost < 1e-18);
    }
    let model = fits.interpolate(Interpolation::Polynomial { order: 2 }).unwrap();
    let p = 0.37;
    let error = model
        .response(&[p], &lines(33))
        .unwrap()
        .relative_error(&response(p, &lines(33)))
        .unwrap();
    assert!(error.iter().all(|&e| e < 1e-11));
    let lpv = model.series().unwrap().to_state_space().unwrap();
    assert_eq!(lpv.states(), 4 + 2 * 2);
    let error = lpv.frozen(&[p]).unwrap().frequency_response(&lines(33)).unwrap();
    assert!(
        error
            .relative_error(&response(p, &lines(33)))
            .unwrap()
            .iter()
            .all(|&e| e < 1e-11)
    );
}

#[test]
fn sums_of_products_give_way_to_reflections_where_functions_are_nearly_dependent() {
    let frequencies = lines(600);
    let near = |distance: f64| {
        StateSpace::new(
            dmatrix![0.5, 0.0; 0.0, 0.5 + distance],
            dmatrix![1.0; 1.0],
            DMatrix::identity(2, 2),
            DMatrix::zeros(2, 1),
            Discrete::new(1.0).unwrap(),
        )
        .unwrap()
    };
    // Well apart: one factorisation. Nearly the same: 4800 rows in three blocks of four channels, then their triangles.
    for (distance, factorisations, accuracy) in [(0.3, 1, 1e-13), (1e-2, 1, 1e-11), (1e-6, 13, 1e-7)] {
        let bank = near(distance);
        let phi = bank.frequency_response(&frequencies).unwrap();
        let mut frf = Frf::zeros(frequencies.clone(), 2, 2).unwrap();
        for k in 0..frequencies.len() {
            let sum: DMatrix<C64> = (0..2)
                .map(|i| truth(0.4).columns(2 * i, 2).map(C64::from) * phi.line(k)[(i, 0)])
                .sum();
            frf.line_slice_mut(k).copy_from_slice(sum.as_slice());
        }
        let estimate = FrfEstimate::with_unit_covariance(frf, Some(0.4.into())).unwrap();
        let fits = regress(&[estimate], &bank, &RegressionSettings::default()).unwrap();
        let fit = &fits.fits()[0];
        assert_eq!(
            fit.factorisations,
            factorisations,
            "{distance} {}",
            fit.condition()
        );
        assert!((&fit.weights - truth(0.4)).norm() < accuracy, "{distance}");
    }
}

#[test]
fn stated_covariances_are_those_of_a_monte_carlo() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let frequencies = lines(40);
    let positions = [-1.0, 0.0, 1.0];
    let runs = 400;
    let (p, at) = (0.5, [0.1, 0.3]);
    let mut gain_errors = Vec::new();
    let mut response_error = vec![DMatrix::<f64>::zeros(2, 2); 2];
    let mut cost = 0.0;
    let mut last = None;
    for _ in 0..runs {
        let estimates: Vec<_> = positions
            .iter()
            .map(|&q| noisy(q, &frequencies, 1e-2, &mut rng))
            .collect();
        let fits = regress(&estimates, &bank(), &settings()).unwrap();
        gain_errors.push(fits.gains().0[0] - 2.0);
        cost += fits.fits().iter().map(|f| f.cost).sum::<f64>();
        let model = fits.interpolate(Interpolation::Polynomial { order: 2 }).unwrap();
        let (g, g0) = (model.response(&[p], &at).unwrap(), response(p, &at));
        for k in 0..2 {
            response_error[k] += (g.line(k) - g0.line(k)).map(|e| e.norm_sqr());
        }
        last = Some(model);
    }
    let model = last.unwrap();
    let fits = model.fits();
    let unknowns: usize = fits.fits().iter().map(|f| f.unknowns).sum::<usize>() + 2;
    let expected = (fits.fits().iter().map(|f| f.equations).sum::<usize>() - unknowns) as f64;
    assert!(
        (cost / f64::from(runs) / expected - 1.0).abs() < 0.03,
        "{} {}",
        cost / f64::from(runs),
        expected
    );
    let spread = (gain_errors.iter().map(|e| e * e).sum::<f64>() / f64::from(runs)).sqrt();
    let stated = fits.gains().1[(0, 0)].sqrt();
    assert!((spread / stated - 1.0).abs() < 0.12, "{spread} {stated}");
    for (found, stated) in response_error
        .iter()
        .zip(model.response_deviation(&[p], &at).unwrap())
    {
        for (f, s) in found.iter().zip(stated.iter()) {
            let ratio = (f / f64::from(runs)).sqrt() / s;
            assert!((ratio - 1.0).abs() < 0.12, "{ratio}");
        }
    }
}

#[test]
fn interpolations_pass_the_samples_and_reproduce_what_they_can() {
    let positions: Vec<f64> = (0..9).map(|i| -1.0 + 0.25 * f64::from(i)).collect();
    let cubic = |p: f64| 1.0 - p + 2.0 * p.powi(3);
    for (kind, between) in [
        (Interpolation::Polynomial { order: 8 }, 1e-11_f64),
        (Interpolation::Polynomial { order: 3 }, 1e-12),
        (Interpolation::Chebyshev { order: 3 }, 1e-12),
        (Interpolation::Spline, 1e-12),
        (Interpolation::GaussianProcess { length_scale: 2.0 }, 0.05),
        (Interpolation::Linear, 0.2),
    ] {
        let at: Vec<Position> = positions.iter().map(|p| (*p).into()).collect();
        let operator = kind.operator(&at).unwrap();
        for p in [-1.0, -0.6, 0.1, 0.25, 0.9, 1.0] {
            let value: f64 = operator
                .cardinals(&[p])
                .iter()
                .zip(&positions)
                .map(|(l, &q)| l * cubic(q))
                .sum();
            let at_position = positions.contains(&p);
            assert!(
                (value - cubic(p)).abs() < if at_position { between.min(1e-6) } else { between },
                "{}",
                kind.name()
            );
        }
    }
}

/// Positions on a grid of x and y, moved a little so that no two share a value.
fn scattered(offset: [f64; 2], unit: [f64; 2]) -> Vec<Position> {
    (0..16)
        .map(|k| {
            let wobble = |i: i32| 0.1 * f64::from((7 * k + 3 * i) % 11) / 11.0;
            let (x, y) = (f64::from(k % 4) / 1.5 - 1.0, f64::from(k / 4) / 1.5 - 1.0);
            vec![
                offset[0] + unit[0] * (x + wobble(1)),
                offset[1] + unit[1] * (y - wobble(2)),
            ]
            .into()
        })
        .collect()
}

#[test]
fn polynomials_of_two_scheduling_signals_reproduce_themselves_in_any_unit() {
    for (offset, unit) in [
        ([0.0, 0.0], [1.0, 1.0]),
        ([0.3, -2.0], [1e-3, 40.0]),
        ([1e-4, 5e5], [1e-6, 1e6]),
    ] {
        let positions = scattered(offset, unit);
        let near = |p: &[f64], i: usize| (p[i] - offset[i]) / unit[i];
        let value = |p: &[f64]| {
            let (x, y) = (near(p, 0), near(p, 1));
            1.0 - 2.0 * x + 0.5 * y + x * y - 0.3 * y * y + 0.2 * x.powi(3) - x * x * y
        };
        let operator = Interpolation::Polynomial { order: 3 }
            .operator(&positions)
            .unwrap();
        for (x, y) in [(0.0, 0.0), (0.9, -0.8), (-0.5, 0.77)] {
            let p = [offset[0] + unit[0] * x, offset[1] + unit[1] * y];
            let cardinals = operator.cardinals(&p);
            let found: f64 = cardinals.iter().zip(&positions).map(|(l, q)| l * value(q)).sum();
            assert!(
                (found - value(&p)).abs() < 1e-7,
                "{offset:?} {unit:?}: {found} {}",
                value(&p)
            );
        }
    }
}

#[test]
fn what_two_scheduling_signals_cannot_carry_is_named() {
    let refused = |kind: Interpolation, positions: &[Position]| kind.operator(positions).unwrap_err();
    let grid = scattered([0.0, 0.0], [1.0, 1.0]);
    for kind in [
        Interpolation::Spline,
        Interpolation::Linear,
        Interpolation::Chebyshev { order: 2 },
        Interpolation::GaussianProcess { length_scale: 1.0 },
    ] {
        assert!(
            matches!(refused(kind, &grid), IdentError::OneSignal { found: 2, .. }),
            "{kind:?}"
        );
    }
    let square = Interpolation::Polynomial { order: 2 };
    // Six monomials and five positions; enough of them on a line; one with three numbers.
    assert!(matches!(
        refused(square, &grid[..5]),
        IdentError::TooFewPositions {
            needed: 6,
            found: 5,
            ..
        }
    ));
    let line: Vec<Position> = (0..9)
        .map(|k| vec![f64::from(k), 2.0 * f64::from(k)].into())
        .collect();
    assert!(matches!(
        refused(square, &line),
        IdentError::TooFewPositions { .. }
    ));
    let mut odd = grid.clone();
    odd[3] = vec![0.0, 0.0, 1.0].into();
    assert!(matches!(
        refused(square, &odd),
        IdentError::Position { index: 3, position, .. } if position == odd[3]
    ));
    let far = scattered([1e9, 0.0], [1.0, 1.0]);
    assert!(matches!(
        refused(Interpolation::Polynomial { order: 3 }, &far),
        IdentError::FarFromZero { .. }
    ));
}

#[test]
fn a_plane_of_positions_gives_the_model_that_made_the_responses() {
    // The second parameter moves the weights by a product.
    let at = |p: &[f64]| response(p[0] + 0.5 * p[1], &lines(60));
    let estimates: Vec<_> = scattered([0.0, 0.0], [0.6, 0.6])
        .into_iter()
        .map(|p| FrfEstimate::with_unit_covariance(at(&p), Some(p)).unwrap())
        .collect();
    let fits = regress(&estimates, &bank(), &settings()).unwrap();
    let table = fits.leave_one_out(&fits.candidates(3)).unwrap();
    assert_eq!(table.len(), 4, "polynomials of order 0 to 3");
    let best = recommend(&table, 2.0).unwrap().interpolation;
    let model = fits.interpolate(best).unwrap();
    assert_eq!(model.range().parameters(), 2);
    for p in [[0.0, 0.0], [0.41, -0.33], [-0.5, 0.5]] {
        let found = model.response(&p, &lines(33)).unwrap();
        let errors = found
            .relative_error(&response(p[0] + 0.5 * p[1], &lines(33)))
            .unwrap();
        assert!(errors.into_iter().all(|e| e < 1e-8), "{p:?}");
        let deviations = model.response_deviation(&p, &lines(5)).unwrap();
        assert!(deviations.iter().all(|d| d.iter().all(|v| v.is_finite())));
    }
    assert!(model.response(&[0.0], &lines(3)).is_err());
    let two = FrfEstimate::with_unit_covariance(at(&[0.1, 0.1]), Some(0.1.into())).unwrap();
    assert!(matches!(
        regress(&[estimates[0].clone(), two], &bank(), &settings()),
        Err(IdentError::Position { index: 1, .. })
    ));
}

#[test]
fn leave_one_out_prefers_the_order_that_made_the_data() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let estimates: Vec<_> = (0..9)
        .map(|i| noisy(-1.0 + 0.25 * f64::from(i), &lines(60), 3e-2, &mut rng))
        .collect();
    let fits = regress(&estimates, &bank(), &settings()).unwrap();
    let orders: Vec<_> = (0..=6).map(|order| Interpolation::Polynomial { order }).collect();
    let table = fits.leave_one_out(&orders).unwrap();
    assert_eq!(
        recommend(&table, 1.0).unwrap().interpolation,
        Interpolation::Polynomial { order: 2 }
    );
    assert!(table[0].cost > 100.0 * table[2].cost);
}

#[test]
fn units_do_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let of_unit = |e: &FrfEstimate, unit: f64| {
        let scaled = |values: &[C64], factor: f64| values.iter().map(|v| v * factor).collect();
        let frf = e.frf();
        let frf = Frf::new(frf.frequencies_hz().to_vec(), 2, 2, scaled(frf.values(), unit)).unwrap();
        let covariances = scaled(e.output_covariances(), unit * unit);
        FrfEstimate::new(
            frf,
            covariances,
            e.input_factors().to_vec(),
            f64::INFINITY,
            e.position().cloned(),
        )
        .unwrap()
    };
    let estimate = noisy(0.3, &lines(70), 1e-2, &mut rng);
    let settings = settings();
    let fits = |unit| regress(&[of_unit(&estimate, unit)], &bank(), &settings).unwrap();
    let one = fits(1.0);
    for unit in [1e-140, 1e-90, 1e90, 1e140] {
        let other = fits(unit);
        let (a, b) = (&one.fits()[0], &other.fits()[0]);
        assert!(
            (&b.weights / unit - &a.weights).norm() < 1e-12 * a.weights.norm(),
            "{unit:e}"
        );
        assert!((b.cost - a.cost).abs() < 1e-9 * a.cost, "{unit:e}");
    }
}

#[test]
fn refusals_say_where() {
    let good = |p| FrfEstimate::with_unit_covariance(response(p, &lines(20)), Some(p.into())).unwrap();
    let s = settings();
    assert_eq!(regress(&[], &bank(), &s).unwrap_err(), IdentError::NoEstimates);
    assert!(matches!(
        regress(&[good(1.0), good(1.0)], &bank(), &s),
        Err(IdentError::Position { index: 1, .. })
    ));
    let few = FrfEstimate::with_unit_covariance(response(0.0, &[0.1]), Some(0.0.into())).unwrap();
    assert!(matches!(
        regress(&[few], &bank(), &s),
        Err(IdentError::TooFewLines { lines: 1, .. })
    ));
    // Twice the same function.
    let twin = StateSpace::new(
        dmatrix![0.5, 0.0; 0.0, 0.5],
        dmatrix![1.0; 1.0],
        DMatrix::identity(2, 2),
        DMatrix::zeros(2, 1),
        Discrete::new(1.0).unwrap(),
    )
    .unwrap();
    assert!(matches!(
        regress(&[good(0.0)], &twin, &s),
        Err(IdentError::RankDeficient { .. })
    ));
    let zeros = vec![C64::new(0.0, 0.0); 20 * 4];
    let unweighted = FrfEstimate::new(
        response(0.0, &lines(20)),
        zeros.clone(),
        zeros,
        5.0,
        Some(0.0.into()),
    )
    .unwrap();
    assert!(matches!(
        regress(&[unweighted], &bank(), &s),
        Err(IdentError::Covariance { line: 0, .. })
    ));
    let mut silent = response(0.0, &lines(20));
    silent.line_slice_mut(7).fill(C64::new(0.0, 0.0));
    let silent = FrfEstimate::with_unit_covariance(silent, Some(0.0.into())).unwrap();
    let relative = RegressionSettings {
        weighting: Weighting::Relative,
        ..RegressionSettings::default()
    };
    assert!(matches!(
        regress(&[silent], &bank(), &relative),
        Err(IdentError::NoResponse { line: 7, .. })
    ));
    assert!(
        RegressionSettings {
            band_hz: Some((2.0, 1.0)),
            ..RegressionSettings::default()
        }
        .check()
        .is_err()
    );
    let fits = regress(&[good(0.0), good(0.5)], &bank(), &s).unwrap();
    assert!(matches!(
        fits.leave_one_out(&[Interpolation::Spline]),
        Err(IdentError::TooFewPositions { found: 2, .. })
    ));
    assert!(fits.interpolate(Interpolation::Polynomial { order: 2 }).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn one_joint_problem_and_elimination_agree(seed in 0_u64..500, weighting in prop_oneof![
        Just(Weighting::Covariance), Just(Weighting::Relative), Just(Weighting::Uniform)
    ]) {
        // Shared gains make the positions one problem; with a single position the joint solution is a plain one.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let e = noisy(0.3, &lines(12), 1e-1, &mut rng);
        let s = RegressionSettings { rigid_body: RigidTerm::diagonal(2), weighting, ..RegressionSettings::default() };
        let alone = regress(std::slice::from_ref(&e), &bank(), &s).unwrap();
        // The same data at three positions must give the same gains, and a gain covariance three times smaller.
        let copies: Vec<_> = [-1.0, 0.0, 1.0]
            .iter()
            .map(|&p| {
                let all: Vec<_> = (0..e.frf().len()).collect();
                let c = all.iter().flat_map(|&k| e.output_covariance(k).iter().copied().collect::<Vec<_>>()).collect();
                let f = all.iter().flat_map(|&k| e.input_factor(k).iter().copied().collect::<Vec<_>>()).collect();
                FrfEstimate::new(e.frf().clone(), c, f, f64::INFINITY, Some(p.into())).unwrap()
            })
            .collect();
        let joint = regress(&copies, &bank(), &s).unwrap();
        prop_assert!((joint.gains().0 - alone.gains().0).norm() < 1e-9 * alone.gains().0.norm());
        if weighting == Weighting::Covariance {
            prop_assert!((joint.gains().1 * 3.0 - alone.gains().1).norm() < 1e-9 * alone.gains().1.norm());
        }
        prop_assert!((&joint.fits()[1].weights - &alone.fits()[0].weights).norm() < 1e-8);
    }

    #[test]
    fn wild_settings_never_panic(order in any::<u16>(), length in any::<f64>(), positions in proptest::collection::vec(any::<f64>(), 0..8), low in any::<f64>(), high in any::<f64>()) {
        let _ = RegressionSettings { band_hz: Some((low, high)), ..RegressionSettings::default() }.check();
        for kind in [
            Interpolation::Polynomial { order: usize::from(order) },
            Interpolation::Chebyshev { order: usize::from(order % 64) },
            Interpolation::Spline,
            Interpolation::Linear,
            Interpolation::GaussianProcess { length_scale: length },
        ] {
            let at: Vec<Position> = positions.iter().map(|p| (*p).into()).collect();
            if let Ok(o) = kind.operator(&at) {
                let _ = o.cardinals(&[low]);
            }
        }
    }
}
