//! What is in a bundle, checked: records, channels, frequency responses, noise, distortion, coverage; warnings in words.

mod experiment;
mod record;
mod response;
mod text;
mod warnings;

use crate::PipelineError;
use crate::finding::{self, Finding, Look};
use crate::progress::{Counter, Progress};
use crate::responses::measured::{self, measured_responses};
use crate::responses::{is_large, look_at, periodic_responses};
pub(crate) use experiment::describe as describe_responses;
pub use experiment::{DetectionLine, ExperimentInfo, LineInfo, Spread};
use experiment_data::{Bundle, DataError};
use lpv_core::{Position, Purpose};
use rayon::prelude::*;
pub use record::{ChannelStats, RecordInfo};
pub use response::ResponseInfo;
use schemars::JsonSchema;
use serde::Serialize;
pub(crate) use warnings::of_experiment;

/// Everything that `lpv inspect` tells about a bundle.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Inspection {
    /// Name of the bundle.
    pub name: String,
    /// Samples per unit of time.
    pub sample_rate_hz: f64,
    /// Whether a controller is described, so that closed-loop simulation is possible.
    pub controller: bool,
    /// Names and units of the channels by role.
    pub channels: Vec<ChannelGroupInfo>,
    /// Every record of samples.
    pub records: Vec<RecordInfo>,
    /// Every periodic experiment: the records of one use at one position.
    pub experiments: Vec<ExperimentInfo>,
    /// Every frequency response that was measured elsewhere.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub responses: Vec<ResponseInfo>,
    /// The positions of the periodic estimation records; none without a scheduling channel.
    pub coverage: Option<Coverage>,
    /// Standard deviation of the noise of one sample, by output, median over the periodic experiments; empty without any.
    pub noise: Vec<f64>,
    /// What was found, with its facts.
    #[serde(serialize_with = "finding::serialize")]
    #[schemars(with = "Vec<finding::Row<\'_>>")]
    pub findings: Vec<Finding>,
    /// The same in words, the gravest first; those alike once.
    pub warnings: Vec<String>,
}

/// Channels of one role.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ChannelGroupInfo {
    /// Role: output, input, reference, scheduling, auxiliary.
    pub role: &'static str,
    /// Column names.
    pub columns: Vec<String>,
    /// Units; empty where unknown.
    pub units: Vec<String>,
    /// What each is: position, speed, acceleration, force, other.
    pub quantities: Vec<&'static str>,
}

/// Where the machine was measured, with one scheduling signal.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Coverage {
    /// Positions of periodic estimation records, increasing.
    pub positions: Vec<f64>,
    /// Smallest and largest scheduling value of all records.
    pub range: [f64; 2],
    /// Largest distance between neighbouring positions.
    pub largest_gap: f64,
}

/// Reads and judges a whole bundle.
///
/// # Errors
/// The first clause of the format that a record breaks; an experiment without a frequency response.
pub fn inspect(bundle: &Bundle, progress: Progress<'_>) -> Result<Inspection, PipelineError> {
    let description = bundle.description();
    let counter = Counter::new(progress, "reading records", bundle.len());
    // Records are dropped once their figures are known, so that long ones are never in memory together.
    let of_samples: Vec<usize> = (0..bundle.len())
        .filter(|i| !description.records[*i].is_response())
        .collect();
    let read: Vec<Result<(RecordInfo, Option<Look>), DataError>> = of_samples
        .into_par_iter()
        .map(|i| {
            let entry = &description.records[i];
            let told = if entry.is_periodic() && is_large(bundle, &[i]) {
                (record::describe_large(bundle, i, &entry.file)?, None)
            } else {
                let record = bundle.load(i)?;
                // Periodic records are looked at with their responses.
                let look = (!entry.is_periodic()).then(|| look_at(bundle, &record));
                (
                    record::describe(&record, &entry.file, description.sample_rate_hz),
                    look,
                )
            };
            counter.one();
            Ok(told)
        })
        .collect();
    let read: Vec<(RecordInfo, Option<Look>)> = read.into_iter().collect::<Result<_, _>>()?;
    let (infos, looks): (Vec<RecordInfo>, Vec<Option<Look>>) = read.into_iter().unzip();
    let mut looks: Vec<Look> = looks.into_iter().flatten().collect();
    let measured = measured_responses(bundle, |_| true, progress)?;
    let mut voices = Vec::new();
    let mut coverage = coverage(&infos);
    let mut experiments = Vec::new();
    let entries = &description.records;
    for (purpose, name) in [
        (Purpose::Estimation, "estimation"),
        (Purpose::Validation, "validation"),
    ] {
        let wanted = |i: usize| entries[i].purpose == purpose && entries[i].is_periodic();
        let found = periodic_responses(bundle, wanted, None, progress)?;
        for at in found {
            experiments.push(experiment::describe(name, &at));
            looks.extend(at.looks);
            voices.extend(at.voices);
        }
    }
    if let Some(coverage) = &mut coverage {
        coverage.positions = experiments
            .iter()
            .filter(|e| e.purpose == "estimation")
            .map(|e| &e.position)
            .chain(
                measured
                    .iter()
                    .filter(|m| m.record.purpose == Purpose::Estimation)
                    .map(|m| &m.record.position),
            )
            .filter_map(|p| p.as_ref().and_then(Position::single))
            .collect();
        coverage.positions.sort_by(f64::total_cmp);
        coverage.largest_gap = coverage
            .positions
            .windows(2)
            .map(|w| w[1] - w[0])
            .fold(0.0, f64::max);
    }
    let c = &description.channels;
    let channels = [
        ("output", &c.output),
        ("input", &c.input),
        ("reference", &c.reference),
        ("scheduling", &c.scheduling),
        ("auxiliary", &c.auxiliary),
    ]
    .into_iter()
    .filter(|(_, g)| !g.is_empty())
    .map(|(role, g)| ChannelGroupInfo {
        role,
        columns: g.columns.clone(),
        units: g.units.clone(),
        quantities: (0..g.len()).map(|k| g.quantity_of(k).name()).collect(),
    })
    .collect();
    let noise = (0..if experiments.is_empty() { 0 } else { c.output.len() })
        .map(|i| {
            lpv_numerics::statistics::median(&experiments.iter().map(|e| e.noise[i]).collect::<Vec<_>>())
        })
        .collect();
    let mut inspection = Inspection {
        name: description.name.clone(),
        sample_rate_hz: description.sample_rate_hz,
        controller: description.controller.is_some(),
        channels,
        records: infos,
        experiments,
        responses: measured.iter().map(response::describe).collect(),
        coverage,
        noise,
        findings: Vec::new(),
        warnings: Vec::new(),
    };
    let of_experiment = |e| warnings::of_experiment(e, inspection.controller);
    inspection.findings = finding::examine(bundle, looks.iter(), &voices)
        .into_iter()
        .chain(finding::clocks(bundle, |_| true))
        .chain(measured::compare(bundle, &measured))
        .chain(inspection.experiments.iter().flat_map(of_experiment))
        .chain(inspection.records.iter().flat_map(warnings::of_record))
        .chain(warnings::of_bundle(&inspection))
        .collect();
    let told = finding::told(&inspection.findings);
    inspection.warnings = told.into_iter().map(|(_, sentence)| sentence).collect();
    Ok(inspection)
}

fn coverage(records: &[RecordInfo]) -> Option<Coverage> {
    let ranges: Vec<[f64; 2]> = records
        .iter()
        .filter_map(|r| r.scheduling.first().copied())
        .collect();
    // Several signals cover no interval.
    let one = records.iter().all(|r| r.scheduling.len() < 2);
    (one && !ranges.is_empty()).then(|| Coverage {
        positions: Vec::new(),
        range: [
            ranges.iter().map(|r| r[0]).fold(f64::INFINITY, f64::min),
            ranges.iter().map(|r| r[1]).fold(f64::NEG_INFINITY, f64::max),
        ],
        largest_gap: 0.0,
    })
}
