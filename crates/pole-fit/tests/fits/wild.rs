//! Any input gives a result or a typed refusal, never a panic.

use crate::machine::C64;
use lpv_core::{Discrete, Frf, FrfEstimate};
use pole_fit::{Integrators, NumeratorDegree, PoleFitError, PoleFitSettings, Weighting, fit, scan};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => -10.0..10.0f64,
        1 => any::<f64>(),
        1 => Just(0.0),
        1 => Just(1e300),
        1 => Just(1e-300),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
    ]
}

fn weighting() -> impl Strategy<Value = Weighting> {
    prop_oneof![
        Just(Weighting::Covariance),
        Just(Weighting::DiagonalCovariance),
        Just(Weighting::Relative),
        Just(Weighting::Uniform),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn settings_never_panic(
        order in prop_oneof![0usize..12, Just(usize::MAX)],
        k in prop_oneof![0usize..4, Just(usize::MAX)],
        lower in wild(), upper in wild(), floor in wild(), tolerance in wild(), rigid in wild(),
    ) {
        let settings = PoleFitSettings { integrators: Integrators::Fixed(k), band: Some((lower, upper)), relative_floor: floor, tolerance, rigid_body_hz: Some(rigid), ..PoleFitSettings::new(order) };
        if settings.check().is_ok() {
            prop_assert!(settings.order >= k.max(1));
            prop_assert!(lower < upper);
        }
    }

    #[test]
    fn fits_never_panic(
        n_y in 0usize..3, n_u in 0usize..3, lines in 0usize..20,
        tame in 0usize..3,
        weighting in weighting(),
        order in 1usize..6, k in 0usize..3, smoothing in 0usize..3,
        strict in prop::sample::select(vec![NumeratorDegree::Proper, NumeratorDegree::StrictlyProper]),
        degrees in prop_oneof![Just(0.0), Just(1.5), Just(28.0), Just(f64::INFINITY)],
        step in prop_oneof![Just(0.02), Just(0.05)],
        numbers in prop::collection::vec(wild(), 20 * (4 + 4 + 4) * 2),
    ) {
        // Most draws would be refused for their first NaN; tame ones get further.
        let repair = |v: f64| match tame {
            0 => v,
            1 => if v.is_finite() { v } else { 1.0 },
            _ => if v.is_finite() && v.abs() < 1e3 { v } else { 0.0 },
        };
        let mut source = numbers.iter().map(|&v| repair(v));
        let mut take = |n: usize| -> Vec<C64> {
            (0..n).map(|_| C64::new(source.next().unwrap_or(0.0), source.next().unwrap_or(0.0))).collect()
        };
        let frequencies: Vec<f64> = (0..lines).map(|k| k as f64 * step).collect();
        let values = take(lines * n_y * n_u);
        let c_v = take(lines * n_y * n_y);
        let s = take(lines * n_u * n_u);
        let Ok(frf) = Frf::new(frequencies, n_y, n_u, values) else { return Ok(()) };
        let Ok(estimate) = FrfEstimate::new(frf, c_v, s, degrees, None) else { return Ok(()) };
        let settings = PoleFitSettings { integrators: Integrators::Fixed(k), numerator: strict, weighting, smoothing_lines: smoothing, ..PoleFitSettings::new(order) };
        let clock = Discrete::new(1.0).unwrap();
        if let Ok(result) = fit(&estimate, clock, &settings) {
            prop_assert_eq!(result.poles.len(), order);
            prop_assert!(result.poles.iter().all(|p| p.is_finite()));
            prop_assert!(result.account.cost.is_finite());
            let _ = result.state_space();
            let _ = result.modes();
            let _ = result.response(&numbers);
        }
        let _ = scan(&estimate, clock, &settings, &[order, 0, 3]);
    }
}

#[test]
fn refusals_name_the_facts() {
    let clock = Discrete::new(1.0).unwrap();
    let frf = |frequencies: Vec<f64>, value: f64| {
        let values = vec![C64::new(value, 0.0); frequencies.len()];
        Frf::new(frequencies, 1, 1, values).unwrap()
    };
    let unit = |frf| FrfEstimate::with_unit_covariance(frf, None).unwrap();
    let settings = PoleFitSettings::new(3);
    let few = unit(frf(vec![0.1, 0.2, 0.3], 1.0));
    assert!(matches!(
        fit(&few, clock, &settings),
        Err(PoleFitError::TooFewLines {
            order: 3,
            equations: 6,
            unknowns: 7
        })
    ));
    let none = unit(frf(vec![], 1.0));
    assert!(matches!(
        fit(&none, clock, &settings),
        Err(PoleFitError::Empty { .. })
    ));
    let lines: Vec<f64> = (1..10).map(|k| f64::from(k) * 0.05).collect();
    let zero = unit(frf(lines.clone(), 0.0));
    assert_eq!(fit(&zero, clock, &settings), Err(PoleFitError::ZeroResponse));
    let slow = Discrete::new(2.0).unwrap();
    assert!(matches!(
        fit(&unit(frf(lines.clone(), 1.0)), slow, &settings),
        Err(PoleFitError::Core(_))
    ));
    let band = PoleFitSettings {
        band: Some((0.41, 0.42)),
        ..PoleFitSettings::new(3)
    };
    assert!(matches!(
        fit(&unit(frf(lines.clone(), 1.0)), clock, &band),
        Err(PoleFitError::EmptyBand { lines: 9, .. })
    ));
    let ones = vec![C64::new(1.0, 0.0); 9];
    let poor = FrfEstimate::new(frf(lines, 1.0), ones.clone(), ones, 2.0, None).unwrap();
    assert_eq!(
        fit(&poor, clock, &settings),
        Err(PoleFitError::DegreesOfFreedom {
            found: 2.0,
            needed: 2.0
        })
    );
}
