//! Positions that grow with time.

use super::Track;
use lpv_numerics::statistics::{mean, range};

impl Track {
    /// Whether an output and time grow alike in some records, as `grow_with_time` says.
    pub fn grow_with_time(tracks: &[Self], output: usize) -> bool {
        let one = |track: &Self| track.outputs.iter().map(|y| y[output]).collect();
        grow_with_time(&tracks.iter().map(one).collect::<Vec<_>>())
    }
}

/// Whether positions and time grow alike: every record starts at one place and goes one way at a nearly constant speed, so that what changes
/// with the one cannot be told from what changes with the other.
pub(crate) fn grow_with_time(records: &[Vec<f64>]) -> bool {
    /// Part of the motion that grows with time, and of the travel in which records start.
    const ALIKE: f64 = 0.9;
    const START: f64 = 0.05;
    let span = |x: &[f64]| {
        let (low, high) = range(x);
        high - low
    };
    let travel = records.iter().map(|record| span(record)).fold(0.0, f64::max);
    let starts: Vec<f64> = records
        .iter()
        .filter_map(|record| record.first().copied())
        .collect();
    travel > 0.0
        && span(&starts) <= START * travel
        && records.iter().all(|record| {
            let middle = mean(record);
            let (mut qq, mut qt, mut tt) = (0.0, 0.0, 0.0);
            for (k, q) in record.iter().enumerate() {
                let (q, t) = (q - middle, k as f64 - 0.5 * (record.len() as f64 - 1.0));
                qq += q * q;
                qt += q * t;
                tt += t * t;
            }
            qt * qt >= ALIKE * qq * tt
        })
}
