//! TDMS (National Instruments, "TDMS File Format Internal Structure"): segments of objects with properties and raw values, in both
//! byte orders, one channel after the other or interleaved.
//!
//! A channel of real numbers is a column: `force`, or `group.force` where two groups have a channel of that name. Its interval
//! is the scalar `wf_increment`. Refused by name: text, complex numbers, and raw values that are still to be scaled.

mod input;
mod path;
mod segments;
mod values;

use self::segments::{Channel, Tdms};
use crate::RecordError;
use crate::contents::{Column, Contents, MOST_SCALARS, PassedOver, Scalar, missing};
use crate::memory::Allowance;
use std::collections::HashMap;
use std::path::Path;

/// Part of an interval by which a channel may begin later than another.
const LATE: f64 = 0.02;

/// The named channels, in the order of the names.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut tdms = Tdms::open(path)?;
    let places = {
        let mut places = HashMap::new();
        for (place, name) in names_of(&tdms.channels).into_iter().enumerate() {
            places.entry(name).or_insert(place);
        }
        for (place, channel) in tdms.channels.iter().enumerate() {
            places.entry(channel.full_name()).or_insert(place);
        }
        places
    };
    let mut allowance = Allowance::new(tdms.bytes);
    names
        .iter()
        .map(|name| {
            let Some(&place) = places.get(*name) else {
                let present: Vec<String> = names_of(&tdms.channels);
                return Err(missing(name, &present));
            };
            if let Err(found) = tdms.channels[place].number() {
                return Err(RecordError::NotNumeric {
                    column: (*name).to_owned(),
                    found,
                });
            }
            allowance.take(name, tdms.channels[place].length)?;
            tdms.values(name, place)
        })
        .collect()
}

/// Every channel of real numbers that begins with the longest, and what else the file holds.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let tdms = Tdms::open(path)?;
    let mut contents = Contents::default();
    let names = names_of(&tdms.channels);
    let numbers = tdms
        .channels
        .iter()
        .zip(&names)
        .filter(|(c, _)| c.number().is_ok());
    let first = numbers.min_by_key(|(c, _)| std::cmp::Reverse(c.length));
    for (name, channel) in names.iter().cloned().zip(&tdms.channels) {
        let late = first.map_or(0.0, |(first, _)| channel.begins_after(first));
        match channel.number() {
            Ok(_) if late.abs() > LATE * channel.interval_s.unwrap_or(0.0) => {
                contents.passed_over.push(PassedOver {
                    what: format!(
                        "begins {late} s after `{}`, by `wf_start_time` and `wf_start_offset`",
                        first.map_or("", |(_, name)| name.as_str())
                    ),
                    name,
                    remedy: "bring all signals to the same instants, in Python: numpy.interp(t, channel.time_track(), channel[:])"
                        .to_owned(),
                });
            }
            Ok(_) => contents.columns.push(Column {
                name,
                rows: channel.length,
                unit: channel.unit.clone(),
                source: None,
                is_stamp: false,
            }),
            Err(what) => contents.passed_over.push(PassedOver {
                remedy: if what.contains("scaled") {
                    "save the scaled values, in Python: channel[:] of nptdms".to_owned()
                } else {
                    String::new()
                },
                name,
                what,
            }),
        }
    }
    for channel in &tdms.channels {
        let scalar = channel.interval_s.filter(|v| v.is_finite()).map(|value| Scalar {
            name: "wf_increment".to_owned(),
            value,
        });
        contents.scalars.extend(
            scalar.filter(|s| !contents.scalars.contains(s) && contents.scalars.len() < MOST_SCALARS),
        );
    }
    Ok(contents)
}

/// Channel names where they are unique, with their group otherwise.
fn names_of(channels: &[Channel]) -> Vec<String> {
    let mut times: HashMap<&str, usize> = HashMap::new();
    channels
        .iter()
        .for_each(|c| *times.entry(c.name.as_str()).or_default() += 1);
    channels
        .iter()
        .map(|c| match times.get(c.name.as_str()) {
            Some(1) => c.name.clone(),
            _ => c.full_name(),
        })
        .collect()
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "TDMS",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}
