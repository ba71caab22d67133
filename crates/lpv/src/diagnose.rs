//! What a base model lacks, found on the moves of a bundle, and told as `diagnosis.json`.

mod account;
mod again;
mod axes;
mod axis;
mod base;
mod beginnings;
mod caveat;
mod doubt;
mod encoders;
mod errors;
mod explanation;
mod figures;
mod files;
mod found;
mod free_run;
mod in_band;
mod left;
mod noise;
mod page;
mod places;
mod record_errors;
mod records;
mod responses;
mod saved;
mod user;
mod value;
mod words;

use crate::PipelineError;
use crate::finding::{self, Finding};
use crate::progress::{Progress, begin};
use crate::responses::places::one_signal;
use crate::responses::{examine_records, load_records};
pub use account::{Diagnosis, ResponseErrors, Tested};
pub use axis::{AxisErrors, AxisStage};
use base::Start;
pub(crate) use base::table;
pub use doubt::EQUAL_DB;
pub use errors::{Errors, OutputError};
use experiment_data::Bundle;
pub use explanation::{BaseKind, Explanation};
pub use files::ResultFiles;
pub use found::{Evidence, FoundEffect};
pub use left::{Characterisation, LeftTest, LeftTests};
use lpv_core::{Discrete, FrfEstimate, Model, Record};
use lpv_diagnose::observer::{self, Observer};
use lpv_diagnose::{Case, Explained, TraceError, Track, Verdict, sensor_noise, trace};
pub use lpv_diagnose::{UserEffect, UserParameter, UserState};
use lpv_report::Figure;
pub use noise::NoiseSource;
use noise::{roughness, unrepeated};
pub use places::PlaceName;
use places::record_names;
pub(crate) use places::{in_units, placed};
pub use record_errors::{ForceErrors, FreeRun, RecordErrors, RunErrors};
use records::{check_records, positions_alone, split, wrong_controller};
pub(crate) use responses::is_traced_on_responses;
pub(crate) use saved::range_of;
use saved::saved;
pub use user::{Given, read_effects};
pub use value::Value;

/// A diagnosis with what its page shows.
#[derive(Debug, Clone)]
pub struct Diagnosed {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// Linear part of the model with the effects.
    pub model: Model,
    /// The machine with them.
    pub explanation: Explanation,
    /// The force that would explain the error: in the effects' own coordinates, and over time.
    force: Vec<Figure>,
    /// Errors before and after, over time, or over frequency for responses.
    errors: Figure,
    /// Their spectrum.
    spectrum: Option<Figure>,
    /// An axis that an observer holds, let run free.
    free_run: Option<Figure>,
    /// Errors of the frozen base against the responses.
    frozen: Option<Figure>,
    /// Of a machine of several axes that move by themselves, each axis.
    axes: Vec<Diagnosed>,
}

/// Finds the effects that a model of the bundle's machine lacks. The model is the given one; without one an xy-table from first
/// principles where the bundle has the `[geometry]` of one, a small LFR identified from its periodic records where there is a
/// scheduling, else a servo axis; of an axis without moves, from its frequency responses.
///
/// # Errors
/// A bundle without moves or a base model; one without its controller whose inputs do not each move a position of their own; a
/// model that does not fit the bundle; effects of the user that are wrong; whatever is wrong with its records.
pub fn diagnose(
    bundle: &Bundle,
    given: Given<'_>,
    progress: Progress<'_>,
) -> Result<Diagnosed, PipelineError> {
    user::check(given.effects, bundle)?;
    let of_model = user::of_model(given);
    let given = Given {
        effects: &of_model,
        ..given
    };
    if let (None, Some((positions, reason))) = (given.model, positions_alone(bundle)) {
        let mut found = diagnose(&positions, given, progress)?;
        found.diagnosis.reasons.insert(0, reason);
        return Ok(found);
    }
    let description = bundle.description();
    let channels = &description.channels;
    let is_one = (channels.input.len(), channels.output.len()) == (1, 1);
    check_records(description)?;
    let has_moves = description.records.iter().any(|r| r.is_transient());
    let is_by_itself = description.controller.is_none() && channels.scheduling.is_empty();
    if is_by_itself && !is_one && has_moves && given.model.is_none() {
        return axes::diagnose(bundle, given, progress);
    }
    of_axis(bundle, given, progress)
}

/// The same of a bundle as a whole.
fn of_axis(bundle: &Bundle, given: Given<'_>, progress: Progress<'_>) -> Result<Diagnosed, PipelineError> {
    let description = bundle.description();
    let clock = bundle.clock()?;
    one_signal(bundle, &(0..bundle.len()).collect::<Vec<_>>())?;
    if is_traced_on_responses(bundle) {
        user::need_moves(given)?;
        return match given.model {
            None => responses::diagnose(bundle, progress),
            Some(_) => Err(PipelineError::Structure {
                problem: "effects are traced on the frequency responses of this bundle, which has no moves, from a rigid axis: leave out \
                          --model",
            }),
        };
    }
    let channels = &description.channels;
    let is_known = description.controller.is_some();
    let is_axis = (channels.input.len(), channels.output.len()) == (1, 1) && channels.scheduling.is_empty();
    if !is_known && !is_axis {
        return Err(TraceError::NoController.into());
    }
    let transient = |i: usize| description.records[i].is_transient();
    let mut records = load_records(bundle, transient, progress)?;
    let mut findings = examine_records(bundle, &records);
    if !is_known {
        // The sines of a drive follow from its past too, and an observer takes the inputs as they are.
        findings.retain(|f| !matches!(f, Finding::FeedbackOnly { .. }));
    }
    let contradictions = finding::contradictions(&findings);
    if !is_known {
        observer::check_motion(&records)?;
        records = records.into_iter().map(observer::followed).collect();
    }
    let found = of_moves(bundle, given, (records, clock), progress);
    let found = found.map_err(|e| records::in_view_of(&contradictions, is_known, e))?;
    let diagnosis = found.diagnosis.in_view_of(contradictions);
    Ok(Diagnosed {
        explanation: Explanation {
            effects: diagnosis.effects.clone(),
            ..found.explanation
        },
        diagnosis,
        ..found
    })
}

/// The same of moves that were looked at.
fn of_moves(
    bundle: &Bundle,
    given: Given<'_>,
    (records, clock): (Vec<Record>, Discrete),
    progress: Progress<'_>,
) -> Result<Diagnosed, PipelineError> {
    let description = bundle.description();
    let channels = &description.channels;
    let mut reasons = Vec::new();
    let (fit_records, judge_records) = split(records, &mut reasons)?;
    if description.controller.is_none() {
        observer::check_motion(&judge_records)?;
    }
    let Start {
        base,
        prior,
        free,
        responses,
        model,
    } = base::start(
        bundle,
        given.model,
        (&fit_records, &judge_records),
        clock,
        &mut reasons,
        progress,
    )?;
    let substeps = base.parts(clock.sample_time());
    let (controller, observer) = match &description.controller {
        Some(controller) => (controller.clone(), None),
        None => {
            let observer = Observer::new(&base, &fit_records, clock)?;
            reasons.push(format!(
                "no [controller]: the model follows the records through an observer of {:.3} Hz, driven by the logged inputs",
                observer.hz
            ));
            (observer.controller.clone(), Some(observer))
        }
    };
    let mut observer_hz = observer.as_ref().map(|o| o.hz);
    let band = (
        clock,
        observer_hz.map_or(f64::INFINITY, |hz| observer::FORCE_BAND * hz),
    );
    let mut start = controller.start()?;
    let tracks = |records: &[Record]| -> Result<Vec<Track>, PipelineError> {
        let is_it = |i: &usize, r: &Record| bundle.record_name(*i).is_ok_and(|name| name == r.name);
        let number = |r: &Record| (0..description.records.len()).find(|i| is_it(i, r));
        let track = |r: &Record| -> Result<Track, TraceError> {
            let track = Track::new(r, clock.sample_time(), substeps, Some(&start))?;
            Ok(track.numbered(number(r).map_or(0, |n| n + 1)))
        };
        Ok(records.iter().map(track).collect::<Result<Vec<_>, _>>()?)
    };
    if observer_hz.is_none() {
        reasons.extend(wrong_controller(&fit_records, &start));
    }
    let mut told = [tracks(&fit_records)?, tracks(&judge_records)?];
    if observer_hz.is_some() && !Track::go_both_ways(&told[0], 0) {
        reasons.push(
            "all records go one way: dry friction adds to the constant force and no effect is named; moves there and back, at several speeds, would tell"
                .to_owned(),
        );
    }
    if observer_hz.is_some()
        && let Some((true, [held, running])) = observer::runs_on(&base, &start, &told[0])
    {
        reasons.push(format!(
            "the inputs run on between the samples, as measured signals do: the base leaves {running:.3e} of the outputs, and {held:.3e} \
             where they are held"
        ));
        told = told.map(|t| t.iter().map(Track::running_on).collect());
    }
    let [mut fitted, mut judged] = told.clone();
    let is_observed = observer_hz.is_some();
    let bare = Explained {
        base: base.clone(),
        effects: Vec::new(),
    };
    if is_observed {
        [fitted, judged] = told.each_ref().map(|t| observer::settled(&bare, &start, t));
    }
    let mut noise = match unrepeated(bundle, progress)? {
        (_, left) if left.is_empty() => {
            reasons.push(
                "no periodic records: the noise of a sample is taken from the third differences of the outputs, or of what the base \
                 leaves of them where those are smaller"
                    .to_owned(),
            );
            roughness(&bare, &start, &fitted)
        }
        (position, left) => sensor_noise(&base, &start, &fitted[0], position, &left)?,
    };
    let own = user::placed(given.effects, bundle)?;
    let on_fit = |done, of| progress("competition of effects, fits of one look", done, of);
    begin(progress, "competition of effects");
    let case = Case {
        base: &base,
        prior: prior.as_ref(),
        free: free.as_ref().map(|(base, prior)| (base, prior)),
        controller: &start,
        noise,
        fitted: &[],
        judged: &[],
        own: &own,
        seeks_load: true,
        on_fit: &on_fit,
    };
    let mut found = trace(&Case {
        fitted: &fitted,
        judged: &judged,
        ..case
    })?;
    if is_observed {
        let seen = beginnings::by_the_model(&case, ([fitted, judged], found), &told)?;
        ([fitted, judged], found, noise) = (seen.tracks, seen.found, seen.noise);
    }
    let case = Case {
        noise,
        seeks_load: found.rigid.is_some(),
        ..case
    };
    if is_observed && let Some(begun) = beginnings::look(&case, &found, &told)? {
        ([fitted, judged], found) = (begun.tracks, begun.found);
    }
    let mut slow = None;
    if let Some(observer) = &observer {
        let records = [&fit_records[..], &judge_records[..]];
        let look = again::look(
            &Case {
                fitted: &fitted,
                judged: &judged,
                ..case
            },
            (observer, clock),
            &found,
            records,
            &told,
        )?;
        slow = look.left;
        if let Some(again) = look.again {
            if again.hz < observer.hz {
                reasons.push(format!(
                    "an observer of {:.3} Hz, which takes less of a slow force away, shows what the faster one does not",
                    again.hz
                ));
            }
            observer_hz = Some(again.hz);
            start = again.controller;
            [fitted, judged] = again.tracks;
            found = again.found;
        }
    }
    if let Some(line) = axis::with_load(&found, bundle) {
        reasons.push(line);
        let parts = found.model.base.parts(clock.sample_time());
        [fitted, judged] = [fitted, judged].map(|tracks| tracks.iter().map(|t| t.followed(parts)).collect());
    }
    reasons.extend(doubt::doubts(&found, bundle));
    reasons.extend(user::untried(&own, &found, bundle));
    let steady = match found.verdict {
        Verdict::Unexplained | Verdict::PartlyExplained if is_observed => {
            doubt::steady_force(&found, &start, [&fitted, &judged], bundle)
        }
        _ => None,
    };
    let mut axis = axis::errors(&found, &start, band, &fit_records, &fitted)?;
    axis.extend(axis::errors(&found, &start, band, &judge_records, &judged)?);
    reasons.extend(axis::runs_away(&axis, &found, [&fitted, &judged], bundle));
    let records = match is_observed {
        true => {
            let records: Vec<&Record> = fit_records.iter().chain(&judge_records).collect();
            let tracks: Vec<&Track> = fitted.iter().chain(&judged).collect();
            record_errors::of_records([&found.bare, &found.model], bundle, &axis, &records, &tracks)?
        }
        false => Vec::new(),
    };
    let diagnosis = Diagnosis {
        axis,
        records,
        error_of: if is_observed { "observer" } else { "closed loop" }.to_owned(),
        observer_hz,
        ..Diagnosis::new(bundle, &found, &judged, reasons)
    }
    .in_format(is_observed)
    .and_said(steady)
    .in_view_of_slower(slow, &record_names(bundle));
    let moved = [&fit_records, &judge_records].into_iter().flatten();
    let mut positions: Vec<f64> = moved
        .filter_map(|r| r.scheduling.columns.first())
        .flatten()
        .copied()
        .collect();
    positions.extend(responses.iter().filter_map(FrfEstimate::single_position));
    let model = saved(&found.model.base, model, &found.deviations, &positions)?;
    let mut explanation = Explanation::of_base(&found.model.base, &found.deviations, bundle);
    explanation.effects.clone_from(&diagnosis.effects);
    let first = |i: usize| found.errors[i].first().map_or(&[][..], Vec::as_slice);
    let step = clock.sample_time();
    let outputs = figures::Channel::all(&channels.output);
    let free_run = || {
        let measured = &judge_records[0].outputs.columns[0];
        free_run::figure(&outputs[0], &judged[0], [&found.bare, &found.model], measured)
    };
    Ok(Diagnosed {
        diagnosis,
        model,
        explanation,
        force: figures::of_force(&found, &start, &judged[0], noise, description),
        errors: figures::in_time(&outputs, step, [first(0), first(1)]),
        spectrum: Some(figures::in_spectrum(&outputs, step, &found.errors)),
        free_run: is_observed.then(free_run).flatten(),
        frozen: figures::frozen(&found.model.base, &responses, clock).unwrap_or_default(),
        axes: Vec::new(),
    })
}
