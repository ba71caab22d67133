//! Rows that are missing: which stretch is used, and what is said.

use super::see::Seen;

/// The rows of the longest stretch without a gap, and of these whole periods, the last ones; none if that is all.
pub(super) fn part_of(from: usize, to: usize, rows: usize, period: Option<usize>) -> Option<[usize; 2]> {
    let length = to - from;
    let used = match period {
        Some(period) if period > 1 && length / period >= 2 => length - length % period,
        _ => length,
    };
    (used < rows).then(|| [to - used + 1, to])
}

/// What is said about lost samples.
pub(super) fn lost(seen: &Seen, gaps: &[(usize, usize)], part: Option<[usize; 2]>) -> String {
    let missing: usize = gaps.iter().map(|(_, count)| count).sum();
    let shown: Vec<String> = gaps
        .iter()
        .take(4)
        .map(|(row, count)| {
            let place = match seen.line_of_row(*row) {
                Some(line) => format!("line {line}"),
                None => format!("row {row}"),
            };
            format!("{count} behind {place}")
        })
        .collect();
    let more = if gaps.len() > 4 { ", ..." } else { "" };
    let used = part.map_or(String::new(), |[a, b]| {
        format!("; rows {a} to {b}, the longest stretch without a gap, are used")
    });
    format!(
        "{}: {missing} {} missing: {}{more}{used}",
        seen.file.display(),
        if missing == 1 { "sample is" } else { "samples are" },
        shown.join(", ")
    )
}
