//! The table of what was asked for, and every case that is not as it should be.

use super::Entry;
use super::kinds::KINDS;
use crate::root;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// One row of the table.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Row {
    /// What is counted.
    what: &'static str,
    /// What was found.
    figure: String,
    /// What it is held against.
    bar: &'static str,
    /// Whether it holds; none of what was not run.
    holds: Option<bool>,
    /// What makes the row.
    command: &'static str,
}

/// Right of all, by kind.
fn by_kind<'a>(entries: impl Iterator<Item = &'a Entry>) -> BTreeMap<&'a str, [usize; 2]> {
    let mut kinds: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for e in entries {
        let counts = kinds.entry(&e.kind).or_default();
        counts[0] += usize::from(e.judged.is_right);
        counts[1] += 1;
    }
    kinds
}

fn part<'a>(entries: &'a [Entry], name: &'a str) -> impl Iterator<Item = &'a Entry> {
    entries.iter().filter(move |e| e.part == name)
}

/// The table.
pub(crate) fn rows(entries: &[Entry]) -> Vec<Row> {
    let ran = |name: &str| part(entries, name).next().is_some();
    let wrong = |name: &str| part(entries, name).filter(|e| !e.judged.is_right).count();
    let total = |name: &str| part(entries, name).count();
    let row = |what, figure, bar, holds, command| Row {
        what,
        figure,
        bar,
        holds,
        command,
    };
    let kinds = by_kind(part(entries, "kinds"));
    let whole = kinds
        .values()
        .filter(|[right, all]| *right as f64 >= 0.95 * *all as f64)
        .count();
    let right: usize = kinds.values().map(|c| c[0]).sum();
    let silent = part(entries, "kinds").filter(|e| e.judged.is_silent).count();
    let drafts = || part(entries, "kinds").filter(|e| KINDS.iter().any(|k| k.is_for_new && k.name == e.kind));
    let drafted = drafts().filter(|e| e.judged.is_right).count();
    let fuzz = fuzzed();
    let killed = total("kills");
    let ran_kinds = ran("kinds");
    vec![
        row(
            "kinds of misleading input: answer right, or the first line says what is wrong",
            format!(
                "{whole} of {} kinds with 95 % of their seeds; {right} of {} cases",
                kinds.len(),
                total("kinds")
            ),
            "40 of 40",
            ran_kinds.then_some(whole == kinds.len()),
            "`cargo xtask trust --only kinds`",
        ),
        row(
            "wrong model (error above 5 times the achievable) with exit code 0 and the verdict 'good'",
            format!("{silent} of {}", total("kinds")),
            "0",
            ran_kinds.then_some(silent == 0),
            "`cargo xtask trust --only kinds`",
        ),
        row(
            "good data called bad: clean machines of all sorts with a false verdict or a false warning",
            format!("{} of {}", wrong("clean"), total("clean")),
            "at most 1 %",
            ran("clean").then(|| wrong("clean") * 100 <= total("clean")),
            "`cargo xtask trust --only clean`",
        ),
        row(
            "`lpv new` finds rate, roles and positions without an edit, of files that hold them",
            format!("{drafted} of {}", drafts().count()),
            "all",
            ran_kinds.then(|| drafted == drafts().count()),
            "`cargo xtask trust --only kinds`",
        ),
        row(
            "hostile input: destroyed, executed, aborted, or above 1 GiB",
            format!("{} of {}", wrong("hostile"), total("hostile")),
            "0",
            ran("hostile").then(|| wrong("hostile") == 0),
            "`cargo xtask trust --only hostile`",
        ),
        row(
            "other units of y, u, p and time by 1e-12 to 1e12, p shifted by up to 1e6 ranges: another model, verdict or effect",
            format!("{} of {}", wrong("scales"), total("scales")),
            "0",
            ran("scales").then(|| wrong("scales") == 0),
            "`cargo xtask trust --only scales`",
        ),
        row(
            "fuzzing of readers, models, settings, machine files: panics, hangs, memory above 1 GiB",
            fuzz.as_ref().map_or("not there".to_owned(), |f| f.0.clone()),
            "none in 10^8 executions",
            fuzz.map(|f| f.1),
            "docs/metrics/fuzz.json",
        ),
        row(
            "killed at a random moment: something lost, or the next run fails",
            format!("{} of {} batches of 10 moments", wrong("kills"), killed),
            "0 in 500 moments",
            ran("kills").then(|| wrong("kills") == 0),
            "`cargo xtask trust --only kills`",
        ),
        row(
            "`cargo bench -- --list`: the regression core first, then all kernels",
            if wrong("bench") == 0 {
                "as said".to_owned()
            } else {
                "not so".to_owned()
            },
            "as said",
            ran("bench").then(|| wrong("bench") == 0),
            "`cargo xtask trust --only bench`",
        ),
    ]
}

/// What the account of the fuzzing says: its figure, and whether it holds.
fn fuzzed() -> Option<(String, bool)> {
    let text = std::fs::read_to_string(root().join("docs/metrics/fuzz.json")).ok()?;
    let json: Value = serde_json::from_str(&text).ok()?;
    let executions = json["total"].as_f64()?;
    let failures: f64 = json["findings"]
        .as_object()?
        .values()
        .filter_map(Value::as_f64)
        .sum();
    Some((
        format!("{failures} open, after {executions:.2e} executions of successive versions"),
        failures == 0.0 && executions >= 1e8,
    ))
}

fn word(holds: Option<bool>) -> &'static str {
    match holds {
        Some(true) => "holds",
        Some(false) => "BROKEN",
        None => "not run",
    }
}

/// The figures for a program.
pub(crate) fn metrics(rows: &[Row], entries: &[Entry]) -> Value {
    let counts = |name: &str| json!(by_kind(part(entries, name)));
    json!({
        "rows": rows,
        "kinds": counts("kinds"),
        "clean": counts("clean"),
        "hostile": counts("hostile"),
        "scales": counts("scales"),
        "kills": counts("kills"),
        "silent": part(entries, "kinds").filter(|e| e.judged.is_silent).map(name).collect::<Vec<_>>(),
    })
}

fn name(e: &Entry) -> String {
    format!("{} {}", e.kind, e.index)
}

/// A cell of a table: one line without bars, not too long.
fn cell(text: &str) -> String {
    let flat: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(200)
        .collect();
    flat.replace('|', "\\|")
}

/// The page.
pub(crate) fn page(rows: &[Row], entries: &[Entry], command: &str) -> String {
    let mut out = format!(
        "# What can be trusted\n\nMade by `{command}`. Each kind of input that has misled the program is made anew with random numbers over decades and a \
         truth known by construction; the program `lpv` gets it as a user would give it. The simulators and the judgement are the bench's own \
         (`xtask/src/trust`): nothing that it makes or compares comes from the code that estimates. A model is wrong where its error at the output, \
         root mean square over the excited lines and all positions, is above five times what the noise leaves to a fit of the right order.\n\n\
         | what | found | bar | verdict | made by |\n|---|---|---|---|---|\n"
    );
    for r in rows {
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} |",
            r.what,
            r.figure,
            r.bar,
            word(r.holds),
            r.command
        );
    }
    for (title, name) in [
        ("The kinds", "kinds"),
        ("Clean machines", "clean"),
        ("Hostile input", "hostile"),
        ("Units", "scales"),
        ("Killed runs", "kills"),
    ] {
        let kinds = by_kind(part(entries, name));
        if kinds.is_empty() {
            continue;
        }
        let _ = write!(out, "\n## {title}\n\n| kind | right | cases |\n|---|---|---|\n");
        for (kind, [right, all]) in &kinds {
            let _ = writeln!(out, "| {kind} | {right} | {all} |");
        }
    }
    let wrong: Vec<&Entry> = entries
        .iter()
        .filter(|e| e.part != "originals" && (!e.judged.is_right || e.judged.is_silent))
        .collect();
    if !wrong.is_empty() {
        let _ = write!(
            out,
            "\n## What is not right\n\nAt most three cases a kind; `cargo xtask trust --only KIND --first N --seeds 1 --keep` makes one again and keeps its \
             files. Error: of the model over the achievable.\n\n| case | command | said | right | error |\n|---|---|---|---|---|\n"
        );
        let mut shown: BTreeMap<(&str, &str), usize> = BTreeMap::new();
        for e in wrong {
            let count = shown.entry((&e.part, &e.kind)).or_default();
            *count += 1;
            if *count > 3 {
                continue;
            }
            let error = e.judged.error.map_or(String::new(), |r| format!("{r:.1e}"));
            let silent = if e.judged.is_silent { " (silent)" } else { "" };
            let _ = writeln!(
                out,
                "| {}{silent} | `{}` | {} | {} | {error} |",
                name(e),
                e.judged.command,
                cell(&e.judged.said),
                cell(&e.judged.wanted)
            );
        }
    }
    out
}

/// The table for the terminal, and the kinds that are not whole.
pub(crate) fn terminal(rows: &[Row], entries: &[Entry]) -> String {
    let mut out = String::new();
    for r in rows.iter().filter(|r| r.holds.is_some()) {
        let _ = writeln!(
            out,
            "{:8} {} (bar: {}): {}",
            word(r.holds),
            r.figure,
            r.bar,
            r.what
        );
    }
    for e in entries
        .iter()
        .filter(|e| !e.judged.is_right || e.judged.is_silent)
    {
        let error = e
            .judged
            .error
            .map_or(String::new(), |r| format!(" [error {r:.1e}]"));
        let silent = if e.judged.is_silent { " SILENT" } else { "" };
        let _ = writeln!(
            out,
            "{}/{}{silent}: {} -> {}{error}; right: {}",
            e.part,
            name(e),
            e.judged.command,
            cell(&e.judged.said),
            cell(&e.judged.wanted)
        );
    }
    out
}

/// Bars that the committed figures say are held and this run breaks: a row, or a kind that was whole.
pub(crate) fn broken(rows: &[Row], entries: &[Entry], kept: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(kept).unwrap_or_default();
    let kept: Value = serde_json::from_str(&text).unwrap_or(Value::Null);
    let mut all = Vec::new();
    for part_name in ["kinds", "hostile", "scales", "kills"] {
        for (kind, [right, total]) in by_kind(part(entries, part_name)) {
            let before = kept
                .get(part_name)
                .and_then(|p| p.get(kind))
                .and_then(Value::as_array);
            let was_whole = before.is_some_and(|c| c.len() == 2 && c[0] == c[1]);
            if was_whole && right < total {
                all.push(format!("{part_name}: {kind}, {right} of {total}"));
            }
        }
    }
    for (i, r) in rows.iter().enumerate() {
        let held = kept
            .get("rows")
            .and_then(|v| v.get(i))
            .and_then(|v| v.get("holds"));
        // Of few clean machines one is more than a hundredth.
        let counts_few = r.bar == "at most 1 %";
        if held == Some(&Value::Bool(true)) && r.holds == Some(false) && !counts_few {
            all.push(r.what.to_owned());
        }
    }
    all
}
