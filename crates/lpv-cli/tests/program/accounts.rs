//! What `--json` prints is what the schema of the command says.

use crate::common::{Desk, csv, entry, head, machine_bundle, mode_bundle, mode_record};
use serde_json::Value;

fn schema(desk: &Desk, command: &str) -> Value {
    serde_json::from_str(&desk.done(&format!("schema --of {command}"))).unwrap()
}

/// The keys of an object that its schema does not name.
fn unnamed(account: &Value, schema: &Value) -> Vec<String> {
    let named = schema["properties"].as_object().unwrap();
    let keys = account.as_object().unwrap().keys();
    keys.filter(|k| !named.contains_key(*k)).cloned().collect()
}

/// Runs a command with `--json`, and holds what it prints against its schema.
#[track_caller]
fn holds(desk: &Desk, line: &str) -> Value {
    let command = line.split(' ').next().unwrap();
    let account: Value = serde_json::from_str(&desk.judged(&format!("{line} --json"))).unwrap();
    let schema = schema(desk, command);
    assert_eq!(
        account["schema"], schema["properties"]["schema"]["const"],
        "{line}"
    );
    let check = jsonschema::validator_for(&schema).unwrap();
    let wrong: Vec<String> = check
        .iter_errors(&account)
        .map(|e| format!("{}: {e}", e.instance_path()))
        .collect();
    assert!(wrong.is_empty(), "{line}: {wrong:#?}");
    assert_eq!(unnamed(&account, &schema), Vec::<String>::new(), "{line}");
    // The schema asks for something: each key that it requires is missed.
    for key in schema["required"].as_array().unwrap() {
        let mut less = account.clone();
        less.as_object_mut().unwrap().remove(key.as_str().unwrap());
        assert!(!check.is_valid(&less), "{line}: {key} is not missed");
    }
    account
}

#[test]
fn every_command_prints_what_its_schema_says() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let (u, y) = mode_record();
    desk.write("alone/run.csv", csv(&[("u", &u), ("y", &y)]));
    for line in [
        "new alone/run.csv --input u --output y --sample-rate 10",
        "new alone/run.csv --force",
        "simulate --machine machine.toml --hide coulomb-friction -o hidden",
        "inspect bundle",
        "identify bundle -o result/model.json",
        "validate result/model.json bundle --all",
        "diagnose hidden -o found",
        "convert result/model.json --to mat -o model.mat",
        "report result",
    ] {
        holds(&desk, line);
    }
}

#[test]
fn so_do_records_in_time_axes_and_a_single_position() {
    let desk = Desk::new();
    mode_bundle(&desk, "one");
    holds(&desk, "inspect one");
    holds(&desk, "identify one -o one.json");
    holds(&desk, "validate one.json one --all");
    let (u, y) = mode_record();
    desk.write("time/run.csv", csv(&[("u", &u), ("y", &y)]));
    desk.write(
        "time/experiment.toml",
        head(10.0) + &entry("run.csv", None, "estimation"),
    );
    desk.write("order.toml", "order = 2\n");
    holds(&desk, "inspect time");
    holds(&desk, "identify time -o time.json --config order.toml");
    holds(&desk, "validate time.json time --all");
    holds(&desk, "identify time -o axis.json --structure rigid-body");
    holds(&desk, "validate axis.json time --all");
}

#[test]
fn the_name_of_the_schema_comes_first() {
    let desk = Desk::new();
    mode_bundle(&desk, "one");
    let text = desk.done("inspect one --json");
    assert!(text.starts_with("{\n  \"schema\": \"lpv-inspect/1\","), "{text}");
    // The file of a diagnosis keeps the keys of its own format.
    machine_bundle(&desk);
    let printed: Value = serde_json::from_str(&desk.judged("diagnose bundle -o found --json")).unwrap();
    let mut kept: Value = serde_json::from_str(&desk.text("found/diagnosis.json")).unwrap();
    assert!(kept.get("schema").is_none());
    kept["schema"] = "lpv-diagnose/1".into();
    assert_eq!(printed, kept);
}
