//! The keys of a description.

use crate::DescriptionError;
use crate::description::{Description, RecordEntry};
use crate::description_check::{Fault, fault};
use crate::key_path::KeyPath;

/// The keys of each table; `*` stands for any index.
pub(crate) const KEYS: [(&str, &[&str]); 12] = [
    (
        "",
        &[
            "format",
            "name",
            "sample_rate",
            "channels",
            "controller",
            "geometry",
            "text",
            "records",
        ],
    ),
    (
        "channels",
        &["output", "input", "reference", "scheduling", "auxiliary"],
    ),
    ("channels.output", GROUP),
    ("channels.input", GROUP),
    ("channels.reference", GROUP),
    ("channels.scheduling", GROUP),
    ("channels.auxiliary", GROUP),
    (
        "controller",
        &[
            "reference_numerator",
            "feedback_numerator",
            "denominator",
            "limit",
        ],
    ),
    ("geometry", &["force_from_input", "motor_from_output"]),
    (
        "records[*]",
        &[
            "file",
            "kind",
            "period",
            "use",
            "position",
            "injection",
            "columns",
            "rows",
            "quantity",
        ],
    ),
    ("records[*].injection", GROUP),
    (
        "text",
        &["separator", "decimal", "header", "names", "units_row", "skip"],
    ),
];
const GROUP: &[&str] = &["columns", "units", "scale", "offset", "quantity"];

/// Of these, the ones that a description of format 1 does not have.
pub(super) const OF_SECOND: [(&str, &[&str]); 4] = [
    ("", &["text"]),
    ("channels.", &["offset", "quantity"]),
    ("records[*]", &["columns", "rows", "quantity"]),
    ("records[*].injection", &["offset", "quantity"]),
];

/// Keys of format 2 that are not read yet.
pub(super) const UNREAD: [(&str, &[&str]); 3] = [
    (
        "controller",
        &["output_transform", "input_transform", "monomials"],
    ),
    ("geometry", &["monomials"]),
    ("records[*]", &["clipped", "repeat"]),
];

pub(super) fn listed(list: &[(&str, &[&str])], pattern: &str, key: &str) -> bool {
    list.iter().any(|(of, keys)| {
        let fits = pattern == *of || (of.ends_with('.') && pattern.starts_with(of));
        fits && keys.contains(&key)
    })
}

/// Whether a description says anything that format 1 does not have.
pub(super) fn needs_second(d: &Description) -> bool {
    let c = &d.channels;
    let groups = [&c.output, &c.input, &c.reference, &c.scheduling, &c.auxiliary];
    d.text.is_some()
        || groups
            .iter()
            .any(|g| !g.offset.is_empty() || !g.quantity.is_empty())
        || d.records.iter().any(|r| {
            r.position.as_ref().is_some_and(|p| p.len() > 1)
                || r.rows.is_some()
                || r.is_response()
                || !r.columns.is_empty()
                || !r.injection.offset.is_empty()
                || !r.injection.quantity.is_empty()
        })
}

/// A value that a description of format 1 does not have: a position of several numbers, a response.
pub(super) fn value_of_second(records: &[RecordEntry]) -> Option<Fault> {
    let found = |(index, r): (usize, &RecordEntry)| match &r.position {
        Some(p) if p.len() > 1 => Some((index, "position", "position = [...]")),
        _ => r.is_response().then_some((index, "kind", "kind = \"response\"")),
    };
    let (index, name, key) = records.iter().enumerate().find_map(found)?;
    let path = KeyPath::key("records").at(index).then(name);
    Some(fault(path, DescriptionError::OfFormat2 { key: key.to_owned() }))
}
