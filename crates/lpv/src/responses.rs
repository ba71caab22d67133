//! Bundle in, one frequency response with covariance a position out.

mod by_place;
mod injection;
mod large;
mod length;
pub(crate) mod measured;
pub(crate) mod places;

use self::injection::take_injections;
use self::length::to_one_length;
pub(crate) use self::measured::BELOW_RATE;
use self::measured::{join, measured_responses};
use crate::PipelineError;
use crate::finding::{self, Finding, Look, Voice, Watch};
use crate::inspect::{describe_responses, of_experiment};
use crate::period_noise::period_noise;
use crate::progress::{Counter, Progress};
pub use by_place::records_by_place;
use by_place::runs_of;
use experiment_data::Bundle;
use frf_estimation::{
    FrfError, LocalSettings, PeriodicEstimate, PeriodicSettings, Regressor, SkipRule, estimate_records,
    local_rational,
};
pub(crate) use large::is_large;
use lpv_core::{Discrete, FrfEstimate, Position, Purpose, Record};
use lpv_numerics::statistics::median;
pub(crate) use places::rests;
use places::{Placed, rest_position};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Frequency responses at every position of a bundle, in order of position.
#[derive(Debug)]
pub struct Responses {
    /// The clock of the records.
    pub clock: Discrete,
    /// One estimate a position.
    pub estimates: Vec<FrfEstimate>,
    /// Deviation of the noise of one sample, by output, where periods tell it.
    pub noise: Option<Vec<f64>>,
    /// How they were made, in words.
    pub reasons: Vec<String>,
    /// What was found in the data on the way.
    pub findings: Vec<Finding>,
}

/// The records of samples of a bundle for which `wanted` holds, by index, in the order of the bundle.
///
/// # Errors
/// What is wrong with the first record that cannot be read.
pub fn load_records(
    bundle: &Bundle,
    wanted: impl Fn(usize) -> bool,
    progress: Progress<'_>,
) -> Result<Vec<Record>, PipelineError> {
    let entries = &bundle.description().records;
    let indices: Vec<usize> = (0..bundle.len())
        .filter(|&i| !entries[i].is_response() && wanted(i))
        .collect();
    bundle.check_memory(&indices)?;
    let counter = Counter::new(progress, "reading records", indices.len());
    let records = indices
        .par_iter()
        .map(|&i| {
            let record = bundle.load(i);
            counter.one();
            record
        })
        // Collected before the first error is taken, so that it is the first in the file and not in time.
        .collect::<Vec<_>>();
    Ok(records.into_iter().collect::<Result<Vec<_>, _>>()?)
}

/// The frequency response at every position: from the periodic estimation records and those that were measured elsewhere, or, where
/// there are neither, from the transient ones at constant position by the local rational method.
///
/// # Errors
/// [`PipelineError::NoResponses`]; whatever is wrong with a record or an experiment.
pub fn estimate_bundle(
    bundle: &Bundle,
    skip_periods: Option<usize>,
    progress: Progress<'_>,
) -> Result<Responses, PipelineError> {
    estimate_part(bundle, |_| true, skip_periods, progress)
}

/// The same from the records for which `part` holds alone: of one list of [`records_by_place`] the response that
/// [`estimate_bundle`] gives there, to the last bit.
///
/// # Errors
/// Those of [`estimate_bundle`].
pub fn estimate_part(
    bundle: &Bundle,
    part: impl Fn(usize) -> bool + Sync,
    skip_periods: Option<usize>,
    progress: Progress<'_>,
) -> Result<Responses, PipelineError> {
    let entries = &bundle.description().records;
    let periodic = |i: usize| entries[i].is_periodic();
    let fitted = |i: usize| entries[i].purpose == Purpose::Estimation;
    let clock = bundle.clock()?;
    let any_periodic = (0..bundle.len()).any(|i| fitted(i) && periodic(i));
    let is_measured = |i: usize| entries[i].is_response();
    let any_measured = (0..bundle.len()).any(|i| fitted(i) && is_measured(i));
    let by_frequency = |i: usize| periodic(i) || is_measured(i);
    let used = |i: usize| part(i) && fitted(i) && (by_frequency(i) || !(any_periodic || any_measured));
    let indices: Vec<usize> = (0..bundle.len()).filter(|i| used(*i)).collect();
    places::one_signal(bundle, &indices)?;
    let several = places::several_signals(bundle);
    let measured = measured_responses(bundle, |i| part(i) && fitted(i), progress)?;
    if any_periodic || any_measured {
        let found = periodic_responses(bundle, |i| used(i) && periodic(i), skip_periods, progress)?;
        // One place of several signals has no p that a model of one parameter knows.
        let of_model = |e: FrfEstimate| if several { e.without_position() } else { e };
        let controller = bundle.description().controller.is_some();
        let figures = found.iter().map(|at| describe_responses("estimation", at));
        return Ok(Responses {
            clock,
            findings: findings(bundle, &found)
                .into_iter()
                .chain(finding::clocks(bundle, |i| used(i) && periodic(i)))
                .chain(figures.flat_map(|e| of_experiment(&e, controller)))
                .chain(measured::compare(bundle, &measured))
                .collect(),
            noise: any_periodic.then(|| sample_noise(&found)),
            estimates: join(
                found.into_iter().map(|f| f.estimate.estimate).collect(),
                &measured,
            )?
            .into_iter()
            .map(of_model)
            .collect(),
            reasons: measured.into_iter().flat_map(|m| m.reasons).collect(),
        });
    }
    let mut records = load_records(bundle, used, progress)?;
    let findings = examine_records(bundle, &records);
    if several {
        records.iter_mut().for_each(|r| r.position = None);
    } else if places::is_scheduled(bundle) {
        records.iter_mut().for_each(|r| rest_position(r, bundle));
        records.retain(|r| r.position.is_some());
    }
    if records.is_empty() {
        return Err(PipelineError::NoResponses {
            bundle: bundle.description().name.clone(),
        });
    }
    take_injections(&mut records);
    let (estimates, reason) = estimate_local(records, clock, progress)?;
    Ok(Responses {
        clock,
        estimates,
        noise: None,
        reasons: vec![reason],
        findings,
    })
}

/// The periodic records of one position, evaluated.
pub(crate) struct AtPosition {
    pub(crate) estimate: PeriodicEstimate,
    /// Deviation of the noise of one sample, by output: what does not repeat from period to period.
    pub(crate) noise: Vec<f64>,
    /// Names of the records.
    pub(crate) records: Vec<String>,
    /// What each of them told while it was read, and what it says at some lines.
    pub(crate) looks: Vec<Look>,
    pub(crate) voices: Vec<Voice>,
}

impl AtPosition {
    pub(crate) fn new(
        bundle: &Bundle,
        estimate: PeriodicEstimate,
        noise: Vec<f64>,
        mut looks: Vec<Look>,
    ) -> Self {
        let saturations = finding::saturations(bundle, &looks, &estimate);
        // Those of one place say it alike: the first does for all.
        if let (Some(found), Some(look)) = (saturations.into_iter().next(), looks.first_mut()) {
            look.findings.push(found);
        }
        Self {
            voices: finding::voices(&looks, &estimate),
            records: looks.iter().map(|l| l.record.clone()).collect(),
            estimate,
            noise,
            looks,
        }
    }
}

/// One look at a whole record.
pub(crate) fn look_at(bundle: &Bundle, record: &Record) -> Look {
    let mut watch = Watch::new(bundle);
    watch.push(record);
    watch.finish()
}

/// What records of any kind say, each by itself and their positions together.
pub(crate) fn examine_records(bundle: &Bundle, records: &[Record]) -> Vec<Finding> {
    let looks: Vec<Look> = records.par_iter().map(|r| look_at(bundle, r)).collect();
    let mut found = finding::examine(bundle, looks.iter(), &[]);
    let names: BTreeSet<&str> = records.iter().map(|r| r.name.as_str()).collect();
    found.extend(finding::clocks(bundle, |i| {
        bundle.record_name(i).is_ok_and(|n| names.contains(n))
    }));
    found
}

/// What periodic records say, each by itself and against each other.
fn findings(bundle: &Bundle, found: &[AtPosition]) -> Vec<Finding> {
    let voices: Vec<Voice> = found.iter().flat_map(|at| at.voices.iter().cloned()).collect();
    finding::examine(bundle, found.iter().flat_map(|at| &at.looks), &voices)
}

/// The median of the noise over positions, by output.
pub(crate) fn sample_noise(found: &[AtPosition]) -> Vec<f64> {
    (0..found.first().map_or(0, |f| f.noise.len()))
        .map(|i| median(&found.iter().map(|f| f.noise[i]).collect::<Vec<_>>()))
        .collect()
}

/// The FRF by position of the periodic records for which `wanted` holds, in order of position. Those of one position a thread are
/// in memory at a time, or a period of each where the files are large.
///
/// # Errors
/// [`PipelineError::Frf`] with the position and the records; what is wrong with the first record that cannot be read.
pub(crate) fn periodic_responses(
    bundle: &Bundle,
    wanted: impl Fn(usize) -> bool,
    skip_periods: Option<usize>,
    progress: Progress<'_>,
) -> Result<Vec<AtPosition>, PipelineError> {
    let clock = bundle.clock()?;
    let skip = skip_periods.map_or(SkipRule::Auto, SkipRule::Fixed);
    let indices: Vec<usize> = (0..bundle.len()).filter(|&i| wanted(i)).collect();
    let (placed, runs) = runs_of(bundle, &indices)?;
    let counter = Counter::new(progress, "frequency responses", indices.len());
    let found: Vec<Result<AtPosition, (usize, PipelineError)>> = runs
        .into_par_iter()
        .map(|run| {
            let run = &placed[run];
            let indices: Vec<usize> = run.iter().map(|p| p.index).collect();
            let position = common(run.iter().map(|p| p.place.as_ref().map(|place| &place.position)));
            if is_large(bundle, &indices) {
                return large::evaluate(bundle, &indices, position, (clock, skip), &counter);
            }
            let mut records = Vec::with_capacity(run.len());
            let mut looks = Vec::with_capacity(run.len());
            for i in indices {
                let mut record = bundle.load(i).map_err(|e| (i, e.into()))?;
                let look = look_at(bundle, &record);
                look.level(&mut record, 0);
                looks.push(look);
                records.push(Record {
                    position: position.clone(),
                    ..record
                });
                counter.one();
            }
            take_injections(&mut records);
            let settings = periodic_settings(skip);
            let group: Vec<&Record> = records.iter().collect();
            let estimate = at_position(&group, |group| estimate_records(group, clock, &settings))
                .map_err(|e| (usize::MAX, e))?;
            let noise = period_noise(&records, estimate.periods_skipped);
            Ok(AtPosition::new(bundle, estimate, noise, looks))
        })
        .collect();
    let mut all = Vec::with_capacity(found.len());
    // The first in the file, not in time; an experiment without a response comes after what cannot be read.
    let mut failed: Option<(usize, PipelineError)> = None;
    for result in found {
        match result {
            Ok(found) => all.push(found),
            Err(error) if failed.as_ref().is_none_or(|first| error.0 < first.0) => failed = Some(error),
            Err(_) => {}
        }
    }
    match failed {
        Some((_, error)) => Err(error),
        None => Ok(all),
    }
}

fn periodic_settings(skip: SkipRule) -> PeriodicSettings {
    PeriodicSettings {
        skip,
        ..PeriodicSettings::default()
    }
}

/// The FRF of transient records by position, by the local rational method, and the choice of its regressor in words.
///
/// # Errors
/// [`PipelineError::Frf`] with the position and the records.
pub fn estimate_local(
    mut records: Vec<Record>,
    clock: Discrete,
    progress: Progress<'_>,
) -> Result<(Vec<FrfEstimate>, String), PipelineError> {
    let moves = |r: &Record| {
        r.references.channels() == r.inputs.channels()
            && r.references.columns.iter().all(|c| c.iter().any(|v| *v != c[0]))
    };
    let references = records.iter().all(moves);
    let regressor = if references {
        Regressor::References
    } else {
        Regressor::Inputs
    };
    let settings = LocalSettings {
        regressor,
        ..LocalSettings::default()
    };
    let cut = to_one_length(&mut records);
    let estimates = by_position(&mut records, progress, |group| {
        local_rational(group, clock, &settings).map(|e| e.estimate)
    })?;
    let reason = if references {
        "no periodic records: local rational method, the references explain outputs and inputs".to_owned()
    } else {
        "no periodic records: local rational method from inputs to outputs; in closed loop the noise that is fed back biases it"
            .to_owned()
    };
    Ok((estimates, reason + &cut))
}

/// Applies an estimator to the records of each position, in parallel.
fn by_position<T: Send>(
    records: &mut [Record],
    progress: Progress<'_>,
    estimate: impl Fn(&[&Record]) -> Result<T, FrfError> + Sync,
) -> Result<Vec<T>, PipelineError> {
    let mut placed: Vec<Placed> = records
        .iter()
        .enumerate()
        .map(|(i, r)| Placed::of(r, i))
        .collect();
    let runs = places::runs(&mut placed)?;
    let mut sorted: Vec<&mut Record> = Vec::with_capacity(records.len());
    let mut all: Vec<Option<&mut Record>> = records.iter_mut().map(Some).collect();
    sorted.extend(placed.iter().filter_map(|p| all[p.index].take()));
    let mut groups: Vec<Vec<&mut Record>> = Vec::with_capacity(runs.len());
    for run in runs.iter().rev() {
        groups.push(sorted.split_off(run.start));
    }
    groups.reverse();
    let counter = Counter::new(progress, "frequency responses", groups.len());
    groups
        .into_par_iter()
        .map(|mut group| {
            let position = common(group.iter().map(|r| r.position.as_ref()));
            group.iter_mut().for_each(|r| r.position.clone_from(&position));
            let group: Vec<&Record> = group.iter().map(|r| &**r).collect();
            let found = at_position(&group, &estimate);
            counter.one();
            found
        })
        .collect::<Vec<_>>()
        .into_iter()
        .collect()
}

/// An estimate from the records of one position.
fn at_position<T>(
    records: &[&Record],
    estimate: impl Fn(&[&Record]) -> Result<T, FrfError>,
) -> Result<T, PipelineError> {
    estimate(records).map_err(|source| {
        let position = records.first().and_then(|r| r.position.as_ref());
        place(position, records.iter().map(|r| r.name.as_str()), source)
    })
}

/// The error of an estimate with its place.
fn place<'a>(
    position: Option<&Position>,
    records: impl Iterator<Item = &'a str>,
    source: FrfError,
) -> PipelineError {
    let at = position.map_or(String::new(), |p| format!("position {p:.6}, "));
    let place = format!("{at}records {}", records.collect::<Vec<_>>().join(", "));
    PipelineError::Frf { place, source }
}

/// The position of a run: where records are at the same one, exactly that.
fn common<'a>(positions: impl Iterator<Item = Option<&'a Position>>) -> Option<Position> {
    let all: Option<Vec<&Position>> = positions.collect();
    let all = all.filter(|all| !all.is_empty())?;
    let first = all[0];
    let mean = |i: usize| first[i] + all.iter().map(|p| p[i] - first[i]).sum::<f64>() / all.len() as f64;
    Some((0..first.len()).map(mean).collect::<Vec<f64>>().into())
}
