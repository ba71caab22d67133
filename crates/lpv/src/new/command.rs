//! The command that completes a draft.

use super::{GroupsAre, Known, Plan};
use std::path::PathBuf;

/// More files than this are not repeated.
const MOST_FILES: usize = 6;

/// What to type where options can give what is missing: the same files and options, and a word in capitals for each fact that
/// only the user knows.
pub(super) fn to_complete(files: &[PathBuf], plan: &Plan<'_>) -> Option<String> {
    let known: &Known = plan.known;
    if plan.rates_differ {
        return None;
    }
    let mut options = String::new();
    if plan.rate.is_none() {
        options += " --sample-rate HZ";
    }
    for (option, group) in [("--output", &plan.groups.output), ("--input", &plan.groups.input)] {
        if group.is_empty() {
            options += &format!(" {option} COLUMN");
        }
    }
    if options.is_empty() {
        return None;
    }
    let mut given = String::new();
    for (option, columns) in [
        ("--output", &known.output),
        ("--input", &known.input),
        ("--reference", &known.reference),
        ("--scheduling", &known.scheduling),
    ] {
        if !columns.is_empty() {
            given += &format!(" {option} {}", quoted(&columns.join(",")));
        }
    }
    if let Some(hz) = known.sample_rate_hz {
        given += &format!(" --sample-rate {hz}");
    }
    if let Some(period) = known.period {
        given += &format!(" --period {period}");
    }
    if let Some(groups) = known.groups {
        let are = match groups {
            GroupsAre::Runs => "runs",
            GroupsAre::Axes => "axes",
        };
        given += &format!(" --groups {are}");
    }
    if let Some(name) = &known.name {
        given += &format!(" --name {}", quoted(name));
    }
    for file in &known.validation {
        given += &format!(" --validation {}", quoted(&file.to_string_lossy()));
    }
    let names: Vec<String> = if files.len() > MOST_FILES {
        vec!["FILES".to_owned()]
    } else {
        files.iter().map(|f| quoted(&f.to_string_lossy())).collect()
    };
    Some(format!("lpv new {}{given}{options} --force", names.join(" ")))
}

/// A word of a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_-./,:=+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) && !word.starts_with('-') {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_shell() {
        for (word, text) in [
            ("a/b.csv", "a/b.csv"),
            ("data(:,3)", "'data(:,3)'"),
            ("a b", "'a b'"),
            ("it's", r"'it'\''s'"),
            ("$(x)", "'$(x)'"),
            ("-x", "'-x'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(word), text);
        }
    }
}
