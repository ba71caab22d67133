//! What the figures of records and responses say.

use super::{ExperimentInfo, Inspection, RecordInfo};
use crate::finding::Finding;

/// Below this the averaged signal hardly stands out of its noise.
const LOW_SNR_DB: f64 = 10.0;

/// Findings about the bundle as a whole.
pub(super) fn of_bundle(i: &Inspection) -> Vec<Finding> {
    let mut found = Vec::new();
    positions(i, &mut found);
    let held = i
        .records
        .iter()
        .map(|r| r.purpose)
        .chain(i.responses.iter().map(|r| r.purpose));
    if !held.into_iter().any(|purpose| purpose == "validation") {
        found.push(Finding::NothingHeldOut);
    }
    let transients = i.records.iter().any(|r| r.kind == "transient");
    if transients && !i.controller && i.channels.iter().any(|c| c.role == "reference") {
        found.push(Finding::NoController);
    }
    found
}

/// Findings about the responses at one position.
pub(crate) fn of_experiment(e: &ExperimentInfo, controller: bool) -> Vec<Finding> {
    /// Noise of the response below which an uncertain covariance does not matter, and the periods that make it certain.
    const KNOWN: (f64, usize) = (1e-3, 4);
    /// Noise of a line that stands out, and how many of them make a band.
    const GOOD: (f64, usize) = (0.3, 20);
    let mut found = Vec::new();
    let place = match &e.position {
        Some(p) => format!("position {p:.4}"),
        None => e.records.join(", "),
    };
    let noise = e.frf_deviation.median;
    let low = |l: &&super::LineInfo| l.output_snr_db.iter().any(|s| *s < LOW_SNR_DB);
    let low = e.lines.iter().filter(low).count();
    let good = || e.lines.iter().filter(|l| l.frf_deviation < GOOD.0);
    if noise > GOOD.0 && good().count() >= GOOD.1 {
        // A band that stands out is what counts, and the rest was hardly excited.
        let frequencies = || good().map(|l| l.frequency_hz);
        found.push(Finding::FewGoodLines {
            place: place.clone(),
            good: good().count(),
            lines: e.lines.len(),
            band: [
                frequencies().fold(f64::INFINITY, f64::min),
                frequencies().fold(0.0, f64::max),
            ],
        });
        return found;
    }
    if low * 20 > e.lines.len() {
        found.push(Finding::LowSignal {
            place: place.clone(),
            level_db: LOW_SNR_DB,
            low,
            lines: e.lines.len(),
        });
    }
    if noise > 0.5 {
        found.push(Finding::ResponseIsNoise {
            place: place.clone(),
            percent: crate::signal::finite(100.0 * noise),
        });
    }
    if e.periods_used < KNOWN.1 && noise > KNOWN.0 {
        found.push(Finding::FewPeriods {
            place: place.clone(),
            periods: e.periods_used,
        });
    }
    if e.periods_skipped > 0 && 2 * e.periods_skipped >= e.periods_used {
        found.push(Finding::LongTransient {
            place: place.clone(),
            skipped: e.periods_skipped,
            periods: e.periods_skipped + e.periods_used,
        });
    }
    if e.condition[0] > 100.0 {
        found.push(Finding::DependentInputs {
            place: place.clone(),
            condition: crate::signal::finite(e.condition[0]),
            frequency_hz: e.condition[1],
        });
    }
    if e.instrument == "inputs" && controller {
        found.push(Finding::BiasedLoop { place: place.clone() });
    }
    for (parity, levels) in [("odd", &e.odd_distortion), ("even", &e.even_distortion)] {
        if let Some(worst) = levels.iter().flatten().copied().reduce(f64::max)
            && worst > noise.max(1e-3)
        {
            found.push(Finding::Distortion {
                place: place.clone(),
                parity: parity.to_owned(),
                percent: crate::signal::finite(100.0 * worst),
                noise_percent: crate::signal::finite(100.0 * noise),
            });
        }
    }
    found
}

/// Findings about the figures of one record.
pub(super) fn of_record(r: &RecordInfo) -> Vec<Finding> {
    let mut found = Vec::new();
    for c in &r.channels {
        let (record, column) = (r.name.clone(), c.name.clone());
        if r.kind == "periodic" && c.role == "reference" && c.crest_factor > 4.0 {
            let crest_factor = c.crest_factor;
            found.push(Finding::CrestFactor {
                record,
                column,
                crest_factor,
            });
        } else if c.role == "output" {
            if c.near_nyquist > 0.1 {
                found.push(Finding::NearNyquist {
                    record: record.clone(),
                    column: column.clone(),
                    percent: 100.0 * c.near_nyquist,
                });
            }
            if let Some(step) = c.resolution.filter(|step| *step > 0.05 * c.rms) {
                let percent = 100.0 * step / c.rms;
                found.push(Finding::CoarseSensor {
                    record,
                    column,
                    step,
                    percent,
                });
            }
        }
    }
    // Segments of a lightly damped machine leak: a clean one may show a third.
    const LITTLE: f64 = 0.1;
    if let Some(low) = r.explained.iter().copied().reduce(f64::min)
        && low < LITTLE
    {
        found.push(Finding::Unexplained {
            record: r.name.clone(),
            percent: 100.0 * low,
        });
    }
    found
}

fn positions(i: &Inspection, found: &mut Vec<Finding>) {
    let Some(coverage) = &i.coverage else { return };
    let positions = &coverage.positions;
    let (Some(first), Some(last)) = (positions.first(), positions.last()) else {
        return;
    };
    let width = coverage.range[1] - coverage.range[0];
    if positions.len() == 1 && width > 0.0 {
        found.push(Finding::OnePosition);
        return;
    }
    let outside = (first - coverage.range[0]).max(coverage.range[1] - last);
    if outside > 0.02 * width {
        found.push(Finding::BeyondPositions {
            moves: coverage.range,
            covered: [*first, *last],
        });
    }
    let even = (last - first) / (positions.len() - 1).max(1) as f64;
    if coverage.largest_gap > 1.8 * even {
        found.push(Finding::PositionGap {
            gap: coverage.largest_gap,
            ratio: coverage.largest_gap / even,
        });
    }
}
