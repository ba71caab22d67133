//! The keys of a description.

use crate::description::Description;

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
        ],
    ),
    ("records[*].injection", GROUP),
    (
        "text",
        &["separator", "decimal", "header", "names", "units_row", "skip"],
    ),
];
const GROUP: &[&str] = &["columns", "units", "scale", "offset"];

/// Of these, the ones that a description of format 1 does not have.
pub(super) const OF_SECOND: [(&str, &[&str]); 4] = [
    ("", &["text"]),
    ("channels.", &["offset"]),
    ("records[*]", &["columns", "rows"]),
    ("records[*].injection", &["offset"]),
];

/// Keys of format 2 that are not read yet.
pub(super) const UNREAD: [(&str, &[&str]); 5] = [
    ("channels.", &["quantity"]),
    (
        "controller",
        &["output_transform", "input_transform", "monomials"],
    ),
    ("geometry", &["monomials"]),
    ("records[*]", &["clipped", "repeat", "quantity"]),
    ("records[*].injection", &["quantity"]),
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
        || groups.iter().any(|g| !g.offset.is_empty())
        || d.records.iter().any(|r| {
            r.position.as_ref().is_some_and(|p| p.len() > 1)
                || r.rows.is_some()
                || !r.columns.is_empty()
                || !r.injection.offset.is_empty()
        })
}
