//! Bundle in, one frequency response with covariance a position out.

use crate::PipelineError;
use experiment_data::Bundle;
use frf_estimation::{PeriodicEstimate, PeriodicSettings, SkipRule, estimate_records};
use lpv_core::{Discrete, FrfEstimate, Purpose, Record, RecordKind};
use rayon::prelude::*;

/// Frequency responses at every position of a bundle, in order of position.
#[derive(Debug)]
pub struct Responses {
    /// The clock of the records.
    pub clock: Discrete,
    /// The estimates with their accounts.
    pub estimates: Vec<PeriodicEstimate>,
    /// Whether the bundle has a scheduling channel.
    pub scheduled: bool,
}

impl Responses {
    /// The estimates alone.
    pub fn frfs(&self) -> Vec<FrfEstimate> {
        self.estimates.iter().map(|e| e.estimate.clone()).collect()
    }
}

/// Positions closer than this part of the range belong to one experiment.
const SAME_POSITION: f64 = 1e-3;

/// And so do positions that differ by this part of the largest one: a mean of noisy samples.
const JITTER: f64 = 1e-5;

/// Estimates the frequency response at every position from the periodic estimation records.
///
/// # Errors
/// [`PipelineError::NoPeriodicRecords`]; whatever is wrong with a record or an experiment.
pub fn estimate_bundle(bundle: &Bundle, skip_periods: Option<usize>) -> Result<Responses, PipelineError> {
    let description = bundle.description();
    let clock = bundle.clock()?;
    let wanted: Vec<usize> = (0..bundle.len())
        .filter(|&i| {
            let entry = &description.records[i];
            entry.purpose == Purpose::Estimation && matches!(entry.record_kind(), RecordKind::Periodic { .. })
        })
        .collect();
    if wanted.is_empty() {
        return Err(PipelineError::NoPeriodicRecords {
            bundle: description.name.clone(),
        });
    }
    let mut records = wanted
        .par_iter()
        .map(|&i| bundle.load(i))
        .collect::<Result<Vec<Record>, _>>()?;
    records.sort_by(|a, b| {
        a.position
            .unwrap_or(0.0)
            .total_cmp(&b.position.unwrap_or(0.0))
            .then_with(|| a.name.cmp(&b.name))
    });
    let skip = skip_periods.map_or(SkipRule::Auto, SkipRule::Fixed);
    let settings = PeriodicSettings {
        skip,
        ..PeriodicSettings::default()
    }
    .check()
    .map_err(|source| PipelineError::Frf {
        place: "settings".to_owned(),
        source,
    })?;
    let groups = group(&records);
    let estimates = groups
        .into_par_iter()
        .map(|group| {
            let names: Vec<&str> = group.iter().map(|r| r.name.as_str()).collect();
            estimate_records(&group.iter().collect::<Vec<_>>(), clock, &settings).map_err(|source| {
                let at = group[0]
                    .position
                    .map_or(String::new(), |p| format!("position {p}, "));
                let place = format!("{at}records {}", names.join(", "));
                PipelineError::Frf { place, source }
            })
        })
        .collect::<Result<Vec<_>, PipelineError>>()?;
    let scheduled = !description.channels.scheduling.is_empty() || estimates.len() > 1;
    Ok(Responses {
        clock,
        estimates,
        scheduled,
    })
}

/// Runs of records at the same position.
fn group(records: &[Record]) -> Vec<&[Record]> {
    let at = |r: &Record| r.position.unwrap_or(0.0);
    let width = records.last().map_or(0.0, at) - records.first().map_or(0.0, at);
    let largest = records.iter().map(|r| at(r).abs()).fold(0.0, f64::max);
    let same = (SAME_POSITION * width).max(JITTER * largest);
    records.chunk_by(|a, b| (at(b) - at(a)).abs() <= same).collect()
}
