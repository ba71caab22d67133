//! Numbers of an independent implementation of the same machine.

use lpv_core::{Discrete, Frf};
use num_complex::Complex;
use std::path::Path;
use xytable_plant::{ControllerSettings, MachineParameters, VerifiedController};

fn reference() -> Option<serde_json::Value> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/reference/plant.json"
    );
    match std::fs::read_to_string(Path::new(path)) {
        Ok(text) => Some(serde_json::from_str(&text).unwrap()),
        Err(error) => {
            eprintln!("skipped: no reference numbers ({error})");
            None
        }
    }
}

fn complex(v: &serde_json::Value) -> Complex<f64> {
    Complex::new(v[0].as_f64().unwrap(), v[1].as_f64().unwrap())
}

#[test]
fn default_parameters_are_those_of_the_reference() {
    let p = MachineParameters::default();
    for (ours, theirs) in [
        (p.stiffness_y_n_per_m, 622.5252975987112),
        (p.stiffness_r_n_m_per_rad, 32.67179387946822),
        (p.damping_y_n_s_per_m, 2.04988920646734),
        (p.damping_r_n_m_s_per_rad, 0.07799816243395348),
    ] {
        assert!((ours / theirs - 1.0).abs() < 1e-14, "{ours} {theirs}");
    }
}

#[test]
fn frozen_responses_and_poles_agree_with_the_reference() {
    let Some(json) = reference() else { return };
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(json["sample_rate"].as_f64().unwrap()).unwrap();
    let mut compared = 0;
    for position in json["positions"].as_array().unwrap() {
        let p = position["p"].as_f64().unwrap();
        let f: Vec<f64> = position["frequencies"]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v.as_f64().unwrap())
            .collect();
        let mut values = Vec::new();
        for line in position["frf"].as_array().unwrap() {
            for j in 0..2 {
                for i in 0..2 {
                    values.push(complex(&line[i][j]));
                }
            }
        }
        let theirs = Frf::new(f.clone(), 2, 2, values).unwrap();
        let ours = machine.sampled(p, clock).unwrap().frequency_response(&f).unwrap();
        let worst = ours
            .relative_error(&theirs)
            .unwrap()
            .into_iter()
            .fold(0.0, f64::max);
        assert!(worst < 1e-9, "p = {p}: {worst:e}");
        let poles = machine.flexible_poles(p).unwrap();
        for pole in position["continuous_poles"].as_array().unwrap() {
            let pole = complex(pole);
            let nearest = poles
                .iter()
                .map(|z| (z - pole).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-9 * pole.norm(), "p = {p}: {pole} off by {nearest:e}");
        }
        compared += 1;
    }
    assert!(compared > 0);
}

#[test]
fn the_default_rule_gives_the_expected_loop() {
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(20.0).unwrap();
    let k = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
    for radius in &k.robustness().spectral_radii {
        assert!((radius - 0.9926).abs() < 1e-4, "{radius}");
    }
    assert!(
        (k.robustness().largest_sensitivity() - 2.6).abs() < 0.01,
        "{}",
        k.robustness().largest_sensitivity()
    );
}
