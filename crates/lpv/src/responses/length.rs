//! Records of one length, as the local rational method needs them.

use super::places::{self, Placed};
use lpv_core::Record;

/// Leaves the records from which a response is estimated, of one length: of all lengths the one that leaves most samples, and a
/// record at every position. Says what was cut.
pub(super) fn to_one_length(records: &mut Vec<Record>) -> String {
    let Some((length, shortest, longest)) = common_length(records) else {
        return String::new();
    };
    let all = records.len();
    records.retain(|r| r.len() >= length);
    records.iter_mut().for_each(|r| r.truncate(length));
    format!(
        "; the records have {shortest} to {longest} samples: the first {length} of {} of {all} records give the response",
        records.len()
    )
}

/// The length to cut to, and the smallest and the largest one; none if all have one length.
fn common_length(records: &[Record]) -> Option<(usize, usize, usize)> {
    let mut lengths: Vec<usize> = records.iter().map(Record::len).collect();
    lengths.sort_unstable();
    lengths.dedup();
    let mut placed: Vec<Placed> = records
        .iter()
        .enumerate()
        .map(|(i, r)| Placed::of(r, i))
        .collect();
    // What is wrong with the places, the estimate tells.
    let runs = places::runs(&mut placed).ok()?;
    let everywhere = |length: usize| {
        let long = |run: &std::ops::Range<usize>| {
            let mut own = placed[run.clone()].iter();
            own.any(|p| records[p.index].len() >= length)
        };
        runs.iter().all(long)
    };
    let samples = |length: usize| length * records.iter().filter(|r| r.len() >= length).count();
    let best = lengths
        .iter()
        .copied()
        .filter(|&length| everywhere(length))
        .max_by_key(|&length| (samples(length), length));
    let &[shortest, .., longest] = lengths.as_slice() else {
        return None;
    };
    Some((best?, shortest, longest))
}
