//! Signals that a file has twice, once to fit and once to judge: `uEst` and `uVal`, `u` and `u_val`.

use experiment_data::Column;
use std::collections::HashMap;

pub(super) const ESTIMATION: [&str; 7] = [
    "est",
    "estimation",
    "id",
    "ident",
    "identification",
    "train",
    "training",
];
pub(super) const VALIDATION: [&str; 5] = ["val", "valid", "validation", "test", "verification"];

/// The same signals of two records, by the names that both share.
#[derive(Debug, PartialEq)]
pub(super) struct Pair {
    pub(super) estimation: Vec<Column>,
    pub(super) validation: Vec<Column>,
    /// The names in the file of the validation columns.
    pub(super) held_out: Vec<String>,
}

/// The columns by record, if each of at least two validation columns has its partner. Columns that neither word marks, such as
/// the time, are in both.
pub(super) fn split(columns: &[Column]) -> Option<Pair> {
    let (mut fitted, mut held, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    for column in columns {
        match marked(&column.name) {
            Some((base, true)) => held.push((base, column)),
            Some((base, false)) => fitted.push((base, column)),
            None => plain.push((column.name.clone(), column)),
        }
    }
    if held.len() < 2 {
        return None;
    }
    let held_out = held.iter().map(|(_, c)| c.name.clone()).collect();
    let has = |side: &[(String, &Column)], base: &String| side.iter().any(|(b, _)| b == base);
    let partnered = if fitted.is_empty() {
        // `u` and `u_val`: the partners are among those without a word.
        let (partners, others): (Vec<_>, Vec<_>) = plain.into_iter().partition(|(name, _)| has(&held, name));
        (fitted, plain) = (partners, others);
        true
    } else {
        !plain.iter().any(|(name, _)| has(&held, name))
    };
    let twice = |side: &[(String, &Column)]| {
        let mut times: HashMap<&String, usize> = HashMap::new();
        side.iter().for_each(|(b, _)| *times.entry(b).or_default() += 1);
        times.values().any(|n| *n > 1)
    };
    let matched = partnered
        && fitted.len() == held.len()
        && held.iter().all(|(base, _)| has(&fitted, base))
        && !twice(&fitted)
        && !twice(&held);
    let one_length = |side: &[(String, &Column)]| side.windows(2).all(|w| w[0].1.rows == w[1].1.rows);
    if !matched || !one_length(&fitted) || !one_length(&held) {
        return None;
    }
    let renamed = |side: &[(String, &Column)]| -> Vec<Column> {
        let own = side.iter().map(|(base, column)| renamed(column, base));
        own.chain(plain.iter().map(|(_, c)| (*c).clone())).collect()
    };
    Some(Pair {
        estimation: renamed(&fitted),
        validation: renamed(&held),
        held_out,
    })
}

/// A column by another name, with where the file has it.
pub(super) fn renamed(column: &Column, name: &str) -> Column {
    let mut other = Column {
        name: name.to_owned(),
        ..column.clone()
    };
    if other.source.is_none() && name != column.name {
        other.source = Some(column.name.clone());
    }
    other
}

/// The name without the word that marks it, and whether that word says validation. The word stands first or last.
fn marked(name: &str) -> Option<(String, bool)> {
    let start = name.rfind('.').map_or(0, |at| at + 1);
    let words = words(&name[start..]);
    let ends = [words.last(), words.first()];
    let (word, is_validation) = ends.into_iter().flatten().find_map(|word| {
        let text = name[start..][word.clone()].to_lowercase();
        let is = |list: &[&str]| list.contains(&text.as_str());
        (is(&ESTIMATION) || is(&VALIDATION)).then(|| (word.clone(), is(&VALIDATION)))
    })?;
    let own = &name[start..];
    let separator = ['_', '-', ' '];
    let before = own[..word.start].trim_end_matches(separator);
    let behind = &own[word.end..];
    let behind = if before.is_empty() {
        behind.trim_start_matches(separator)
    } else {
        behind
    };
    (before.chars().chain(behind.chars()).any(char::is_alphabetic))
        .then(|| (format!("{}{before}{behind}", &name[..start]), is_validation))
}

/// Where the words of a name are: letters, apart at a capital behind a small letter.
fn words(name: &str) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    let mut small_before = false;
    for (at, c) in name.char_indices() {
        let end = at + c.len_utf8();
        if c.is_alphabetic() {
            match found.last_mut() {
                Some(word) if word.end == at && !(c.is_uppercase() && small_before) => word.end = end,
                _ => found.push(at..end),
            }
        }
        small_before = c.is_lowercase();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(names: &[(&str, u64)]) -> Vec<Column> {
        let column = |(name, rows): &(&str, u64)| Column {
            name: (*name).to_owned(),
            rows: *rows,
            unit: String::new(),
            source: None,
            is_stamp: false,
        };
        names.iter().map(column).collect()
    }

    fn names(columns: &[Column]) -> Vec<(&str, &str)> {
        columns
            .iter()
            .map(|c| (c.name.as_str(), c.source.as_deref().unwrap_or(&c.name)))
            .collect()
    }

    #[test]
    fn marks_by_hand() {
        for (name, base, is_validation) in [
            ("uEst", "u", false),
            ("uVal", "u", true),
            ("u_val", "u", true),
            ("u1_val", "u1", true),
            ("uVal1", "u1", true),
            ("val_y2", "y2", true),
            ("data.yTest", "data.y", true),
            ("y train", "y", false),
        ] {
            assert_eq!(marked(name), Some((base.to_owned(), is_validation)), "{name}");
        }
        for name in ["val", "u", "value", "interval", "contest", "", "u_1", "valve"] {
            assert_eq!(marked(name), None, "{name}");
        }
    }

    #[test]
    fn pairs_of_both_kinds() {
        let pair = split(&columns(&[
            ("t", 9),
            ("uEst", 9),
            ("uVal", 9),
            ("yEst", 9),
            ("yVal", 9),
        ]))
        .unwrap();
        assert_eq!(
            names(&pair.estimation),
            [("u", "uEst"), ("y", "yEst"), ("t", "t")]
        );
        assert_eq!(
            names(&pair.validation),
            [("u", "uVal"), ("y", "yVal"), ("t", "t")]
        );
        let pair = split(&columns(&[
            ("u", 9),
            ("y", 9),
            ("u_val", 5),
            ("y_val", 5),
            ("t", 9),
        ]))
        .unwrap();
        assert_eq!(names(&pair.estimation), [("u", "u"), ("y", "y"), ("t", "t")]);
        assert_eq!(
            names(&pair.validation),
            [("u", "u_val"), ("y", "y_val"), ("t", "t")]
        );
        for none in [
            &[("u", 9), ("y", 9), ("y_est", 9)][..],
            &[("u", 9), ("y", 9), ("y_val", 9)],
            &[("u_est", 9), ("u_val", 9), ("y_val", 9)],
            &[("u_est", 9), ("y_est", 9), ("u_val", 9), ("y_val", 9), ("u", 9)],
            &[("u_est", 9), ("y_est", 9), ("u_val", 9), ("y_val", 8)],
            &[],
        ] {
            assert_eq!(split(&columns(none)), None, "{none:?}");
        }
    }
}
