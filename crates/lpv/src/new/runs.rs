//! Several runs of one machine in one file.

use super::names::words;
use super::pairs::{ESTIMATION, VALIDATION, renamed};
use experiment_data::Column;
use std::collections::BTreeMap;

/// What groups of one file are that hold the same signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GroupsAre {
    /// Runs of one machine, a record each.
    Runs,
    /// Axes of one machine, measured together.
    Axes,
}

/// Words for a measurement, in the names of groups.
const RUNS: [&str; 14] = [
    "run",
    "runs",
    "exp",
    "experiment",
    "test",
    "trial",
    "take",
    "log",
    "meas",
    "measurement",
    "messung",
    "versuch",
    "fahrt",
    "essai",
];

/// The signals of one run.
#[derive(Debug, PartialEq)]
pub(super) struct Run {
    /// The group that holds them.
    pub(super) group: String,
    /// By their names in the group, and what is beside all groups.
    pub(super) columns: Vec<Column>,
    /// Whether its name says that it is held out.
    pub(super) is_validation: bool,
}

/// The columns by run, where groups of a file hold the same signals and are runs: as the user says, by their names, or because they are not
/// equally long, as the axes of one machine would be. Columns in no group are in all.
pub(super) fn split(columns: &[Column], known: Option<GroupsAre>) -> Option<Vec<Run>> {
    let (signals, single): (Vec<&Column>, Vec<&Column>) = columns.iter().partition(|c| c.rows > 1);
    if signals.len() < 4 {
        return None;
    }
    if known == Some(GroupsAre::Axes) {
        return None;
    }
    let is_repeated = signals.iter().any(|c| repeated(&c.name).is_some());
    let ways: [Cut; 3] = [
        |name| {
            name.rsplit_once('.')
                .map(|(group, leaf)| (group.to_owned(), leaf))
        },
        |name| name.split_once('.').map(|(group, leaf)| (group.to_owned(), leaf)),
        |name| Some(repeated(name).unwrap_or_else(|| ("1".to_owned(), name))),
    ];
    let ways = if is_repeated { &ways[2..] } else { &ways[..2] };
    ways.iter().find_map(|cut| {
        let mut groups: Vec<Group<'_>> = Vec::new();
        let mut plain = Vec::new();
        for column in &signals {
            match cut(&column.name) {
                Some((group, leaf)) => match groups.iter_mut().find(|(g, _)| *g == group) {
                    Some((_, held)) => held.push((leaf, column)),
                    None => groups.push((group, vec![(leaf, column)])),
                },
                None => plain.push((*column).clone()),
            }
        }
        let lengths: Vec<u64> = groups.iter().map(|(_, held)| held[0].1.rows).collect();
        let is_one_record = groups
            .iter()
            .all(|(_, held)| held.iter().all(|(_, c)| c.rows == held[0].1.rows));
        let names: Vec<&str> = groups.iter().map(|(group, _)| group.as_str()).collect();
        let same = names.len() > 1
            && is_one_record
            && hold_the_same(groups.iter().map(|(_, held)| held.iter().map(|(leaf, _)| *leaf)))
            && groups[0].1.len() > 1;
        let leaves = groups.first()?.1.iter().map(|(leaf, _)| leaf);
        let look_like_runs = || {
            !names.iter().chain(leaves).any(|n| is_of_axis(n))
                && (is_repeated
                    || varying(&names).iter().all(|n| is_run(n))
                    || lengths.iter().any(|n| *n != lengths[0]))
        };
        if !same || !(known == Some(GroupsAre::Runs) || look_like_runs()) {
            return None;
        }
        let has = |group: &str, list: &[&str]| words(group).iter().any(|w| list.contains(&w.as_str()));
        // A `test` beside a `train` is held out; `test 1`, `test 2` are measurements.
        let in_two = names.iter().any(|n| has(n, &ESTIMATION)) || !names.iter().all(|n| has(n, &VALIDATION));
        let held_out: Vec<bool> = names.iter().map(|n| in_two && has(n, &VALIDATION)).collect();
        let of_group = |((group, held), is_validation): (Group<'_>, bool)| {
            let own = held.into_iter().map(|(leaf, c)| renamed(c, leaf));
            let prefix = format!("{group}.");
            let numbers = single.iter().filter_map(|c| match c.name.strip_prefix(&prefix) {
                Some(leaf) => Some(renamed(c, leaf)),
                None => (!c.name.contains('.')).then(|| (*c).clone()),
            });
            Run {
                columns: own.chain(plain.iter().cloned()).chain(numbers).collect(),
                is_validation,
                group,
            }
        };
        Some(groups.into_iter().zip(held_out).map(of_group).collect())
    })
}

/// A group with its columns by their names in it.
type Group<'a> = (String, Vec<(&'a str, &'a Column)>);
/// A name in two: the group, and the name in it.
type Cut = fn(&str) -> Option<(String, &str)>;

/// The number and the name of a function that a file has once more: `force 1+Z #2`.
fn repeated(name: &str) -> Option<(String, &str)> {
    let (leaf, number) = name.rsplit_once(" #")?;
    number.parse::<usize>().ok().map(|n| (n.to_string(), leaf))
}

fn hold_the_same<'a>(groups: impl Iterator<Item = impl Iterator<Item = &'a str>>) -> bool {
    let mut sorted = groups.map(|leaves| {
        let mut all: Vec<&str> = leaves.collect();
        all.sort_unstable();
        all
    });
    let first = sorted.next();
    sorted.all(|leaves| Some(leaves) == first)
}

/// The level of the names that is not the same in all.
fn varying<'a>(names: &[&'a str]) -> Vec<&'a str> {
    let level = |name: &'a str, k: usize| name.split('.').nth(k).unwrap_or_default();
    let most = names.iter().map(|n| n.split('.').count()).max().unwrap_or(0);
    let differs = |k: &usize| names.iter().any(|n| level(n, *k) != level(names[0], *k));
    match (0..most).find(differs) {
        Some(k) => names.iter().map(|n| level(n, k)).collect(),
        None => names.to_vec(),
    }
}

/// Whether a name has the word for one of several axes.
fn is_of_axis(name: &str) -> bool {
    const AXES: [&str; 8] = [
        "axis", "axes", "achse", "axe", "motor", "joint", "drive", "gelenk",
    ];
    const LETTERS: [&str; 3] = ["x", "y", "z"];
    const UNITS: [&str; 6] = ["mm", "cm", "um", "µm", "deg", "mrad"];
    let all = words(name);
    let is_letter = all.len() > 1 && all.first().is_some_and(|w| LETTERS.contains(&w.as_str()));
    // `x100mm` is a place.
    let is_letter = is_letter && !all.iter().any(|w| UNITS.contains(&w.as_str()));
    is_letter || all.iter().any(|w| AXES.contains(&w.as_str()))
}

fn is_run(group: &str) -> bool {
    let lists = [&RUNS[..], &ESTIMATION, &VALIDATION];
    words(group)
        .iter()
        .any(|w| lists.iter().any(|list| list.contains(&w.as_str())))
}

/// What to ask where groups of one file hold the same signals, equally long: they are the axes of a machine, or runs.
pub(super) fn in_groups(outputs: &[String], inputs: &[String]) -> Option<String> {
    let mut groups: BTreeMap<&str, (Vec<&str>, [bool; 2])> = BTreeMap::new();
    for (columns, is_input) in [(outputs, false), (inputs, true)] {
        for column in columns {
            let (group, leaf) = column.rsplit_once('.')?;
            let (leaves, has) = groups.entry(group).or_default();
            leaves.push(leaf);
            has[usize::from(is_input)] = true;
        }
    }
    let names = groups
        .keys()
        .chain(groups.values().flat_map(|(leaves, _)| leaves));
    let are_asked = groups.len() > 1
        && groups.values().all(|(_, has)| *has == [true; 2])
        && hold_the_same(groups.values().map(|(leaves, _)| leaves.iter().copied()))
        && !names.into_iter().any(|n| is_of_axis(n));
    let names: Vec<String> = groups.keys().map(|g| format!("`{g}`")).collect();
    are_asked.then(|| {
        format!(
            "records: {} hold the same signals: give --groups runs where they are runs of one machine, --groups axes where they are its axes",
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_asked_about() {
        let asked = |outputs: &[&str], inputs: &[&str]| {
            let [outputs, inputs] =
                [outputs, inputs].map(|n| n.iter().map(ToString::to_string).collect::<Vec<_>>());
            in_groups(&outputs, &inputs)
        };
        for [a, b] in [
            ["data(1)", "data(2)"],
            ["Data 0", "Data 1"],
            ["m.x000mm", "m.x100mm"],
        ] {
            let of = |leaf: &str| [a, b].map(|group| format!("{group}.{leaf}"));
            let [outputs, inputs] = ["y", "u"].map(of);
            let [outputs, inputs] = [&outputs, &inputs].map(|n| n.each_ref().map(String::as_str));
            let found = asked(&outputs, &inputs).unwrap();
            assert!(found.contains("--groups runs"), "{found}");
        }
        // Axes, one group, other signals, signals apart by what they are.
        assert_eq!(asked(&["in.y1", "in.y2"], &["out.y1", "out.y2"]), None);
        assert_eq!(asked(&["axis1.y", "axis2.y"], &["axis1.u", "axis2.u"]), None);
        assert_eq!(asked(&["data(1).y"], &["data(1).u"]), None);
        assert_eq!(
            asked(&["data(1).y", "data(2).x"], &["data(1).u", "data(2).u"]),
            None
        );
        assert_eq!(asked(&["y"], &["u"]), None);
    }

    #[test]
    fn runs_are_records() {
        let found = |columns: &[(&str, u64)]| -> Option<Vec<(String, Vec<String>, bool)>> {
            let column = |(name, rows): &(&str, u64)| Column {
                name: (*name).to_owned(),
                rows: *rows,
                unit: String::new(),
                source: None,
                is_stamp: false,
            };
            let columns: Vec<Column> = columns.iter().map(column).collect();
            let own = |c: &Column| format!("{}={}", c.name, c.source.as_deref().unwrap_or(&c.name));
            let run = |r: Run| (r.group, r.columns.iter().map(own).collect(), r.is_validation);
            split(&columns, None).map(|runs| runs.into_iter().map(run).collect())
        };
        let runs = found(&[
            ("Run 0.y", 9),
            ("Run 0.u", 9),
            ("Run 1.y", 9),
            ("Run 1.u", 9),
            ("Run 1.p", 1),
            ("Run 0.p", 1),
        ])
        .unwrap();
        assert_eq!(runs[0].1, ["y=Run 0.y", "u=Run 0.u", "p=Run 0.p"]);
        assert_eq!((runs.len(), runs[1].0.as_str(), runs[1].2), (2, "Run 1", false));
        // Of other lengths, whatever they are called; nested; and one that is held out.
        let runs = found(&[
            ("d(1).y", 9),
            ("d(1).u", 9),
            ("d(2).y", 7),
            ("d(2).u", 7),
            ("fs", 1),
        ])
        .unwrap();
        assert_eq!(runs[1].1, ["y=d(2).y", "u=d(2).u", "fs=fs"]);
        let runs = found(&[("exp1.s.y", 9), ("exp1.in.u", 9), ("val.s.y", 7), ("val.in.u", 7)]).unwrap();
        assert_eq!((runs[1].0.as_str(), runs[1].2), ("val", true));
        assert_eq!(runs[0].1, ["s.y=exp1.s.y", "in.u=exp1.in.u"]);
        // What is fitted and what is held out, equally long; and functions that a file has once more.
        let runs = found(&[("train.y", 9), ("train.u", 9), ("test.y", 9), ("test.u", 9)]).unwrap();
        assert_eq!((runs[0].2, runs[1].2), (false, true));
        let runs = found(&[("test1.y", 9), ("test1.u", 9), ("test2.y", 9), ("test2.u", 9)]).unwrap();
        assert_eq!((runs[0].2, runs[1].2), (false, false));
        let runs = found(&[("f 1+Z", 9), ("pos 1+Z", 9), ("f 1+Z #2", 9), ("pos 1+Z #2", 9)]).unwrap();
        assert_eq!(runs[1].1, ["f 1+Z=f 1+Z #2", "pos 1+Z=pos 1+Z #2"]);
        for none in [
            &[("axis1.y", 9), ("axis1.u", 9), ("axis2.y", 9), ("axis2.u", 9)][..],
            &[("run1.y", 9), ("run1.u", 9), ("run2.y", 9), ("run2.x", 9)],
            &[("run1.y", 9), ("run1.u", 8), ("run2.y", 9), ("run2.u", 8)],
            &[("run1.y", 9), ("run2.y", 9), ("run3.y", 9), ("run4.y", 9)],
            &[("y", 9), ("u", 9), ("r", 9), ("t", 9)],
            &[
                ("exp1.Y(1).Data", 9),
                ("exp1.Y(2).Data", 9),
                ("exp1.Y(3).Data", 9),
                ("exp1.X.Data", 9),
            ],
        ] {
            assert_eq!(found(none), None, "{none:?}");
        }
    }
}
