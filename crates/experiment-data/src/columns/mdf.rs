//! MDF 4 (ASAM, "MDF, measurement data format, version 4"): groups of channels whose values lie in records, sorted or mixed, plain,
//! in lists, deflated and transposed.
//!
//! A channel of real numbers is a column: `force`, or `group.force` where two groups have a channel of that name. Linear and rational
//! conversions are applied, invalid values are NaN. Refused by name: text, arrays, other conversions, and columns apart (4.2).

mod blocks;
mod conversion;
mod groups;
mod raw;
mod stream;

use self::groups::{Channel, Mdf};
use crate::RecordError;
use crate::contents::{Column, Contents, PassedOver, missing};
use crate::memory::Allowance;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// The named channels, in the order of the names.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut mdf = Mdf::open(path)?;
    let mut places: HashMap<String, usize> = HashMap::new();
    for (place, name) in mdf.names().into_iter().enumerate() {
        places.entry(name).or_insert(place);
    }
    for (place, name) in mdf.full_names().into_iter().enumerate() {
        places.entry(name).or_insert(place);
    }
    let mut allowance = Allowance::new(mdf.bytes());
    let mut wanted = Vec::new();
    let mut checked = HashSet::new();
    for name in names {
        let Some(&place) = places.get(*name) else {
            return Err(missing(name, &mdf.names()));
        };
        let channel = &mdf.channels[place];
        if let Err(found) = &channel.values {
            return Err(RecordError::NotNumeric {
                column: (*name).to_owned(),
                found: found.clone(),
            });
        }
        let group = channel.group;
        if checked.insert(group) {
            mdf.check_claim(name, group)?;
        }
        allowance.take(name, mdf.rows(place))?;
        wanted.push(place);
    }
    mdf.values(&wanted)
}

/// Every channel of real numbers, and what else the file holds.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let mdf = Mdf::open(path)?;
    let mut contents = Contents::default();
    for (place, name) in mdf.names().into_iter().enumerate() {
        let Channel { values, unit, .. } = &mdf.channels[place];
        match values {
            Ok(_) => contents.columns.push(Column {
                name,
                rows: mdf.rows(place),
                unit: unit.clone(),
                source: None,
                is_stamp: false,
            }),
            Err(what) => contents.passed_over.push(PassedOver {
                name,
                what: what.clone(),
                remedy: if what.contains("conversion") || what.contains("apart") {
                    "save it as MDF 4.1 with physical values".to_owned()
                } else {
                    String::new()
                },
            }),
        }
    }
    Ok(contents)
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "MDF",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}
