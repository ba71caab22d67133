//! Several runs of one machine in one file.

use super::names::words;
use super::pairs::renamed;
use experiment_data::Column;
use std::collections::BTreeMap;

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

/// The same of what is held out.
const HELD_OUT: [&str; 4] = ["val", "valid", "validation", "verification"];

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

/// The columns by run, where groups of a file hold the same signals and are runs: by their names, or because they are not equally long, as
/// the axes of one machine would be. Columns in no group are in all.
pub(super) fn split(columns: &[Column]) -> Option<Vec<Run>> {
    let (signals, single): (Vec<&Column>, Vec<&Column>) = columns.iter().partition(|c| c.rows > 1);
    if signals.len() < 4 {
        return None;
    }
    let ways: [Cut; 2] = [|name| name.rsplit_once('.'), |name| name.split_once('.')];
    ways.into_iter().find_map(|cut| {
        let mut groups: Vec<(&str, Vec<(&str, &Column)>)> = Vec::new();
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
        let names: Vec<&str> = groups.iter().map(|(group, _)| *group).collect();
        let are_runs = names.len() > 1
            && is_one_record
            && hold_the_same(groups.iter().map(|(_, held)| held.iter().map(|(leaf, _)| *leaf)))
            && groups[0].1.len() > 1
            && !names
                .iter()
                .chain(groups[0].1.iter().map(|(leaf, _)| leaf))
                .any(|n| is_of_axis(n))
            && (varying(&names).iter().all(|n| is_run(n)) || lengths.iter().any(|n| *n != lengths[0]));
        if !are_runs {
            return None;
        }
        let of_group = |(group, held): (&str, Vec<(&str, &Column)>)| {
            let own = held.into_iter().map(|(leaf, c)| renamed(c, leaf));
            let prefix = format!("{group}.");
            let numbers = single.iter().filter_map(|c| match c.name.strip_prefix(&prefix) {
                Some(leaf) => Some(renamed(c, leaf)),
                None => (!c.name.contains('.')).then(|| (*c).clone()),
            });
            Run {
                columns: own.chain(plain.iter().cloned()).chain(numbers).collect(),
                is_validation: words(group).iter().any(|w| HELD_OUT.contains(&w.as_str())),
                group: group.to_owned(),
            }
        };
        Some(groups.into_iter().map(of_group).collect())
    })
}

/// A name in two: the group, and the name in it.
type Cut = fn(&str) -> Option<(&str, &str)>;

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
    let all = words(name);
    let is_letter = all.len() > 1 && all.first().is_some_and(|w| LETTERS.contains(&w.as_str()));
    is_letter || all.iter().any(|w| AXES.contains(&w.as_str()))
}

fn is_run(group: &str) -> bool {
    words(group)
        .iter()
        .any(|w| RUNS.contains(&w.as_str()) || HELD_OUT.contains(&w.as_str()))
}

/// What to ask where the elements of one struct array hold the same signals, equally long: they are the axes of a machine, or runs.
pub(super) fn in_groups(outputs: &[String], inputs: &[String]) -> Option<String> {
    let mut groups: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for column in outputs.iter().chain(inputs) {
        let (group, leaf) = column.rsplit_once('.')?;
        groups.entry(group).or_default().push(leaf);
    }
    let is_element = |group: &&&str| {
        let number = group.strip_suffix(')').and_then(|g| g.rsplit_once('('));
        number.is_some_and(|(_, n)| n.parse::<usize>().is_ok())
    };
    let are_asked = groups.len() > 1
        && groups.keys().filter(is_element).count() == groups.len()
        && hold_the_same(groups.values().map(|leaves| leaves.iter().copied()));
    if !are_asked {
        return None;
    }
    let names: Vec<String> = groups.keys().map(|g| format!("`{g}`")).collect();
    let (group, _) = groups.first_key_value()?;
    let of_one = |column: &&String| column.rsplit_once('.').is_some_and(|(g, _)| g == *group);
    let columns: Vec<String> = outputs
        .iter()
        .chain(inputs)
        .filter(of_one)
        .filter_map(|c| Some(format!("{} = \"{c}\"", c.rsplit_once('.')?.1)))
        .collect();
    Some(format!(
        "records: {} hold the same signals: leave it so where they are axes of one machine; where they are runs of one, name the channels \
         without the group, and write one record a group with columns = {{ {} }} and so on",
        names.join(", "),
        columns.join(", ")
    ))
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
        let found = asked(&["data(1).y", "data(2).y"], &["data(1).u", "data(2).u"]).unwrap();
        assert!(
            found.contains("columns = { y = \"data(1).y\", u = \"data(1).u\" }"),
            "{found}"
        );
        // Axes, one group, other signals.
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
            split(&columns).map(|runs| runs.into_iter().map(run).collect())
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
