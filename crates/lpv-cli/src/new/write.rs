//! The text of the draft.

use super::roles::unit_of;
use super::{Groups, Known, RecordFile};
use std::fmt::Write as _;

/// The description, with a mark at every line that needs the user.
pub(super) fn text(
    name: &str,
    rate: Option<f64>,
    groups: &Groups,
    records: &[RecordFile],
    known: &Known,
    guesses: &mut Vec<String>,
    questions: &mut Vec<String>,
) -> String {
    let mut out = String::from(
        "# Drafted by `lpv new`. GUESS: told from names or data, look whether it is right. FILL IN: only you know.\n",
    );
    let _ = writeln!(out, "format = 1\nname = {}", quoted(name));
    let _ = match rate {
        Some(rate) => writeln!(out, "sample_rate = {rate:?}"),
        None => writeln!(out, "sample_rate = 0.0  # FILL IN: samples per second"),
    };
    for (role, group, given, needed) in [
        ("output", &groups.output, &known.output, true),
        ("input", &groups.input, &known.input, true),
        ("reference", &groups.reference, &known.reference, false),
        ("scheduling", &groups.scheduling, &known.scheduling, false),
        ("auxiliary", &groups.auxiliary, &Vec::new(), false),
    ] {
        if group.is_empty() && !needed {
            continue;
        }
        let mark = if group.is_empty() {
            let others: Vec<String> = groups.auxiliary.iter().map(|c| format!("`{c}`")).collect();
            let of = if others.is_empty() {
                String::new()
            } else {
                format!(" of {}", others.join(", "))
            };
            questions.push(format!(
                "channels.{role}: which columns{of} are the {role}s? Give --{role}"
            ));
            "  # FILL IN"
        } else if given.is_empty() {
            "  # GUESS"
        } else {
            ""
        };
        if mark == "  # GUESS" {
            guesses.push(format!("{role}: {}", group.join(", ")));
        }
        let _ = writeln!(out, "\n[channels.{role}]\ncolumns = {}{mark}", list(group));
        let units: Vec<&str> = group.iter().filter_map(|c| unit_of(c)).collect();
        if !group.is_empty() && units.len() == group.len() {
            let _ = writeln!(out, "units = {}", list(&units));
        }
    }
    out += "\n# A controller makes closed-loop simulation possible: coefficients of z^-k of u = B_r/A r - B_y/A y.\n\
            # [controller]\n# reference_numerator = [1.0]\n# feedback_numerator = [1.0]\n# denominator = [1.0]\n";
    for r in records {
        out += &record(r, groups, known, questions);
    }
    if known.period.is_none() {
        guesses.extend(periods(records));
    }
    out
}

/// One guess for all files of one period.
fn periods(records: &[RecordFile]) -> Vec<String> {
    let mut found: Vec<(usize, Vec<&str>)> = Vec::new();
    for r in records {
        let Some(period) = r.period else { continue };
        match found.iter_mut().find(|(p, _)| *p == period) {
            Some((_, files)) => files.push(&r.file),
            None => found.push((period, vec![&r.file])),
        }
    }
    found
        .into_iter()
        .map(|(period, files)| {
            let more = match files.len() {
                1 => String::new(),
                n => format!(" and {} more", n - 1),
            };
            format!("periods of {period} samples: {}{more}", files[0])
        })
        .collect()
}

fn record(r: &RecordFile, groups: &Groups, known: &Known, questions: &mut Vec<String>) -> String {
    let mut out = format!("\n[[records]]\nfile = {}\n", quoted(&r.file));
    let whole = r.period.filter(|p| r.rows.is_multiple_of(*p) && r.rows / p >= 2);
    let rests = groups
        .scheduling
        .iter()
        .all(|p| r.constant.iter().any(|(n, _)| n == p) || !r.columns.contains(p));
    match (whole, r.period) {
        (Some(period), _) if rests => {
            let mark = if known.period.is_some() { "" } else { "  # GUESS" };
            let _ = writeln!(out, "kind = \"periodic\"{mark}\nperiod = {period}{mark}");
        }
        (None, Some(period)) => {
            questions.push(format!(
                "{}: repeats after {period} samples, but its {} rows are no whole number of periods; cut {} rows from its end to use it as periodic",
                r.file,
                r.rows,
                r.rows % period
            ));
            let _ = writeln!(
                out,
                "kind = \"transient\"  # FILL IN: repeats after {period} samples, but not a whole number of times; cut its end and make it \"periodic\", or keep it"
            );
        }
        _ => {
            let _ = writeln!(out, "kind = \"transient\"");
        }
    }
    let held = r.validation || r.file.to_lowercase().contains("valid");
    let _ = writeln!(
        out,
        "use = \"{}\"",
        if held { "validation" } else { "estimation" }
    );
    out
}

fn list<S: AsRef<str>>(items: &[S]) -> String {
    let items: Vec<String> = items.iter().map(|i| quoted(i.as_ref())).collect();
    format!("[{}]", items.join(", "))
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
