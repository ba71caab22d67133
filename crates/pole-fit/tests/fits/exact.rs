//! Noise-free data: the poles come out to rounding.

use crate::machine::{C64, clock, flexible_poles, lines, response};
use lpv_core::{Discrete, Frf, FrfEstimate};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, StopReason, Weighting, fit};

const POSITIONS: [f64; 5] = [-0.3, -0.13, 0.0, 0.02, 0.3];
const WEIGHTINGS: [Weighting; 4] = [
    Weighting::Covariance,
    Weighting::DiagonalCovariance,
    Weighting::Relative,
    Weighting::Uniform,
];

fn worst(found: &[C64], truth: &[C64]) -> f64 {
    truth
        .iter()
        .map(|t| found.iter().map(|f| (f - t).norm()).fold(f64::INFINITY, f64::min))
        .fold(0.0, f64::max)
}

#[test]
fn machine_with_fixed_integrators() {
    let frequencies = lines(16);
    for p in POSITIONS {
        let frf = response(p, &frequencies);
        let zero = vec![C64::new(0.0, 0.0); 4 * frf.len()];
        let nothing = FrfEstimate::new(frf.clone(), zero.clone(), zero, 28.0, None).unwrap();
        let unit = FrfEstimate::with_unit_covariance(frf, Some(p.into())).unwrap();
        for weighting in WEIGHTINGS {
            for (name, estimate) in [("zero", &nothing), ("unit", &unit)] {
                let settings = PoleFitSettings {
                    integrators: Integrators::Fixed(2),
                    weighting,
                    ..PoleFitSettings::new(6)
                };
                let result = fit(estimate, clock(), &settings).unwrap();
                let error = worst(&result.flexible_poles(), &flexible_poles(p));
                assert!(error < 1e-12, "p {p} {weighting:?} {name}: {error:e}");
                assert_eq!(result.poles[..2], [C64::new(1.0, 0.0); 2]);
                assert_eq!(result.flexible_poles().len(), 4);
                assert!(result.account.unstable_poles.is_empty());
                assert_eq!(result.account.stop, StopReason::ResidualAtRounding);
                assert!(result.account.factorisations <= 8, "{:?}", result.account);
            }
        }
    }
}

#[test]
fn machine_with_free_integrators() {
    let frequencies = lines(16);
    for p in POSITIONS {
        let estimate = FrfEstimate::with_unit_covariance(response(p, &frequencies), None).unwrap();
        let settings = PoleFitSettings {
            weighting: Weighting::Relative,
            ..PoleFitSettings::new(6)
        };
        let result = fit(&estimate, clock(), &settings).unwrap();
        assert_eq!(result.flexible_poles().len(), 4);
        assert!(worst(&result.flexible_poles(), &flexible_poles(p)) < 1e-12);
        // A double root scatters by the square root of rounding.
        assert!((result.poles[0] - 1.0).norm() < 1e-6);
    }
}

#[test]
fn too_high_an_order_keeps_the_true_poles() {
    let estimate = FrfEstimate::with_unit_covariance(response(0.3, &lines(16)), None).unwrap();
    for (order, integrators) in [
        (8, Integrators::Fixed(2)),
        (10, Integrators::Fixed(2)),
        (8, Integrators::Free),
    ] {
        for weighting in WEIGHTINGS {
            let settings = PoleFitSettings {
                integrators,
                weighting,
                ..PoleFitSettings::new(order)
            };
            let result = fit(&estimate, clock(), &settings).unwrap();
            let error = worst(&result.poles, &flexible_poles(0.3));
            assert!(error < 1e-7, "{order} {integrators:?} {weighting:?}: {error:e}");
            assert!(result.account.condition > 1e10, "{:?}", result.account);
        }
    }
}

/// No data choose these poles: any finite ones will do, as long as the response is that of the data.
#[test]
fn what_needs_no_free_pole_is_fitted_all_the_same() {
    let frequencies = lines(64);
    let z = |f: f64| C64::from_polar(1.0, std::f64::consts::TAU * f * clock().sample_time());
    let gain: Vec<C64> = frequencies.iter().map(|_| C64::new(2.0, 0.0)).collect();
    let rigid: Vec<C64> = frequencies.iter().map(|f| (z(*f) - 1.0).powi(2).inv()).collect();
    for (values, order, integrators) in [(gain, 2, Integrators::Free), (rigid, 4, Integrators::Fixed(2))] {
        let frf = Frf::new(frequencies.clone(), 1, 1, values).unwrap();
        let estimate = FrfEstimate::with_unit_covariance(frf, None).unwrap();
        for weighting in WEIGHTINGS {
            let settings = PoleFitSettings {
                integrators,
                weighting,
                ..PoleFitSettings::new(order)
            };
            let result = fit(&estimate, clock(), &settings).unwrap();
            let largest = result.poles.iter().map(|p| p.norm()).fold(0.0, f64::max);
            let error = result.account.relative_error_max;
            assert!(largest < 1e6, "{order} {weighting:?}: {largest:e}");
            assert!(error < 1e-14, "{order} {weighting:?}: {error:e}");
        }
    }
}

#[test]
fn response_and_state_space_agree() {
    let frequencies = lines(64);
    let clock = clock();
    for (n_y, n_u) in [(2, 2), (2, 1), (1, 2)] {
        for (order, integrators, numerator) in [
            (6, Integrators::Fixed(2), NumeratorDegree::Proper),
            (6, Integrators::Fixed(2), NumeratorDegree::StrictlyProper),
            (6, Integrators::Free, NumeratorDegree::Proper),
            (2, Integrators::Fixed(2), NumeratorDegree::Proper),
        ] {
            let full = response(-0.13, &frequencies);
            let mut values = Vec::new();
            for k in 0..full.len() {
                for j in 0..n_u {
                    for i in 0..n_y {
                        values.push(full.line(k)[(i, j)]);
                    }
                }
            }
            let frf = Frf::new(frequencies.clone(), n_y, n_u, values).unwrap();
            let estimate = FrfEstimate::with_unit_covariance(frf.clone(), None).unwrap();
            let settings = PoleFitSettings {
                integrators,
                numerator,
                weighting: Weighting::Relative,
                ..PoleFitSettings::new(order)
            };
            let result = fit(&estimate, clock, &settings).unwrap();
            let system = result.state_space().unwrap();
            assert_eq!(system.states(), order * n_y.min(n_u));
            let model = result.response(&frequencies).unwrap();
            let realised = system.frequency_response(&frequencies).unwrap();
            let largest = realised
                .relative_error(&model)
                .unwrap()
                .into_iter()
                .fold(0.0, f64::max);
            assert!(largest < 1e-9, "{order} {integrators:?}: {largest:e}");
            if order == 6 {
                let error = model
                    .relative_error(&frf)
                    .unwrap()
                    .into_iter()
                    .fold(0.0, f64::max);
                assert!(error < 1e-9, "{error:e}");
            } else {
                assert_eq!(result.account.stop, StopReason::Linear);
            }
            if numerator == NumeratorDegree::StrictlyProper {
                assert!(system.d().amax() == 0.0);
            }
        }
    }
}

#[test]
fn known_delay_is_taken_out_and_put_back() {
    let clock = Discrete::new(0.5).unwrap();
    let frequencies: Vec<f64> = (0..60).map(|k| f64::from(k) / 60.0).collect();
    let values: Vec<C64> = frequencies
        .iter()
        .map(|f| {
            let z = C64::from_polar(1.0, std::f64::consts::PI * f);
            (z * 2.0 + 1.0) / (z * z - z + 0.8) * z.powi(-3)
        })
        .collect();
    let frf = Frf::new(frequencies.clone(), 1, 1, values).unwrap();
    let estimate = FrfEstimate::with_unit_covariance(frf.clone(), None).unwrap();
    let settings = PoleFitSettings {
        delay_samples: 3,
        numerator: NumeratorDegree::StrictlyProper,
        ..PoleFitSettings::new(2)
    };
    let result = fit(&estimate, clock, &settings).unwrap();
    // z^2 - z + 0.8 by hand: 0.5 +- j sqrt(0.55).
    assert!((result.poles[0] - C64::new(0.5, 0.55f64.sqrt())).norm() < 1e-13);
    assert_eq!(result.poles[1], result.poles[0].conj());
    let error = result
        .response(&frequencies)
        .unwrap()
        .relative_error(&frf)
        .unwrap();
    assert!(error.into_iter().fold(0.0, f64::max) < 1e-12);
    let mode = result.modes()[0];
    let s = result.poles[0].ln() / 0.5;
    assert!((mode.frequency_hz - s.norm() / std::f64::consts::TAU).abs() < 1e-14);
    assert!((mode.damping + s.re / s.norm()).abs() < 1e-14);
}

#[test]
fn unstable_poles_are_reported_not_forced() {
    let clock = Discrete::new(1.0).unwrap();
    let frequencies: Vec<f64> = (1..50).map(|k| f64::from(k) / 100.0).collect();
    let values: Vec<C64> = frequencies
        .iter()
        .map(|f| {
            let z = C64::from_polar(1.0, std::f64::consts::TAU * f);
            C64::new(1.0, 0.0) / ((z - 1.25) * (z - 0.5))
        })
        .collect();
    let frf = Frf::new(frequencies, 1, 1, values).unwrap();
    let estimate = FrfEstimate::with_unit_covariance(frf, None).unwrap();
    let result = fit(&estimate, clock, &PoleFitSettings::new(2)).unwrap();
    assert_eq!(result.account.unstable_poles.len(), 1);
    let unstable = result.poles[result.account.unstable_poles[0]];
    assert!((unstable - 1.25).norm() < 1e-12);
}
