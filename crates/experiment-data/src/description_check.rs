//! Everything that can be told wrong from the description alone.

use crate::description::{ChannelGroup, Description, EntryKind, RecordEntry};
use crate::key_path::KeyPath;
use crate::{DescriptionError, RecordFormat};
use std::collections::HashMap;

/// A problem and its key; the caller knows the file and finds the line.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) path: KeyPath,
    pub(crate) problem: DescriptionError,
}

pub(crate) fn fault(path: KeyPath, problem: DescriptionError) -> Fault {
    Fault { path, problem }
}

/// Checks all but the records.
pub(crate) fn check_head(d: &Description) -> Result<(), Fault> {
    if !(d.sample_rate_hz.is_finite() && d.sample_rate_hz > 0.0 && (1.0 / d.sample_rate_hz).is_finite()) {
        return Err(fault(
            KeyPath::key("sample_rate"),
            DescriptionError::SampleRate {
                value: d.sample_rate_hz,
            },
        ));
    }
    let channels = KeyPath::key("channels");
    let c = &d.channels;
    let groups = [
        ("output", &c.output),
        ("input", &c.input),
        ("reference", &c.reference),
        ("scheduling", &c.scheduling),
        ("auxiliary", &c.auxiliary),
    ];
    for (i, (name, group)) in groups.into_iter().enumerate() {
        let path = channels.then(name);
        if i < 2 && group.is_empty() {
            return Err(fault(path.then("columns"), DescriptionError::NoColumns));
        }
        check_group(group, &path)?;
        for (earlier_name, earlier) in &groups[..i] {
            if may_share(earlier_name, name) {
                continue;
            }
            let places = places(&earlier.columns);
            for (k, column) in group.columns.iter().enumerate() {
                if let Some(&j) = places.get(column.as_str()) {
                    let first = channels.then(earlier_name).then("columns").at(j).to_string();
                    let problem = DescriptionError::DuplicateColumn {
                        column: column.clone(),
                        first,
                    };
                    return Err(fault(path.then("columns").at(k), problem));
                }
            }
        }
    }
    if let Some(controller) = &d.controller {
        controller.check(c.input.len(), c.output.len(), c.reference.len())?;
    }
    if let Some(geometry) = &d.geometry {
        geometry.check(c.input.len(), c.output.len(), c.scheduling.len())?;
    }
    Ok(())
}

/// Scheduling may be a signal that is measured anyway, and in open loop the excitation is the input.
fn may_share(earlier: &str, later: &str) -> bool {
    matches!(
        (earlier, later),
        (_, "scheduling") | ("scheduling", _) | ("input", "reference")
    )
}

/// Where each name stands; of a name that stands twice, one of its places.
fn places(names: &[String]) -> HashMap<&str, usize> {
    names.iter().enumerate().map(|(i, n)| (n.as_str(), i)).collect()
}

fn check_group(group: &ChannelGroup, path: &KeyPath) -> Result<(), Fault> {
    let columns = path.then("columns");
    let mut seen: HashMap<&str, usize> = HashMap::new();
    for (k, column) in group.columns.iter().enumerate() {
        if column.trim().is_empty() {
            return Err(fault(columns.at(k), DescriptionError::EmptyName));
        }
        if let Some(j) = seen.insert(column, k) {
            let first = columns.at(j).to_string();
            let problem = DescriptionError::DuplicateColumn {
                column: column.clone(),
                first,
            };
            return Err(fault(columns.at(k), problem));
        }
    }
    for (list, found) in [("units", group.units.len()), ("scale", group.scale.len())] {
        if found != 0 && found != group.len() {
            return Err(fault(
                path.then(list),
                DescriptionError::ListLength {
                    expected: group.len(),
                    found,
                },
            ));
        }
    }
    for (k, (&value, column)) in group.scale.iter().zip(&group.columns).enumerate() {
        if !value.is_finite() || value == 0.0 {
            let problem = DescriptionError::Scale {
                column: column.clone(),
                value,
            };
            return Err(fault(path.then("scale").at(k), problem));
        }
    }
    Ok(())
}

/// Checks the entries, without looking at the disk.
pub(crate) fn check_entries(entries: &[RecordEntry]) -> Result<(), Fault> {
    let records = KeyPath::key("records");
    if entries.is_empty() {
        return Err(fault(records, DescriptionError::NoRecords));
    }
    for (index, entry) in entries.iter().enumerate() {
        check_entry(entry, &records.at(index))?;
    }
    Ok(())
}

/// Checks one entry, without looking at the disk.
pub(crate) fn check_entry(entry: &RecordEntry, path: &KeyPath) -> Result<(), Fault> {
    RecordFormat::of(&entry.file).map_err(|problem| fault(path.then("file"), problem))?;
    match (entry.kind, entry.period) {
        (EntryKind::Periodic, None) => return Err(fault(path.clone(), DescriptionError::PeriodMissing)),
        (EntryKind::Periodic, Some(period)) if period < 2 => {
            return Err(fault(
                path.then("period"),
                DescriptionError::PeriodShort { period },
            ));
        }
        (EntryKind::Transient, Some(period)) => {
            return Err(fault(
                path.then("period"),
                DescriptionError::PeriodOfTransient { period },
            ));
        }
        _ => {}
    }
    if let Some(value) = entry.position
        && !value.is_finite()
    {
        return Err(fault(
            path.then("position"),
            DescriptionError::NotFinite { value },
        ));
    }
    check_group(&entry.injection, &path.then("injection"))
}
