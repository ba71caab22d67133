//! Effects of a user's own beside the catalogue, on an axis that is simulated by hand.

use super::axis_by_hand::{controller, find_beside};
use lpv_diagnose::effect::Effect;
use lpv_diagnose::{Trace, UserEffect, UserParameter, UserState, Verdict};
use std::collections::BTreeMap;

fn amplitude(unit: &str) -> UserParameter {
    UserParameter {
        unit: unit.to_owned(),
        ..UserParameter::default()
    }
}

fn from(starts: &[f64], positive: bool) -> UserParameter {
    UserParameter {
        unit: "y".to_owned(),
        starts: starts.to_vec(),
        positive,
    }
}

fn own(name: &str, force: &str, parameters: &[(&str, UserParameter)], states: &[(&str, &str)]) -> UserEffect {
    UserEffect {
        name: name.to_owned(),
        meaning: "made for a test".to_owned(),
        family: None,
        channel: None,
        force: Some(force.to_owned()),
        reading: None,
        states: states
            .iter()
            .map(|(name, rate)| {
                let state = UserState {
                    rate: (*rate).to_owned(),
                    start: 0.0,
                };
                ((*name).to_owned(), state)
            })
            .collect(),
        parameters: parameters
            .iter()
            .map(|(name, p)| ((*name).to_owned(), p.clone()))
            .collect::<BTreeMap<_, _>>(),
    }
}

/// A joint of the rails somewhere along the stroke.
fn joint() -> &'static Effect {
    let all = [
        ("a", amplitude("u")),
        ("at", from(&[0.01, 0.04, 0.07, 0.1], false)),
        ("width", from(&[0.005, 0.02], true)),
    ];
    own("rail-joint", "-a*exp(-((x - at)/width)^2)", &all, &[])
        .at(0, &[])
        .unwrap()
}

fn names(found: &Trace) -> Vec<&'static str> {
    found.added.iter().map(|a| a.effect.name).collect()
}

/// Its values lie within this many deviations of the truth, or of one part in a thousand where the rule of the simulation differs.
fn assert_is(found: &Trace, name: &str, truth: &[(&str, f64)]) {
    const DEVIATIONS: f64 = 4.0;
    let added = found.added.iter().find(|a| a.effect.name == name).unwrap();
    for (parameter, (value, deviation)) in added.effect.parameters.iter().zip(&added.values) {
        let (_, truth) = truth.iter().find(|(n, _)| *n == parameter.name).unwrap();
        let allowed = (DEVIATIONS * deviation).max(1e-3 * truth.abs());
        assert!(
            (value - truth).abs() <= allowed,
            "{name} {}: {value} +- {deviation}, not {truth}",
            parameter.name
        );
    }
}

#[test]
fn a_bump_of_force_is_found_by_its_formula() {
    let force = |x: f64, _: f64| -3.0 * (-((x - 0.062) / 0.012).powi(2)).exp();
    let found = find_beside(&controller(10.0), 0.0, &[joint()], force);
    assert_eq!(
        (names(&found), found.verdict),
        (vec!["rail-joint"], Verdict::Explained)
    );
    assert_is(
        &found,
        "rail-joint",
        &[("a", 3.0), ("at", 0.062), ("width", 0.012)],
    );
}

/// Presliding friction with a state of its own, beside an effect of the catalogue.
#[test]
fn a_state_of_its_own_is_followed() {
    let force = |x: f64, _: f64| -12.0 * x - 2000.0 * x.powi(3);
    let cubic = own(
        "two-springs",
        "-k*x - c*x^3 - slow*z",
        &[
            ("k", amplitude("u/y")),
            ("c", amplitude("u/y^3")),
            ("slow", amplitude("u/y")),
        ],
        &[("z", "(x - z)/0.2")],
    );
    // The slow spring is not there: its amplitude is none.
    let found = find_beside(&controller(1.0), 0.0, &[cubic.at(0, &[]).unwrap()], force);
    assert_eq!(
        (names(&found), found.verdict),
        (vec!["cable-stiffness"], Verdict::Explained)
    );
}

#[test]
fn an_effect_that_is_not_there_is_not_named() {
    for (level, expected) in [(0.0, vec![]), (2.0, vec!["coulomb-friction"])] {
        let force = |_: f64, v: f64| -level * (v / 1e-3).tanh();
        let found = find_beside(&controller(1.0), 0.0, &[joint()], force);
        assert_eq!(names(&found), expected);
    }
}

/// Friction of Dahl by its equation, which the catalogue has too: of equals that of the user leads, and is told with the values.
#[test]
fn of_equals_the_effect_of_the_user_leads() {
    let dahl = own(
        "my-dahl",
        "-level*z",
        &[
            ("level", amplitude("u")),
            ("distance", from(&[1e-4, 1e-3, 1e-2], true)),
        ],
        &[("z", "(v - abs(v)*z)/distance")],
    );
    let z = std::cell::Cell::new(0.0_f64);
    let force = |x: f64, v: f64| {
        // A record begins at rest.
        if (x, v) == (0.0, 0.0) {
            z.set(0.0);
        }
        let rate = (v - v.abs() * z.get()) / 2e-3;
        z.set(z.get() + 0.0025 * 0.01 * rate);
        -2.0 * z.get()
    };
    let found = find_beside(&controller(1.0), 0.0, &[dahl.at(0, &[]).unwrap()], force);
    assert_eq!(names(&found), ["my-dahl"]);
    assert_is(&found, "my-dahl", &[("level", 2.0), ("distance", 2e-3)]);
}
