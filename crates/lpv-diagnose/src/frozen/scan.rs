//! Where a fit to responses starts.

use super::{SHARES, response};
use crate::TraceError;
use crate::base::XyTable;
use lpv_core::{Discrete, FrfEstimate};
use rayon::prelude::*;

/// Starts without a guess: tables with the masses of the geometry and modes anywhere among the lines, the nearest in the
/// logarithm of the diagonal responses first.
pub(super) fn scan(
    make: &impl Fn([f64; 2], f64) -> Result<XyTable, TraceError>,
    few: &[FrfEstimate],
    clock: Discrete,
) -> Result<Vec<XyTable>, TraceError> {
    /// Frequencies that are tried for each mode.
    const GRID: usize = 14;
    /// Damping ratio: wide enough to be near something.
    const DAMPING: f64 = 0.05;
    /// A line counts at most so much.
    const MOST: f64 = 1.5;
    let lines: Vec<f64> = few
        .iter()
        .flat_map(|e| e.frf().frequencies_hz())
        .copied()
        .collect();
    let top = lines.iter().copied().fold(0.0, f64::max);
    let low = lines
        .iter()
        .copied()
        .filter(|f| *f > 0.0)
        .fold(top, f64::min)
        .max(top / 20.0);
    let at = |i: usize| low * (top / low).powf((i as f64 + 0.5) / GRID as f64);
    let mut tables = Vec::new();
    for i in 0..GRID * GRID {
        let table = make([at(i % GRID), at(i / GRID)], DAMPING)?;
        tables.extend([SHARES[1], SHARES[2]].map(|share| table.with_carriage_share(share)));
    }
    let mut rated: Vec<(f64, XyTable)> = tables
        .into_par_iter()
        .filter_map(|table| {
            let mut cost = 0.0;
            for e in few {
                let lines = e.frf().frequencies_hz();
                let model = response(&table, e.single_position().unwrap_or(0.0), lines, clock)?;
                for k in 0..lines.len() {
                    for i in 0..2 {
                        let ratio = model.line(k)[(i, i)] / e.frf().line(k)[(i, i)];
                        cost += ratio.ln().norm().min(MOST);
                    }
                }
            }
            cost.is_finite().then_some((cost, table))
        })
        .collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(rated.into_iter().take(6).map(|(_, table)| table).collect())
}
