//! Which column is the position on which the dynamics depend.

use super::roles::{Role, is_no_position, role_of};
use super::see::Seen;
use super::{RecordFile, stated};

/// No machine is scheduled by more signals.
const MOST_TAKEN: usize = 64;

/// The place of each record.
pub(super) struct Places {
    /// The number beside the signals that tells it; none where the names of the files may.
    pub(super) number: Option<String>,
    pub(super) values: Vec<String>,
}

/// The columns that rest in every file and differ between files. Of several, those whose names speak of a position; and of
/// columns that tell the same twice, the first.
pub(super) fn resting_columns(candidates: &[String], records: &[RecordFile]) -> Vec<String> {
    if records.len() < 2 {
        return Vec::new();
    }
    let resting: Vec<(&String, Vec<f64>)> = candidates
        .iter()
        .filter(|name| !is_no_position(name))
        .filter_map(|name| Some((name, values(name, records)?)))
        .collect();
    // The smaller the surer: a scheduling name, a name of a position, any name.
    let rank = |name: &str| match role_of(name) {
        Some(Role::Scheduling) => 0,
        Some(Role::Output) => 1,
        Some(Role::Reference) => 2,
        _ => 3,
    };
    let Some(best) = resting.iter().map(|(name, _)| rank(name)).min() else {
        return Vec::new();
    };
    let mut taken: Vec<(&String, Vec<f64>)> = Vec::new();
    for (name, values) in resting {
        if taken.len() == MOST_TAKEN {
            break;
        }
        if rank(name) == best && !taken.iter().any(|(_, earlier)| is_same(earlier, &values)) {
            taken.push((name, values));
        }
    }
    taken.into_iter().map(|(name, _)| name.clone()).collect()
}

/// Where the column rests in each file; none if it moves in one, or rests at the same place in all.
fn values(name: &str, records: &[RecordFile]) -> Option<Vec<f64>> {
    // What moves in a file of its own, as a move between the places does, says nothing against the others.
    let seen: Vec<(f64, f64, f64)> = records
        .iter()
        .map(|r| r.ranges.get(name).copied())
        .collect::<Option<_>>()?;
    let largest = seen.iter().map(|(_, mean, _)| mean.abs()).fold(0.0, f64::max);
    let rests = |&(low, _, high): &(f64, f64, f64)| high - low <= 1e-3 * largest || low == high;
    let moving = records
        .iter()
        .zip(&seen)
        .filter(|(_, s)| !rests(s))
        .map(|(r, _)| r);
    if moving.clone().any(|r| r.period.is_some()) || moving.count() + 2 > seen.len() {
        return None;
    }
    let resting: Vec<&(f64, f64, f64)> = seen.iter().filter(|s| rests(s)).collect();
    let scatter = resting
        .iter()
        .map(|(low, _, high)| high - low)
        .fold(0.0, f64::max);
    let means: Vec<f64> = resting.iter().map(|(_, mean, _)| *mean).collect();
    let (low, high) = lpv_numerics::statistics::range(&means);
    (high - low > 2.0 * scatter && high > low).then_some(means)
}

/// Whether one column is the other with another scale and offset.
fn is_same(a: &[f64], b: &[f64]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let centred = |x: &[f64]| {
        let mean = lpv_numerics::statistics::mean(x);
        x.iter().map(|v| v - mean).collect::<Vec<_>>()
    };
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(p, q)| p * q).sum::<f64>();
    let (a, b) = (centred(a), centred(b));
    dot(&a, &b).powi(2) >= (1.0 - 1e-6) * dot(&a, &a) * dot(&b, &b)
}

/// Where each file was measured: by a single number of each, else by its name.
pub(super) fn of_files(names: &[String], seen: &[Seen]) -> Option<Places> {
    let in_numbers = || {
        let (number, values) = place_in_numbers(seen)?;
        let values = values.iter().map(|v| format!("{v:?}")).collect();
        Some(Places {
            number: Some(number),
            values,
        })
    };
    let by_name = || in_names(names).map(|values| Places { number: None, values });
    in_numbers().or_else(by_name)
}

/// The single number that all files have, with another value in some, and a name that speaks of a place; none where two do.
fn place_in_numbers(seen: &[Seen]) -> Option<(String, Vec<f64>)> {
    let speaks = |name: &str| {
        let role = role_of(name);
        matches!(role, Some(Role::Scheduling | Role::Output | Role::Reference))
            && !is_no_position(name)
            && !stated::is_clock(name)
    };
    let values_of = |name: &str| -> Option<Vec<f64>> {
        let of = |s: &Seen| s.scalars.iter().find(|n| n.name == name).map(|n| n.value);
        let values: Vec<f64> = seen.iter().map(of).collect::<Option<_>>()?;
        values.iter().any(|v| *v != values[0]).then_some(values)
    };
    let named = seen.first()?.scalars.iter().filter(|n| speaks(&n.name));
    let mut found = named.filter_map(|n| Some((n.name.clone(), values_of(&n.name)?)));
    let first = found.next()?;
    found.next().is_none().then_some(first)
}

/// What the names of the files, or else of their folders, say about the position, as a question: the part of each name that differs, if
/// it looks like a place.
pub(super) fn in_names(files: &[String]) -> Option<Vec<String>> {
    let stems: Vec<Vec<&str>> = files
        .iter()
        .map(|file| {
            let stem = file.rsplit_once('.').map_or(file.as_str(), |(stem, _)| stem);
            stem.rsplit('/').collect()
        })
        .collect();
    let depth = stems.iter().map(Vec::len).min()?;
    (0..depth).find_map(|d| places_in(&stems.iter().map(|s| s[d]).collect::<Vec<_>>()))
}

fn places_in(stems: &[&str]) -> Option<Vec<String>> {
    let numbers = |stem: &&str| -> Vec<(String, String)> {
        let mut found: Vec<(String, String)> = Vec::new();
        let (mut word, mut digits) = (String::new(), String::new());
        for c in stem.chars() {
            let sign = c == '-' && digits.is_empty();
            let point = c == '.' && !digits.is_empty();
            if c.is_ascii_digit() || sign || point {
                digits.push(c);
                continue;
            }
            if digits.bytes().any(|b| b.is_ascii_digit()) {
                found.push((std::mem::take(&mut word), std::mem::take(&mut digits)));
            }
            digits.clear();
            word.push(c);
        }
        if digits.bytes().any(|b| b.is_ascii_digit()) {
            found.push((word, digits));
        }
        found
    };
    let all: Vec<Vec<(String, String)>> = stems.iter().map(numbers).collect();
    let first = all.first()?;
    (0..first.len()).find_map(|k| {
        let word = &first[k].0;
        let own: Vec<&(String, String)> = all.iter().map(|n| n.get(k)).collect::<Option<_>>()?;
        let same_word = own.iter().all(|(w, _)| w == word);
        let differ = own.iter().any(|(_, n)| *n != own[0].1);
        let last = word
            .to_lowercase()
            .rsplit(|c: char| !c.is_alphabetic())
            .find(|w| !w.is_empty())
            .unwrap_or("")
            .to_owned();
        let speaks = [
            "pos", "position", "p", "x", "y", "z", "q", "at", "stellung", "place", "lage",
        ];
        (same_word && differ && speaks.contains(&last.as_str()))
            .then(|| own.iter().map(|(_, n)| n.clone()).collect())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_tell_a_place() {
        let names = |files: &[&str]| {
            let files: Vec<String> = files.iter().map(ToString::to_string).collect();
            in_names(&files)
        };
        assert_eq!(
            names(&["pos1a.csv", "pos3a.csv"]),
            Some(vec!["1".to_owned(), "3".to_owned()])
        );
        assert_eq!(
            names(&["run2/x_-0.3.csv", "run2/x_0.3.csv"]),
            Some(vec!["-0.3".to_owned(), "0.3".to_owned()])
        );
        let in_folders = names(&["x=-100mm/run.csv", "x=0mm/run.csv", "x=20.5mm/run.csv"]);
        assert_eq!(
            in_folders,
            Some(["-100", "0", "20.5"].map(str::to_owned).to_vec())
        );
        for files in [
            &["day1/run.csv", "day2/run.csv"][..],
            &["a1.csv", "a2.csv"],
            &["pos1.csv", "pos1b.csv"],
            &["a.csv", "b.csv"],
            &["run1.csv", "run2.csv"],
        ] {
            assert_eq!(names(files), None, "{files:?}");
        }
    }

    #[test]
    fn the_same_place_in_other_units() {
        assert!(is_same(&[0.0, 1.0, 2.0], &[5.0, -995.0, -1995.0]));
        assert!(!is_same(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0]));
    }
}
