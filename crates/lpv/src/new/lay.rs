//! The columns by role: first by name and unit, then by what they do.

use super::clock::{Clock, clock_of, counts_rows};
use super::motion::{base_factor, is_speed};
use super::names::unit_of;
use super::rate::{Physics, TimeColumn};
use super::roles::{Role, is_difference, is_frequency, role_of, role_of_unit};
use super::see::Seen;
use super::time_unit;
use super::{Groups, Known, RecordFile, position};
use std::collections::HashSet;

/// Names first, then units; what neither tells is auxiliary.
pub(super) fn by_name(columns: &[String], seen: &[Seen], known: &Known) -> Groups {
    let given = [&known.output, &known.input, &known.reference, &known.scheduling];
    let taken = |name: &String| given.into_iter().any(|group| group.contains(name));
    let role = |name: &String| {
        let unit = seen.first().map_or("", |s| s.unit(name));
        let unit = if unit.is_empty() {
            unit_of(name).unwrap_or("")
        } else {
            unit
        };
        // No motion is in seconds: the `x-axis` of a recorder.
        match role_of_unit(unit) {
            Some(Role::Time) => Some(Role::Time),
            _ if is_difference(name) => None,
            of_unit => role_of(name).or(of_unit),
        }
    };
    let pick = |given: &Vec<String>, wanted: Role| -> Vec<String> {
        if given.is_empty() {
            let fits = |c: &&String| !taken(c) && role(c) == Some(wanted);
            columns.iter().filter(fits).cloned().collect()
        } else {
            given.clone()
        }
    };
    let mut groups = Groups {
        output: pick(&known.output, Role::Output),
        input: pick(&known.input, Role::Input),
        reference: pick(&known.reference, Role::Reference),
        scheduling: pick(&known.scheduling, Role::Scheduling),
        auxiliary: Vec::new(),
    };
    let used: HashSet<&String> = [
        &groups.output,
        &groups.input,
        &groups.reference,
        &groups.scheduling,
    ]
    .into_iter()
    .flatten()
    .collect();
    groups.auxiliary = columns.iter().filter(|c| !used.contains(c)).cloned().collect();
    groups
}

impl Groups {
    fn all(&mut self) -> [&mut Vec<String>; 5] {
        [
            &mut self.output,
            &mut self.input,
            &mut self.reference,
            &mut self.scheduling,
            &mut self.auxiliary,
        ]
    }

    /// A column that counts the rows is no signal; one that is called time is looked at as such.
    pub(super) fn take_counters_out<'a>(
        &mut self,
        known: &Known,
        column: &impl Fn(&str) -> Option<&'a [f64]>,
        guesses: &mut Vec<String>,
    ) {
        let given = [&known.output, &known.input, &known.reference, &known.scheduling];
        let counter = |name: &String| {
            role_of(name) != Some(Role::Time)
                && !given.iter().any(|g| g.contains(name))
                && column(name).is_some_and(counts_rows)
        };
        for group in self.all() {
            group.retain(|name| {
                let counts = counter(name);
                if counts {
                    guesses.push(format!("`{name}` counts the rows: left out"));
                }
                !counts
            });
        }
    }

    /// The column that tells the time: by its name or its cells, else one that nothing else is known of and that advances evenly.
    /// It leaves the groups.
    pub(super) fn find_time<'a>(
        &mut self,
        columns: &[String],
        known: &Known,
        seen: &Seen,
        column: &impl Fn(&str) -> Option<&'a [f64]>,
    ) -> Option<TimeColumn> {
        let given = [&known.output, &known.input, &known.reference, &known.scheduling];
        let free = |name: &&String| !given.iter().any(|g| g.contains(name));
        let clock = |name: &String| column(name).map(|x| clock_of(x, seen.is_stamp(name)));
        let runs = |name: &&String| clock(name).is_some_and(|c| c.step().is_some());
        let is_in_seconds = |name: &String| role_of_unit(seen.unit(name)) == Some(Role::Time);
        let by_name =
            |name: &&String| role_of(name) == Some(Role::Time) || seen.is_stamp(name) || is_in_seconds(name);
        let named: Vec<&String> = columns.iter().filter(free).filter(by_name).collect();
        let advances = |name: &&String| {
            let is_letter = name.chars().filter(|c| c.is_alphabetic()).count() == 1;
            let says_nothing = is_letter || role_of(name).is_none() || name.starts_with("X_");
            says_nothing
                && !is_frequency(name)
                && !column(name).is_some_and(counts_rows)
                && matches!(clock(name), Some(Clock::Even(_) | Clock::Lost { .. }))
        };
        let name = named
            .iter()
            .copied()
            .find(runs)
            .or(named.first().copied())
            .or_else(|| columns.iter().filter(free).find(advances))?
            .clone();
        // Logs that stand in one file may have a clock each.
        let step = clock(&name).and_then(|c| c.step());
        let rival = columns.iter().filter(free).find_map(|other| {
            let is_clock = container(other) != container(&name) && (by_name(&other) || advances(&other));
            let own = clock(other)?.step().filter(|_| is_clock)?;
            (!time_unit::is_same_step(own, step?)).then(|| (other.clone(), own))
        });
        let begin = |name: &String| column(name).and_then(|x| x.first().copied());
        let late = named.iter().find_map(|other| {
            /// Part of a step by which clocks of the same samples may differ.
            const ALIKE: f64 = 0.02;
            let apart = begin(other)? - begin(&name)?;
            let length = step? * column(&name)?.len() as f64;
            let is_other = container(other) != container(&name) && clock(other)?.step().is_some();
            let is_late = (ALIKE * step?..length).contains(&apart.abs());
            (is_other && is_late).then(|| ((*other).clone(), apart))
        });
        let named: HashSet<&String> = named.into_iter().collect();
        for group in self.all() {
            // Two clocks tell the same.
            group.retain(|n| *n != name && !named.contains(n));
        }
        Some(TimeColumn {
            unit: seen.unit(&name).to_owned(),
            is_stamp: seen.is_stamp(&name),
            first: column(&name).and_then(|x| x.first().copied()).unwrap_or(0.0),
            clocks: Vec::new(),
            rival,
            late,
            name,
        })
    }

    /// A column that rests in every file and differs between them is the position, whatever its name; dead columns go.
    pub(super) fn by_data(&mut self, records: &[RecordFile], known: &Known, guesses: &mut Vec<String>) {
        let dead = |name: &String| records.iter().all(|r| r.rests(name));
        if known.scheduling.is_empty() {
            let mut candidates = self.scheduling.clone();
            for (given, group) in [
                (&known.output, &self.output),
                (&known.input, &self.input),
                (&known.reference, &self.reference),
            ] {
                if given.is_empty() {
                    candidates.extend(group.iter().cloned());
                }
            }
            candidates.extend(self.auxiliary.iter().cloned());
            let moving: Vec<String> = self.scheduling.iter().filter(|n| !dead(n)).cloned().collect();
            let found = position::resting_columns(&candidates, records);
            if !found.is_empty() && moving.iter().all(|m| found.contains(m)) {
                let gone: HashSet<&String> = found.iter().collect();
                for group in self.all() {
                    group.retain(|n| !gone.contains(n));
                }
                for name in &found {
                    guesses.push(format!(
                        "`{name}` is the scheduling signal: it rests in every file, at different values"
                    ));
                }
                self.scheduling = found;
            }
        }
        for (role, given, group) in [
            ("input", &known.input, &mut self.input),
            ("output", &known.output, &mut self.output),
        ] {
            if given.is_empty() {
                group.retain(|name| {
                    if dead(name) {
                        guesses.push(format!("`{name}` is constant in every file: not taken as {role}"));
                    }
                    !dead(name)
                });
            }
        }
    }
}

/// The struct or matrix that a column is part of; nothing for one that stands alone.
fn container(name: &str) -> &str {
    // `data(:,1)`, and not `force (N)`.
    let matrix = name.rsplit_once('(').filter(|(_, part)| part.contains(':'));
    let base = matrix.map_or(name, |(base, _)| base);
    match base.rsplit_once('.') {
        Some((container, _)) => container,
        None if matrix.is_some() => base,
        None => "",
    }
}

/// Positions and speeds that are tried with each other: the first ones of a table.
const MOST_PAIRED: usize = 32;

/// The ratio of a speed column to the differences of a position column, where one follows the other.
pub(super) fn speed_of_position<'a>(
    columns: &[String],
    seen: &Seen,
    column: &impl Fn(&str) -> Option<&'a [f64]>,
) -> Option<Physics> {
    let named = |speed: bool| {
        let fits = move |c: &&String| role_of(c) != Some(Role::Reference) && is_speed(c) == Some(speed);
        columns.iter().filter(fits).take(MOST_PAIRED).collect::<Vec<_>>()
    };
    let unit = |name: &str| {
        let own = seen.unit(name);
        let own = if own.is_empty() {
            unit_of(name).unwrap_or("")
        } else {
            own
        };
        base_factor(own)
    };
    for position in named(false) {
        for speed in named(true) {
            let (Some(x), Some(v)) = (column(position), column(speed)) else {
                continue;
            };
            let Some(slope) = follows(x, v) else { continue };
            let factors = unit(position).zip(unit(speed));
            return Some(Physics {
                position: position.clone(),
                speed: speed.clone(),
                slope: factors.map_or(slope, |(x, v)| slope * v / x),
                units_known: factors.is_some(),
            });
        }
    }
    None
}

/// The slope of the speed over the differences of the position, if these explain half of it.
fn follows(x: &[f64], v: &[f64]) -> Option<f64> {
    let (mut dd, mut dv, mut vv) = (0.0, 0.0, 0.0);
    for k in 1..x.len().min(v.len()).saturating_sub(1) {
        let d = 0.5 * (x[k + 1] - x[k - 1]);
        dd += d * d;
        dv += d * v[k];
        vv += v[k] * v[k];
    }
    (dd > 0.0 && vv > 0.0 && dv > 0.0 && dv * dv > 0.5 * dd * vv).then(|| dv / dd)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_column_is_part_of() {
        for (name, whole) in [
            ("data(:,1)", "data"),
            ("rec.pos(2,:)", "rec"),
            ("rec.time", "rec"),
            ("force (N)", ""),
            ("t", ""),
        ] {
            assert_eq!(container(name), whole);
        }
    }

    #[test]
    fn a_speed_follows_its_position() {
        let x: Vec<f64> = (0..400).map(|k| (0.05 * f64::from(k)).sin()).collect();
        let v: Vec<f64> = (0..400).map(|k| 5.0 * (0.05 * f64::from(k)).cos()).collect();
        // 0.05 a step: a speed of 5 is that at 100 steps a unit of time.
        let slope = follows(&x, &v).unwrap();
        assert!((slope / 100.0 - 1.0).abs() < 0.01, "{slope}");
        assert_eq!(follows(&x, &x), None);
    }
}
