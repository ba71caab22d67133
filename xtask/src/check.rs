//! The committed figures, and how far a run may be from them.

use crate::reproduce::write_json;
use crate::{TaskError, root};
use serde_json::Value;
use std::path::PathBuf;

/// How far a figure may be from the committed one.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Tolerance {
    /// Absolute.
    Absolute(f64),
    /// As a factor, either way.
    Factor(f64),
    /// Not compared: it depends on the machine or on data that may be missing.
    Free,
}

/// The first rule whose name is part of a figure's path applies. Another processor may round differently, so nothing
/// is compared bit by bit.
const RULES: [(&str, Tolerance); 11] = [
    ("seconds", Tolerance::Free),
    ("peak_rss", Tolerance::Free),
    ("worst_frequency_hz", Tolerance::Free),
    ("worst_response", Tolerance::Free),
    ("noise_free_max_rel", Tolerance::Factor(10.0)),
    ("direct_max_rel", Tolerance::Factor(100.0)),
    ("integration_error", Tolerance::Factor(10.0)),
    ("coverage95", Tolerance::Absolute(0.002)),
    ("_db", Tolerance::Absolute(0.3)),
    ("percent", Tolerance::Factor(1.1)),
    ("", Tolerance::Factor(1.05)),
];

fn committed(size: &str) -> PathBuf {
    root().join("docs/metrics").join(format!("{size}.json"))
}

fn size(metrics: &Value) -> &str {
    metrics["size"].as_str().unwrap_or("unknown")
}

/// Keeps the figures as the ones to compare with, and renews the table of docs/reproduction.md.
pub(crate) fn bless(metrics: &Value) -> Result<(), TaskError> {
    let file = committed(size(metrics));
    std::fs::create_dir_all(root().join("docs/metrics"))?;
    write_json(&file, metrics)?;
    if size(metrics) == "full" {
        let doc = root().join("docs/reproduction.md");
        let text = std::fs::read_to_string(&doc)?;
        std::fs::write(&doc, crate::page::with_table(&text, metrics)?)?;
    }
    println!("kept as {}", file.display());
    Ok(())
}

/// Compares with the committed figures and says what is off; true where nothing is.
pub(crate) fn check(metrics: &Value) -> Result<bool, TaskError> {
    let file = committed(size(metrics));
    let expected: Value = serde_json::from_str(
        &std::fs::read_to_string(&file)
            .map_err(|e| format!("{}: {e}; make it with --bless", file.display()))?,
    )?;
    if expected["seed"] != metrics["seed"] {
        return Err(format!(
            "the committed figures are for seed {}, this run has {}",
            expected["seed"], metrics["seed"]
        )
        .into());
    }
    let mut problems = Vec::new();
    let mut compared = 0;
    compare("", &expected, metrics, &mut problems, &mut compared);
    for p in &problems {
        println!("off: {p}");
    }
    println!(
        "check: {compared} figures compared with {}, {} off",
        file.display(),
        problems.len()
    );
    Ok(problems.is_empty() && compared > 0)
}

fn compare(path: &str, expected: &Value, found: &Value, problems: &mut Vec<String>, compared: &mut usize) {
    let rule = RULES
        .iter()
        .find(|(part, _)| path.contains(part))
        .map_or(Tolerance::Free, |r| r.1);
    // A bundle that is not at hand was not run.
    let not_run = found.is_null() && ["/machine_plain", "/two_mass_bench"].contains(&path);
    if rule == Tolerance::Free || not_run || path.ends_with("/reasons") {
        return;
    }
    match (expected, found) {
        (Value::Object(e), Value::Object(f)) => {
            for (key, value) in e {
                compare(
                    &format!("{path}/{key}"),
                    value,
                    f.get(key).unwrap_or(&Value::Null),
                    problems,
                    compared,
                );
            }
        }
        (Value::Array(e), Value::Array(f)) => {
            for (i, value) in e.iter().enumerate() {
                compare(
                    &format!("{path}/{i}"),
                    value,
                    f.get(i).unwrap_or(&Value::Null),
                    problems,
                    compared,
                );
            }
        }
        (Value::Number(e), Value::Number(f)) => {
            *compared += 1;
            let (e, f) = (e.as_f64().unwrap_or(f64::NAN), f.as_f64().unwrap_or(f64::NAN));
            let within = match rule {
                Tolerance::Absolute(by) => (e - f).abs() <= by,
                Tolerance::Factor(by) => e == f || (e * f > 0.0 && e / f <= by && f / e <= by),
                Tolerance::Free => true,
            };
            if !within {
                problems.push(format!("{path}: {f} instead of {e} ({rule:?})"));
            }
        }
        _ => {
            *compared += 1;
            if expected != found {
                problems.push(format!("{path}: {found} instead of {expected}"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn tolerances_hold_and_are_held() {
        let run = |a: Value, b: Value| {
            let (mut problems, mut compared) = (Vec::new(), 0);
            compare("", &a, &b, &mut problems, &mut compared);
            (problems.len(), compared)
        };
        assert_eq!(run(json!({"a_db": -14.0}), json!({"a_db": -14.2})), (0, 1));
        assert_eq!(run(json!({"a_db": -14.0}), json!({"a_db": -13.2})), (1, 1));
        assert_eq!(run(json!({"lfr": {"states": 36}}), json!({"lfr": {}})), (1, 1));
        assert_eq!(
            run(json!({"wall_seconds": 1.0}), json!({"wall_seconds": 100.0})),
            (0, 0)
        );
        assert_eq!(run(json!([1.0, 2.0]), json!([1.0, -2.0])), (1, 2));
    }
}
