//! docs/experiment.schema.json is what the crate says, and is true of bundles.
use crate::common;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/experiment.schema.json")
}

fn schema() -> Value {
    serde_json::from_str(&experiment_data::schema()).unwrap()
}

#[test]
fn the_committed_schema_is_up_to_date() {
    if std::env::var_os("RENEW_DOCS").is_some() {
        std::fs::write(page(), experiment_data::schema()).unwrap();
    }
    let committed: Value =
        serde_json::from_str(&std::fs::read_to_string(page()).unwrap_or_default()).unwrap_or_default();
    assert!(
        committed == schema(),
        "docs/experiment.schema.json is not what the crate says; renew it with\n\
         RENEW_DOCS=1 cargo test -p experiment-data --test schema"
    );
}

/// What a value breaks: as much of JSON Schema as ours uses; anything else in it fails.
fn broken(schema: &Value, value: &Value, root: &Value) -> Option<String> {
    for (key, rule) in schema.as_object().unwrap() {
        let fine = match key.as_str() {
            "title" | "description" | "format" | "default" | "$defs" => true,
            "$ref" => {
                let target = root.pointer(&rule.as_str().unwrap()[1..]).unwrap();
                if let Some(text) = broken(target, value, root) {
                    return Some(text);
                }
                true
            }
            "type" => {
                let is = |name: &str| match name {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "number" => value.is_number(),
                    "integer" => value.is_i64() || value.is_u64(),
                    "null" => value.is_null(),
                    other => panic!("type {other}"),
                };
                let names = rule.as_array().cloned().unwrap_or_else(|| vec![rule.clone()]);
                names.iter().any(|name| is(name.as_str().unwrap()))
            }
            "const" => value == rule,
            "enum" => rule.as_array().unwrap().contains(value),
            "anyOf" | "oneOf" => {
                let rules = rule.as_array().unwrap();
                rules.iter().any(|r| broken(r, value, root).is_none())
            }
            "minimum" => value.as_f64().is_none_or(|v| v >= rule.as_f64().unwrap()),
            "exclusiveMinimum" => value.as_f64().is_none_or(|v| v > rule.as_f64().unwrap()),
            "minItems" => value
                .as_array()
                .is_none_or(|v| v.len() as u64 >= rule.as_u64().unwrap()),
            "items" => {
                let items = value.as_array().into_iter().flatten();
                if let Some(text) = items.filter_map(|v| broken(rule, v, root)).next() {
                    return Some(text);
                }
                true
            }
            "required" => {
                let names = rule.as_array().unwrap();
                names.iter().all(|n| value.get(n.as_str().unwrap()).is_some())
            }
            "properties" => {
                for (name, rule) in rule.as_object().unwrap() {
                    let inner = value.get(name).and_then(|v| broken(rule, v, root));
                    if let Some(text) = inner {
                        return Some(format!("{name}: {text}"));
                    }
                }
                true
            }
            "additionalProperties" => {
                assert_eq!(rule, &json!(false));
                let known = schema["properties"].as_object().unwrap();
                value
                    .as_object()
                    .is_none_or(|v| v.keys().all(|k| known.contains_key(k)))
            }
            other => panic!("the test does not know the rule {other}"),
        };
        if !fine {
            return Some(format!("{key} {rule} against {value}"));
        }
    }
    None
}

fn json_of(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Value>(text).unwrap()).unwrap()
}

#[test]
fn it_passes_what_the_reader_passes() {
    let schema = schema();
    let passes = |text: &str| assert_eq!(broken(&schema, &json_of(text), &schema), None);
    passes(common::TOML);
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let Ok(folders) = std::fs::read_dir(&shared) else {
        println!("skipped: {} is not there", shared.display());
        return;
    };
    let mut seen = 0;
    for folder in folders {
        let toml = folder.unwrap().path().join("experiment.toml");
        if let Ok(text) = std::fs::read_to_string(toml) {
            passes(&text);
            seen += 1;
        }
    }
    assert!(seen > 0);
}

#[test]
fn it_refuses_what_the_reader_refuses() {
    let schema = schema();
    for (from, to) in [
        ("format = 1", "format = 3"),
        ("format = 1\n", ""),
        ("name = \"small\"\n", ""),
        ("sample_rate = 20.0", "sample_rate = 0.0"),
        ("sample_rate", "sample_rat"),
        ("columns = [\"y1\", \"y2\"]\n", ""),
        ("columns = [\"y1\", \"y2\"]", "columns = \"y1\""),
        ("units", "unit"),
        ("limit = 100.0", "limit = -1.0"),
        ("limit", "limits"),
        ("denominator = [1.0, -0.9]", "denominator = [\"a\"]"),
        ("force_from_input", "force"),
        ("kind = \"periodic\"", "kind = \"steady\""),
        ("use = \"validation\"", "use = \"test\""),
        ("period = 40", "period = 1"),
        ("period = 40", "period = 40.5"),
        ("scale = [3.0]", "gain = [3.0]"),
    ] {
        let text = common::TOML.replacen(from, to, 1);
        assert_ne!(text, common::TOML);
        assert!(broken(&schema, &json_of(&text), &schema).is_some(), "{to}");
    }
}
