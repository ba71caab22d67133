//! The text of the draft.

use super::motion::quantity_of;
use super::names::unit_of;
use super::position::Places;
use super::roles::{Role, role_of};
use super::time_unit::seconds;
use super::{Plan, RecordFile};
use experiment_data::{Quantity, Text};
use std::collections::HashSet;
use std::fmt::Write as _;

/// First line of every draft.
pub(super) const HEAD: &str = "# Drafted by `lpv new`. GUESS: told from names or data, look whether it is right. FILL IN: only you know.\n";

/// The description, with a mark at every line that needs the user.
pub(super) fn text(plan: &Plan<'_>, guesses: &mut Vec<String>, questions: &mut Vec<String>) -> String {
    let (groups, known) = (&plan.groups, plan.known);
    let mut out = HEAD.to_owned();
    let used = |r: &RecordFile| r.part().is_some() || !r.sources.is_empty();
    let quantities: Vec<(Quantity, &str)> = groups
        .output
        .iter()
        .map(|c| (quantity_of(c, plan.unit(c)), plan.unit(c)))
        .collect();
    let by_name = quantities
        .iter()
        .any(|(own, unit)| *own != Quantity::of_unit(unit));
    let second = by_name || plan.text.is_some() || plan.records.iter().any(used);
    let format = if second { 2 } else { 1 };
    let _ = writeln!(out, "format = {format}\nname = {}", quoted(&plan.name));
    let _ = match (plan.rate, plan.rates.as_slice()) {
        (Some(rate), []) => writeln!(out, "sample_rate = {rate:?}"),
        (Some(rate), [other, ..]) => writeln!(
            out,
            "sample_rate = {rate:?}  # GUESS: {other} if the time is in milliseconds"
        ),
        (None, []) => writeln!(out, "sample_rate = 0.0  # FILL IN: samples per second"),
        (None, rates) => {
            let rates: Vec<String> = rates.iter().map(ToString::to_string).collect();
            writeln!(out, "sample_rate = 0.0  # FILL IN: {}", rates.join(" or "))
        }
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
            let is_signal = |c: &&String| role_of(c) != Some(Role::Time) && seconds(plan.unit(c)).is_none();
            let others: Vec<String> = groups
                .auxiliary
                .iter()
                .filter(is_signal)
                .map(|c| format!("`{c}`"))
                .collect();
            questions.push(match others.is_empty() {
                true => format!("channels.{role}: no column is left that could be one; see above which were passed over, and why"),
                false => format!("channels.{role}: which columns of {} are the {role}s? Give --{role}", others.join(", ")),
            });
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
        let units: Vec<&str> = group.iter().map(|c| plan.unit(c)).collect();
        let enough = if role == "auxiliary" {
            units.iter().any(|u| !u.is_empty())
        } else {
            units.iter().all(|u| !u.is_empty())
        };
        if role == "output" && by_name {
            let names: Vec<&str> = quantities.iter().map(|(own, _)| own.name()).collect();
            guesses.push(format!("what the outputs are: {}", names.join(", ")));
            let _ = writeln!(out, "quantity = {}  # GUESS", list(&names));
        }
        if !group.is_empty() && enough {
            let _ = writeln!(out, "units = {}", list(&units));
        }
    }
    out += "\n# A controller makes closed-loop simulation possible: coefficients of z^-k of u = B_r/A r - B_y/A y.\n\
            # [controller]\n# reference_numerator = [1.0]\n# feedback_numerator = [1.0]\n# denominator = [1.0]\n";
    if let Some(text) = &plan.text {
        out += &layout(text);
    }
    if let Some(number) = plan.places.as_ref().and_then(|p| p.number.as_ref()) {
        guesses.push(format!(
            "`{number}`, a single number in each file, is the position of its record"
        ));
    } else if plan.places.is_some() {
        questions.push(
            "position: the names of the files differ in a number, and no column tells the place; if they were measured at \
             different places, write `position = ...` in each record, else take these lines out"
                .to_owned(),
        );
    }
    for (k, r) in plan.records.iter().enumerate() {
        out += &record(
            r,
            plan,
            plan.places.as_ref().and_then(|p| Some((p, p.values.get(k)?))),
        );
    }
    if known.period.is_none() {
        guesses.extend(periods(&plan.records));
    }
    out
}

impl Plan<'_> {
    fn unit<'a>(&'a self, column: &'a str) -> &'a str {
        let own = self.units.iter().rev().find(|(name, _)| name == column);
        own.map_or_else(|| unit_of(column).unwrap_or(""), |(_, unit)| unit)
    }
}

/// `[text]`, as far as it was found.
pub(super) fn layout(text: &Text) -> String {
    let mut out = String::from("\n[text]\n");
    if let Some(separator) = text.separator {
        let _ = writeln!(out, "separator = {}", quoted(&separator.character().to_string()));
    }
    if let Some(decimal) = text.decimal {
        let _ = writeln!(out, "decimal = {}", quoted(&decimal.character().to_string()));
    }
    if let Some(header) = text.header {
        let _ = writeln!(out, "header = {header}");
    }
    if !text.names.is_empty() {
        let _ = writeln!(out, "names = {}", list(&text.names));
    }
    if let Some(row) = text.units_row {
        let _ = writeln!(out, "units_row = {row}");
    }
    if !text.skip.is_empty() {
        let _ = writeln!(out, "skip = {:?}", text.skip);
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

fn record(r: &RecordFile, plan: &Plan<'_>, place: Option<(&Places, &String)>) -> String {
    let (groups, known) = (&plan.groups, plan.known);
    let mut out = format!("\n[[records]]\nfile = {}\n", quoted(&r.file));
    let rows = r.part().map_or(r.rows, |[first, last]| last - first + 1);
    let whole = r.period.filter(|p| rows.is_multiple_of(*p) && rows / p >= 2);
    let rests = groups
        .scheduling
        .iter()
        .all(|p| r.rests(p) || !r.columns.contains(p));
    match whole {
        Some(period) if rests => {
            let mark = if known.period.is_some() { "" } else { "  # GUESS" };
            let _ = writeln!(out, "kind = \"periodic\"{mark}\nperiod = {period}{mark}");
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
    if let Some([first, last]) = r.part() {
        let _ = writeln!(out, "rows = [{first}, {last}]  # GUESS");
    }
    let channels: HashSet<&String> = [
        &groups.output,
        &groups.input,
        &groups.reference,
        &groups.scheduling,
        &groups.auxiliary,
    ]
    .into_iter()
    .flatten()
    .collect();
    let sources: Vec<String> = r
        .sources
        .iter()
        .filter(|(name, _)| channels.contains(name))
        .map(|(name, source)| format!("{} = {}", quoted(name), quoted(source)))
        .collect();
    if !sources.is_empty() {
        let _ = writeln!(out, "columns = {{ {} }}", sources.join(", "));
    }
    if let Some((places, value)) = place {
        let _ = match places.number {
            Some(_) => writeln!(out, "position = {value}  # GUESS"),
            None => writeln!(out, "# position = {value}  # FILL IN: the place, if it is one"),
        };
    }
    out
}

pub(super) fn list<S: AsRef<str>>(items: &[S]) -> String {
    let items: Vec<String> = items.iter().map(|i| quoted(i.as_ref())).collect();
    format!("[{}]", items.join(", "))
}

/// A TOML string, also as a key.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
