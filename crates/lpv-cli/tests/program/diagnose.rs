//! `lpv diagnose`.

use crate::common::{Desk, number, shared, stdout_of};
use std::ffi::OsStr;

fn diagnosis(name: &str) -> Option<serde_json::Value> {
    let folder = shared(name)?;
    let desk = Desk::new();
    let words: [&OsStr; 4] = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "found".as_ref(),
    ];
    stdout_of("diagnose", &desk.program(&words).output().unwrap());
    assert!(desk.path("found/diagnosis.html").is_file());
    let text = std::fs::read_to_string(desk.path("found/diagnosis.json")).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

/// The independent simulator's README tells what is in each machine.
#[test]
fn a_machine_without_an_effect_is_left_alone() {
    let Some(found) = diagnosis("machine-plain") else {
        return;
    };
    assert_eq!(found["verdict"], "nothing-missing");
    assert_eq!(found["effects"].as_array().unwrap().len(), 0);
    assert_eq!(found["format"], 1);
}

#[test]
fn friction_is_named_and_explains_the_moves() {
    let Some(found) = diagnosis("machine-friction") else {
        return;
    };
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"][0]["effect"], "coulomb-friction");
    assert_eq!(found["effects"].as_array().unwrap().len(), 1);
    assert!(number(&found, "/before/validation/y1/over_noise") > 1e3);
    assert!(number(&found, "/after/validation/y1/over_noise") < 1.1);
    assert!(number(&found, "/after/validation/y2/over_noise") < 1.1);
}

#[test]
fn an_extra_mode_is_named_with_its_frequency() {
    let Some(found) = diagnosis("machine-extra-mode") else {
        return;
    };
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["effects"][0]["effect"], "extra-mode");
    let frequency = number(&found, "/effects/0/parameters/frequency/value");
    assert!((frequency / 4.40 - 1.0).abs() < 0.01, "{frequency}");
    let mass = number(&found, "/effects/0/parameters/mass/value");
    assert!((mass / 0.465 - 1.0).abs() < 0.01, "{mass}");
    for output in ["y1", "y2"] {
        assert!(number(&found, &format!("/after/validation/{output}/over_noise")) < 1.1);
    }
}

#[test]
fn a_bundle_without_a_controller_is_refused() {
    let Some(folder) = shared("cd-player-arm") else {
        return;
    };
    let desk = Desk::new();
    let words: [&OsStr; 4] = [
        "diagnose".as_ref(),
        folder.as_ref(),
        "-o".as_ref(),
        "found".as_ref(),
    ];
    let out = desk.program(&words).output().unwrap();
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("[controller]"));
    assert!(!desk.path("found").exists());
}

#[test]
fn a_motor_with_a_load_on_a_shaft() {
    let Some(found) = diagnosis("two-mass-bench") else {
        return;
    };
    let steps = found["responses"].as_array().unwrap();
    let error = |step: usize, output: &str| 100.0 * steps[step]["fitted"][output].as_f64().unwrap();
    for (step, bars) in [[57.1, 55.5], [12.2, 11.4], [9.97, 8.98]].iter().enumerate() {
        for (output, bar) in ["theta_mx", "theta_my"].iter().zip(bars) {
            assert!(
                error(step, output) <= *bar,
                "{step} {output}: {}",
                error(step, output)
            );
        }
    }
    let effects: Vec<&str> = found["effects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e["effect"].as_str().unwrap())
        .collect();
    assert_eq!(effects, ["extra-mode", "delay"]);
    let delay = found["effects"][1]["parameters"]["time"]["value"]
        .as_f64()
        .unwrap();
    assert!((5e-5..3.5e-4).contains(&delay), "{delay}");
    let reasons = found["reasons"].to_string();
    assert!(
        reasons.contains("nonlinear distortion") && reasons.contains("not told apart"),
        "{reasons}"
    );
}
