//! Everything that can be told wrong from the description alone.

mod of_loop;

use crate::description::{ChannelGroup, Description, EntryKind, RecordEntry};
use crate::key_path::KeyPath;
use crate::nearest::nearest;
use crate::response::names;
use crate::{DescriptionError, RecordFormat, Text};
use of_loop::{check_controller, check_geometry};
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
        check_controller(controller, (c.input.len(), c.output.len(), c.reference.len()))?;
    }
    if let Some(geometry) = &d.geometry {
        check_geometry(geometry, (c.input.len(), c.output.len(), c.scheduling.len()))?;
    }
    d.text.as_ref().map_or(Ok(()), check_text)
}

fn check_text(text: &Text) -> Result<(), Fault> {
    let path = KeyPath::key("text");
    let refuse = |key, problem| Err(fault(path.then(key), DescriptionError::Text { problem }));
    if text.header != Some(0) && !text.names.is_empty() {
        return refuse(
            "names",
            "`names` is for files without a line of names; write header = 0 with it",
        );
    }
    if let Some(k) = text.names.iter().position(|n| n.trim().is_empty()) {
        return Err(fault(path.then("names").at(k), DescriptionError::EmptyName));
    }
    if text.units_row == Some(0)
        || text
            .units_row
            .is_some_and(|u| text.header.is_some_and(|h| u <= h))
    {
        return refuse(
            "units_row",
            "the units stand in a line below the names; lines count from 1",
        );
    }
    if text.skip.contains(&0) {
        return refuse("skip", "lines count from 1");
    }
    Ok(())
}

/// Positions, rows and columns of the entries.
pub(crate) fn check_places(d: &Description) -> Result<(), Fault> {
    let records = KeyPath::key("records");
    // Without a scheduling signal the first position says how many numbers p has.
    let declared = d.records.iter().find_map(|r| r.position.as_ref());
    let signals = match d.channels.scheduling.len() {
        0 => declared.map_or(0, |p| p.len()),
        signals => signals,
    };
    for (index, entry) in d.records.iter().enumerate() {
        let path = records.at(index);
        if let Some(found) = entry.position.as_ref().map(|p| p.len())
            && found != signals.max(1)
        {
            let problem = DescriptionError::PositionLength { signals, found };
            return Err(fault(path.then("position"), problem));
        }
        if let Some(rows) = entry.rows
            && !(1..=rows[1]).contains(&rows[0])
        {
            return Err(fault(path.then("rows"), DescriptionError::Rows { rows }));
        }
        let c = &d.channels;
        let groups = [
            &c.output,
            &c.input,
            &c.reference,
            &c.scheduling,
            &c.auxiliary,
            &entry.injection,
        ];
        let known = match entry.is_response() {
            true => names::names(c),
            false => groups.iter().flat_map(|g| &g.columns).cloned().collect(),
        };
        if entry.is_response() && entry.position.is_none() && !c.scheduling.is_empty() {
            return Err(fault(path, DescriptionError::PositionMissing));
        }
        if let Some(column) = entry.columns.keys().find(|k| !known.contains(*k)) {
            let problem = DescriptionError::Unasked {
                nearest: nearest(column, &known),
                column: column.clone(),
            };
            return Err(fault(path.then("columns"), problem));
        }
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
    for (list, found) in [
        ("units", group.units.len()),
        ("scale", group.scale.len()),
        ("offset", group.offset.len()),
        ("quantity", group.quantity.len()),
    ] {
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
    if let Some(k) = group.offset.iter().position(|v| !v.is_finite()) {
        let value = group.offset[k];
        return Err(fault(
            path.then("offset").at(k),
            DescriptionError::NotFinite { value },
        ));
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
    let of_samples = [
        ("period", entry.period.is_some()),
        ("injection", !entry.injection.is_empty()),
    ];
    let unused = of_samples
        .into_iter()
        .find(|(_, given)| entry.is_response() && *given);
    if let Some((key, _)) = unused {
        return Err(fault(path.then(key), DescriptionError::KeyOfSamples { key }));
    }
    if entry.quantity.is_some() && !entry.is_response() {
        return Err(fault(path.then("quantity"), DescriptionError::QuantityOfSamples));
    }
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
    if let Some(&value) = entry
        .position
        .iter()
        .flat_map(|p| p.iter())
        .find(|v| !v.is_finite())
    {
        return Err(fault(
            path.then("position"),
            DescriptionError::NotFinite { value },
        ));
    }
    check_group(&entry.injection, &path.then("injection"))
}
