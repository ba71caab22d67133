//! A constant is a response of order zero.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::{Discrete, Frf, FrfEstimate};
use num_complex::Complex;
use pole_fit::{NumeratorDegree, PoleFitError, PoleFitSettings, fit};

#[test]
fn a_constant_has_no_states() {
    let gain = [2.0, -0.5, 0.25, 1e-3];
    let lines: Vec<f64> = (1..20).map(f64::from).collect();
    let values = lines.iter().flat_map(|_| gain.map(Complex::from)).collect();
    let estimate = FrfEstimate::with_unit_covariance(Frf::new(lines, 2, 2, values).unwrap(), None).unwrap();
    let clock = Discrete::from_rate(100.0).unwrap();
    let found = fit(&estimate, clock, &PoleFitSettings::new(0)).unwrap();
    assert!(found.poles.is_empty() && found.account.unknowns == 4);
    let model = found.state_space().unwrap();
    assert_eq!(model.states(), 0);
    for (own, exact) in model.d().iter().zip(gain) {
        assert!((own - exact).abs() < 1e-12, "{own} {exact}");
    }
    // Nothing is strictly proper and has no states.
    let settings = PoleFitSettings {
        numerator: NumeratorDegree::StrictlyProper,
        ..PoleFitSettings::new(0)
    };
    assert!(matches!(
        fit(&estimate, clock, &settings),
        Err(PoleFitError::Order { .. })
    ));
}
