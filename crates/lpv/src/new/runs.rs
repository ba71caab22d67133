//! Several runs of one machine in one file.

use super::names::words;
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

/// What to ask where groups of a file hold the same signals and are called runs: as the channels of one record they would make a machine
/// of as many axes.
pub(super) fn in_groups(outputs: &[String], inputs: &[String]) -> Option<String> {
    let mut groups: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for column in outputs.iter().chain(inputs) {
        let (group, leaf) = column.rsplit_once('.')?;
        groups.entry(group).or_default().push(leaf);
    }
    let mut held = groups.values().cloned().map(|mut leaves| {
        leaves.sort_unstable();
        leaves
    });
    let first = held.next()?;
    let are_runs = groups.len() > 1
        && held.all(|leaves| leaves == first)
        && groups
            .keys()
            .all(|g| words(g).iter().any(|w| RUNS.contains(&w.as_str())));
    if !are_runs {
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
        "records: {} hold the same signals, and by their names they are runs of one machine: name the channels without the group, and write \
         one record a group with columns = {{ {} }} and so on; only where they are axes of one machine leave it so",
        names.join(", "),
        columns.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::in_groups;

    #[test]
    fn runs_and_axes() {
        let asked = |outputs: &[&str], inputs: &[&str]| {
            let [outputs, inputs] =
                [outputs, inputs].map(|n| n.iter().map(ToString::to_string).collect::<Vec<_>>());
            in_groups(&outputs, &inputs)
        };
        let found = asked(&["Run 0.y", "Run 1.y"], &["Run 0.u", "Run 1.u"]).unwrap();
        assert!(
            found.contains("columns = { y = \"Run 0.y\", u = \"Run 0.u\" }"),
            "{found}"
        );
        assert!(asked(&["exp0.pos", "exp12.pos"], &["exp0.F", "exp12.F"]).is_some());
        // Axes, one group, other signals.
        assert_eq!(asked(&["axis1.y", "axis2.y"], &["axis1.u", "axis2.u"]), None);
        assert_eq!(asked(&["run1.y"], &["run1.u"]), None);
        assert_eq!(asked(&["run1.y", "run2.x"], &["run1.u", "run2.u"]), None);
        assert_eq!(asked(&["y"], &["u"]), None);
    }
}
