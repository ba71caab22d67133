//! docs/performance.md.

use crate::Row;
use lpv_benches::verdict;
use std::fmt::Write as _;

/// Most memory that the whole reproduction may take.
const MOST_MIB: f64 = 200.0;

/// Errors within this factor are equal.
const MARGIN: f64 = 1.01;

pub(crate) fn line(row: &Row) -> String {
    format!(
        "{}, {}, {} threads: {:.4} s against {:.4} s, ratio {:.1} ({:.1} to {:.1}; bar {}), errors {:.2e} and {:.2e}, {:.0} and {:.0} MiB",
        row.work,
        row.peer,
        row.threads,
        row.our_seconds,
        row.their_seconds,
        row.ratio,
        row.spread[0],
        row.spread[1],
        row.bar,
        row.our_error,
        row.their_error,
        row.our_mib,
        row.their_mib
    )
}

fn seconds(s: f64) -> String {
    match s {
        s if s < 1e-3 => format!("{:.0} us", 1e6 * s),
        s if s < 1.0 => format!("{:.1} ms", 1e3 * s),
        s => format!("{s:.2} s"),
    }
}

fn is_accurate(r: &Row) -> bool {
    r.our_error <= r.enough.max(MARGIN * r.their_error)
}

pub(crate) fn page(rows: &[Row], runs: usize, packages: &[&str]) -> String {
    let mut out = format!(
        "# Performance\n\nThe hot kernels beside the tools that a user would pick instead, on the same inputs, alternately in one run of \
         `cargo xtask peers --bless`: medians of {runs}. Times are those of the work alone; each side has read its inputs before. Errors \
         are relative to a common truth. Peak memory is that of the process, inputs and interpreter included. Versions: {}. \
         The scripts are in `benches/peers`; how near the limits of the machine the kernels are, in [limits.md](limits.md).\n\n\
         | work | peer | threads | ours | theirs | ratio (spread) | bar | error, ours | theirs | MiB, ours | theirs |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
        packages.join(", ")
    );
    for r in rows {
        // Bars hold on one thread, but that of a row with two on its ratio, and for results that are as accurate.
        let counts = if r.peer == Row::ITSELF { 1 } else { r.threads };
        let met = match counts {
            1 => format!("{}: {}", r.bar, verdict(r.ratio >= r.bar && is_accurate(r))),
            _ => "-".to_owned(),
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {:.1} ({:.1} to {:.1}) | {met} | {:.1e} | {:.1e} | {:.0} | {:.0} |",
            r.work,
            r.peer,
            r.threads,
            seconds(r.our_seconds),
            seconds(r.their_seconds),
            r.ratio,
            r.spread[0],
            r.spread[1],
            r.our_error,
            r.their_error,
            r.our_mib,
            r.their_mib
        );
    }
    if let Some(two) = rows.iter().find(|r| r.peer == Row::ITSELF) {
        let _ = writeln!(
            out,
            "\nPeak memory of the {}, on two threads: {:.0} MiB of {MOST_MIB}: {}.",
            two.work,
            two.our_mib,
            verdict(two.our_mib <= MOST_MIB)
        );
    }
    out += include_str!("../../peers/notes.md");
    out
}
