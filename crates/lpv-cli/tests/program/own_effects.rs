//! `lpv diagnose --effects`.

use crate::common::{Desk, Noise, csv, entry, head};
use std::f64::consts::TAU;

const STEP: f64 = 2e-3;
const TRUTH: [(&str, f64); 3] = [("a", 1.8), ("at", 0.031), ("width", 0.012)];

/// The definition of the page, as a reader copies it.
fn of_the_page() -> String {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/own-effects.md");
    let page = std::fs::read_to_string(page).unwrap();
    let block = page.split("```toml\n").nth(1).unwrap();
    block.split("```").next().unwrap().to_owned()
}

/// An axis of 2 kg under a controller that nobody tells, pushed where a joint of the rails is: by hand, in small steps.
fn record(seed: u64) -> String {
    const PARTS: usize = 50;
    let noise = Noise(seed).samples(3000, 2e-6);
    let (mut x, mut v, mut last) = (0.0_f64, 0.0_f64, 0.0);
    let (mut y, mut u) = (Vec::new(), Vec::new());
    for (k, noise) in noise.iter().enumerate() {
        let t = k as f64 * STEP;
        let slow = 0.31 + 0.06 * seed as f64;
        // From rest.
        let begun = 1.0 - (-(t / 0.4).powi(2)).exp();
        let aim = 0.09 * begun * ((TAU * slow * t).sin() + 0.3 * (TAU * 1.7 * slow * t).sin());
        let read = x + noise;
        let error = aim - read;
        let force = 2.0 * (900.0 * error + 42.0 * (error - last) / STEP);
        last = error;
        y.push(read);
        u.push(force);
        for _ in 0..PARTS {
            // By the rule of the middle: the error of a plain step is a time that the readings would tell.
            let h = STEP / PARTS as f64;
            let rate = |x: f64, v: f64| {
                let push = TRUTH[0].1 * (-((x - TRUTH[1].1) / TRUTH[2].1).powi(2)).exp();
                (force - push - 3.0 * v) / 2.0
            };
            let middle = v + 0.5 * h * rate(x, v);
            v += h * rate(x + 0.5 * h * v, middle);
            x += h * middle;
        }
    }
    csv(&[("y", &y), ("u", &u)])
}

fn desk() -> Desk {
    let desk = Desk::new();
    let mut description = head(1.0 / STEP);
    for (seed, (file, purpose)) in [("a.csv", "estimation"), ("b.csv", "validation")]
        .into_iter()
        .enumerate()
    {
        desk.write(file, record(seed as u64 + 1));
        description += &entry(file, None, purpose);
    }
    desk.write("experiment.toml", description);
    desk.write("own.toml", of_the_page());
    desk
}

#[test]
fn an_effect_of_the_user_is_found_kept_and_validated() {
    let desk = desk();
    // The second has no number anywhere.
    let never = "\n[[effect]]\nname = \"never\"\nforce = \"b*sqrt(x - 10)\"\nparameters.b.unit = \"u\"\n";
    desk.write("own.toml", of_the_page() + never);
    let found = desk.json("diagnose . --effects own.toml -o found --json");
    let untried = |r: &serde_json::Value| {
        r.as_str()
            .is_some_and(|r| r.starts_with("`never` at u was not tried"))
    };
    assert!(
        found["reasons"].as_array().unwrap().iter().any(untried),
        "{}",
        found["reasons"]
    );
    let effects = found["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 1, "{}", found["verdict_in_words"]);
    assert_eq!(effects[0]["effect"], "rail-joint");
    assert_eq!(effects[0]["definition"]["force"], "-a*exp(-((x - at)/width)^2)");
    for (name, truth) in TRUTH {
        let value = effects[0]["parameters"][name]["value"].as_f64().unwrap();
        assert!(
            (value.abs() / truth - 1.0).abs() < 0.05,
            "{name} {value} for {truth}"
        );
    }
    let words = found["verdict_in_words"].as_str().unwrap();
    assert!(
        words.contains("rail-joint at u (a ") && words.starts_with("explained"),
        "{words}"
    );
    // The file of the model needs no other.
    std::fs::remove_file(desk.path("own.toml")).unwrap();
    let again = desk.json("validate found/model.json . --json");
    assert!(!again["records"].as_array().unwrap().is_empty());
    // Without it nothing of the catalogue says it all.
    let without = desk.json("diagnose . -o without --json");
    assert_ne!(without["verdict"], "explained", "{}", without["verdict_in_words"]);
}

/// A single table, a unit in the place of a table, and faults that no bundle is needed to see.
#[test]
fn short_forms_are_read_and_faults_name_the_file() {
    let desk = desk();
    let text = "[effect]\nname = \"pull\"\nforce = \"-a*z\"\nparameters.a = \"u\"\nstates.z = \"x - z\"\n";
    desk.write("own.toml", text);
    let found = desk.json("diagnose . --effects own.toml -o found --json");
    let all = found["candidates"].as_array().unwrap();
    assert!(all.iter().any(|c| c["effect"] == "pull"), "{found}");
    for (from, to, part) in [
        (
            "parameters.a = \"u\"",
            "parameters.a = 3.0",
            "a unit, or a table with `unit`",
        ),
        ("x - z", "x - (z", "own.toml"),
        ("-a*z", "-a*", "own.toml"),
        ("\"pull\"", "\"Pull!\"", "own.toml"),
        (text, "effect = []\n", "it has no effect"),
    ] {
        desk.write("own.toml", text.replacen(from, to, 1));
        let said = desk.refused("diagnose . --effects own.toml -o other");
        assert!(said.contains(part), "{part} in {said}");
    }
}

#[test]
fn a_wrong_definition_is_refused_with_its_place() {
    let desk = desk();
    let whole = of_the_page();
    for (from, to, parts) in [
        ("force = ", "farce = ", ["own.toml", "line 5", "nearest: `force`"]),
        (
            "\"-a*exp(-((x",
            "\"-a*exp(-((z",
            ["`rail-joint`", "has `z`", "none of t, x"],
        ),
        (
            "\"-a*exp(-((x",
            "\"-a*exp(-((p",
            ["`rail-joint`", "has `p`", "[channels.scheduling]"],
        ),
        (
            "\"-a*exp(",
            "\"-a*sign(",
            ["`rail-joint`", "`sign` is no function", "write `signum`"],
        ),
        (
            "family = \"position-force\"",
            "channel = \"w\"",
            ["no input `w`", "it has u", "nearest: `u`"],
        ),
        (
            "name = \"rail-joint\"",
            "name = \"cogging\"",
            ["`cogging`", "the catalogue has", "choose another"],
        ),
    ] {
        assert!(whole.contains(from), "{from}");
        desk.write("own.toml", whole.replacen(from, to, 1));
        let text = desk.refused("diagnose . --effects own.toml -o found");
        for part in parts {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert!(!desk.path("found").exists());
    }
}
