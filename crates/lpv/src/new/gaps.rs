//! Rows that are missing: which stretch is used, and what is said.

use super::RecordFile;
use super::see::Seen;

impl RecordFile {
    /// First and last row that are used, from 1, where not all are: the longest stretch without a gap, and of these whole periods, the last
    /// ones.
    pub(super) fn part(&self) -> Option<[usize; 2]> {
        let [from, to] = self.stretch;
        let length = to - from;
        let used = match self.period {
            Some(period) if period > 1 && length / period >= 2 => length - length % period,
            _ => length,
        };
        (used < self.rows).then(|| [to - used + 1, to])
    }
}

/// What is said of a record of which not all rows are used.
pub(super) fn used(record: &RecordFile, seen: &Seen) -> Option<String> {
    if !record.gaps.is_empty() {
        return Some(lost(seen, &record.gaps, record.part()));
    }
    let [first, last] = record.part()?;
    Some(format!(
        "{}: rows {first} to {last} of {} are used, whole periods of {} samples",
        seen.file.display(),
        seen.rows,
        record.period.unwrap_or(0)
    ))
}

/// What is said about lost samples.
fn lost(seen: &Seen, gaps: &[(usize, usize)], part: Option<[usize; 2]>) -> String {
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
