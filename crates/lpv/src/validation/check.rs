//! A model against a bundle.

use super::FrozenError;
use super::bands::Band;
use super::frozen::{Against, frozen_check};
use super::record::{BENT, Context, OBSERVED, bends_a_response, is_refitted};
use super::rigid::AxisCheck;
use super::stable::WITHOUT_RECORDS;
use crate::diagnose::{is_traced_on_responses, placed};
use crate::finding::{self, Finding};
use crate::progress::{Counter, Progress};
use crate::responses::{examine_records, load_records, places};
use crate::signal::fit_percent;
use crate::verdict::{Stability, Verdict};
use crate::{ModelFile, PipelineError};
use experiment_data::Bundle;
use lpv_core::{Frf, FrfEstimate, Model, Purpose, Record};
use lpv_simulate::{CrossCorrelation, Frozen, Machine, Run, Whiteness, disturbance};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

/// What `lpv validate` finds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Validation {
    /// What the model is worth on these records; its sentence is the first line.
    pub verdict: Verdict,
    /// Kind of the model, in words.
    pub model: String,
    /// Against the frequency responses; none without periodic records.
    pub frozen: Option<FrozenCheck>,
    /// Standard deviation of the noise of one sample, by output; none without periodic records.
    pub noise: Option<Vec<f64>>,
    /// How the model answers a bounded input in open loop, at rest in the middle of its range.
    pub stability: Stability,
    /// Along the transient records.
    pub records: Vec<RecordCheck>,
    /// What was seen in these records themselves.
    #[serde(serialize_with = "finding::serialize")]
    #[schemars(with = "Vec<finding::Row<\'_>>")]
    pub findings: Vec<Finding>,
    /// What was not done, and why.
    pub notes: Vec<String>,
}

/// The frozen model against frequency responses.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FrozenCheck {
    /// Use of the records behind the responses: `validation` where there are periodic ones, else `estimation`.
    pub source: &'static str,
    /// Positions compared; empty without scheduling.
    pub positions: Vec<f64>,
    /// Largest and median relative error.
    pub error: FrozenError,
    /// Median relative noise of the responses, dB; none where it is assumed.
    pub noise_db: Option<f64>,
    /// Median of error over stated deviation, whole matrix: 1 says that the error is the noise of the response. None where it is
    /// assumed.
    pub error_over_noise: Option<f64>,
    /// Root mean square of the error relative to that of the response, by output, percent.
    pub relative_rms_percent: Vec<f64>,
    /// The error band by band, lowest first.
    pub bands: Vec<Band>,
}

/// The model along one record.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RecordCheck {
    /// Name.
    pub name: String,
    /// `validation` or `estimation`.
    pub purpose: &'static str,
    /// First sample that is judged: what lies before was fitted.
    pub from: usize,
    /// Whether the scheduling signals of an LPV model move along it.
    pub moves: bool,
    /// How the state starts: `at rest` or `fitted to the first samples`.
    pub start: &'static str,
    /// Every output.
    pub outputs: Vec<OutputCheck>,
    /// Autocorrelation of the one-step residuals.
    pub whiteness: Vec<Whiteness>,
    /// Correlation of the one-step residuals with the inputs.
    pub cross_correlation: Vec<CrossCorrelation>,
    /// Forces and velocities of rigid-body axes; empty for other models.
    pub axes: Vec<AxisCheck>,
}

/// Errors of one output.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OutputCheck {
    /// Column.
    pub name: String,
    /// Unit; empty where unknown.
    pub unit: String,
    /// One step ahead, of a model with effects about its simulation; none where there is no stable predictor.
    pub one_step: Option<ErrorFigure>,
    /// Simulated from the recorded inputs.
    pub open_loop: ErrorFigure,
    /// Part of the power of that error, 0 to 1, that the inputs explain linearly: what a better linear model would take away.
    pub open_loop_by_inputs: f64,
    /// Part of it that its own past predicts: what a disturbance or an effect that the model lacks leaves, and noise does not.
    pub open_loop_predictable: f64,
    /// Root mean square of the change of the output from one sample to the next: the error of predicting no change.
    pub change_rms: f64,
    /// Simulated with the controller from the recorded references; none without a controller and references.
    pub closed_loop: Option<ErrorFigure>,
}

/// An error in time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ErrorFigure {
    /// Root mean square, in the unit of the output.
    pub rms: f64,
    /// The same over the deviation of the noise of one sample.
    pub over_noise: Option<f64>,
    /// `100 (1 - |error| / |y - mean y|)`.
    pub fit_percent: f64,
}

/// Which records are judged in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Those held out; where there are none, the part that the model was not fitted to, or all with a note.
    HeldOut,
    /// Also those with use = "estimation".
    All,
}

/// What a validation was made from, for figures.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    /// Frequency responses, by position.
    pub estimates: Vec<FrfEstimate>,
    /// The model's responses at the same positions and lines.
    pub responses: Vec<Frf>,
    /// Every record judged in time, its open-loop simulation and the closed-loop one.
    pub runs: Vec<(Record, Run, Option<Run>)>,
}

/// Compares a model with everything that the bundle holds out.
///
/// # Errors
/// A model that does not fit the bundle; whatever is wrong with its records.
pub fn validate(
    file: &ModelFile,
    bundle: &Bundle,
    scope: Scope,
    progress: Progress<'_>,
) -> Result<(Validation, Evidence), PipelineError> {
    let known = Known {
        hold_out: file.identification.as_ref().map_or(0.0, |i| i.config.hold_out),
        responses: None,
    };
    validate_knowing(file, bundle, scope, known, progress)
}

/// What is known of the records that a model was made from.
#[derive(Clone, Copy)]
pub(crate) struct Known<'a> {
    /// Last part of each transient estimation record that was not fitted.
    pub(crate) hold_out: f64,
    /// Responses of the estimation records, and the standard deviation of the noise of one sample by output where periods tell it;
    /// none where they are still to be estimated.
    pub(crate) responses: Option<(&'a [FrfEstimate], Option<&'a [f64]>)>,
}

/// The same with what is known already.
pub(crate) fn validate_knowing(
    file: &ModelFile,
    bundle: &Bundle,
    scope: Scope,
    known: Known<'_>,
    progress: Progress<'_>,
) -> Result<(Validation, Evidence), PipelineError> {
    let description = bundle.description();
    let clock = bundle.clock()?;
    places::one_signal(bundle, &(0..bundle.len()).collect::<Vec<_>>())?;
    let machine = Machine::new(&file.model, clock)?;
    if places::several_signals(bundle) && machine.range().is_some_and(|range| range.parameters() == 1) {
        return Err(PipelineError::Structure {
            problem: "the model has one scheduling signal and the bundle several: keep that of the model in [channels.scheduling] and \
                      name the others in [channels.auxiliary]",
        });
    }
    let explained = match &file.explanation {
        Some(explanation) => Some(explanation.machine(&file.model, bundle)?),
        None => None,
    };
    let effects = explained.as_ref().filter(|e| !e.effects.is_empty());
    // Effects that were traced on responses add the outputs that they need.
    let traced = effects.filter(|_| is_traced_on_responses(bundle));
    let (inputs, outputs) = machine.channels();
    let found = (
        description.channels.input.len(),
        description.channels.output.len(),
    );
    if found != (inputs, outputs) && traced.is_none() {
        return Err(PipelineError::Channels {
            model: (inputs, outputs),
            bundle: found,
        });
    }
    let mut notes = Vec::new();
    let entries = &description.records;
    let moves = |i: usize| entries[i].is_transient();
    let transient = load_records(bundle, moves, progress)?;
    let Against {
        check: frozen,
        noise,
        estimates,
        responses,
    } = frozen_check(&machine, traced, bundle, known.responses, &mut notes, progress)?;
    let hold_out = known.hold_out;
    let held_out = transient.iter().any(|r| r.purpose == Purpose::Validation);
    let judged: Vec<&Record> = transient
        .iter()
        .filter(|r| scope == Scope::All || !held_out || r.purpose == Purpose::Validation)
        .collect();
    let (judged, outside): (Vec<&Record>, Vec<&Record>) =
        judged.into_iter().partition(|r| inside(&machine, r));
    for record in outside {
        notes.push(format!(
            "record {} leaves the range {:?} of the model and was not simulated; a model is not known beyond the positions that it was made from",
            record.name,
            machine.range().map_or(&[][..], |r| r.bounds())
        ));
    }
    if !held_out && !judged.is_empty() {
        notes.push(if hold_out > 0.0 {
            format!("no transient validation record: judged on the last {:.0} % of those for estimation, which were held out", 100.0 * hold_out)
        } else {
            "no transient validation record: those for estimation are judged, which tells less".to_owned()
        });
    }
    let controller = description
        .controller
        .as_ref()
        .filter(|_| !description.channels.reference.is_empty());
    if controller.is_none() && !judged.is_empty() {
        notes.push(
            match description.channels.reference.is_empty() {
                true => "no reference channel: the records are compared in open loop, by their inputs",
                false => "closed loop not simulated: the bundle has no [controller]",
            }
            .to_owned(),
        );
    }
    let refitted = explained.as_ref().is_some_and(is_refitted);
    if machine.gain().is_none()
        && !refitted
        && !judged.is_empty()
        && transient.iter().all(|r| r.purpose == Purpose::Validation)
    {
        notes.push("one step: the level of the disturbance behind the gain was chosen on the first judged record, as no other moves".to_owned());
    }
    if let Some(effects) = effects {
        let names: Vec<String> = effects.effects.iter().map(|(e, _)| placed(e, bundle)).collect();
        let names = names.join(", ");
        notes.push(match traced {
            Some(_) => format!("the response is that of the model with its effects ({names})"),
            None => format!(
                "along records the model is simulated with its effects ({names}); the frozen response is that of its linear part, and the prediction is one about the simulation, with the disturbance that is most likely on each record"
            ),
        });
    }
    if explained
        .as_ref()
        .is_some_and(|e| matches!(e.base, lpv_diagnose::Base::Lpv(_)))
    {
        notes.push(
            "along records the gains and the time scale of the explanation are applied; the frozen response is that of the matrices as they were identified"
                .to_owned(),
        );
    }
    let context = Context {
        machine: &machine,
        explained: explained.as_ref(),
        body: match &file.model {
            Model::RigidBody(body) => Some(body),
            _ => None,
        },
        clock,
        controller,
        noise: noise.as_deref(),
        units: &description.channels.output.units,
        disturbance: match refitted {
            true => 0.0,
            false => disturbance(&machine, &transient, noise.as_deref()),
        },
    };
    let counter = Counter::new(progress, "simulating", judged.len());
    let checked = judged
        .par_iter()
        .map(|record| {
            let from = match record.purpose {
                Purpose::Estimation => {
                    ((1.0 - hold_out) * record.len() as f64).round() as usize % record.len()
                }
                Purpose::Validation => 0,
            };
            let check = context.record(record, from);
            counter.one();
            check
        })
        .collect::<Vec<_>>();
    let mut records = Vec::new();
    let mut runs = Vec::new();
    let mut findings = examine_records(bundle, &transient);
    for (along, record) in checked.into_iter().zip(judged) {
        let along = along?;
        for note in along.notes {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        findings.extend(along.findings);
        records.push(along.check);
        runs.push((record.clone(), along.open, along.closed));
    }
    /// Places along each scheduling signal at which it must be stable.
    const PLACES: usize = 9;
    let longest = runs.iter().map(|(record, ..)| record.len()).max();
    let centre = machine.range().map_or_else(Vec::new, |r| r.centre());
    let stability = super::stability(&machine.at(&centre)?.poles()?, longest.unwrap_or(WITHOUT_RECORDS));
    let closed_loop = description.controller.is_some() || under_feedback(&runs);
    // An open loop says nothing of a machine with effects, which a diagnosis has held at its records.
    let is_observed = file.explanation.is_some() && description.controller.is_none();
    let verdict = match is_observed && !records.is_empty() {
        true => Verdict::not_judged(OBSERVED),
        false => {
            let is_bent = explained.as_ref().is_some_and(bends_a_response) && !records.is_empty();
            let response = frozen.as_ref().filter(|_| !is_bent);
            if is_bent && frozen.is_some() {
                notes.push(BENT.to_owned());
            }
            Verdict::of(response, &records, stability, closed_loop, &notes)
        }
    };
    let in_open_loop = description.controller.is_none() && description.channels.reference.columns.is_empty();
    let mut verdict = verdict;
    if in_open_loop && records.is_empty() {
        let grid = machine.range().map_or_else(Vec::new, |r| r.grid(PLACES));
        for p in std::iter::once(centre).chain(grid) {
            let poles = machine.at(&p)?.poles()?;
            if let Stability::Unstable { radius } = super::stability(&poles, WITHOUT_RECORDS) {
                verdict = verdict.unstable(radius);
                break;
            }
        }
    }
    let validation = Validation {
        verdict: verdict.in_view_of(&findings),
        findings,
        model: file.model.describe(),
        frozen,
        noise,
        stability,
        records,
        notes,
    };
    let evidence = Evidence {
        estimates,
        responses,
        runs,
    };
    Ok((validation, evidence))
}

/// Whether every judged record has references that move and are not its inputs: feedback may hold a machine that is unstable.
fn under_feedback(runs: &[(Record, Run, Option<Run>)]) -> bool {
    let held = |(record, ..): &(Record, Run, Option<Run>)| {
        let references = &record.references.columns;
        references.iter().any(|r| r.iter().any(|v| *v != r[0])) && *references != record.inputs.columns
    };
    !runs.is_empty() && runs.iter().all(held)
}

/// Whether the scheduling signals stay where the model is known; a record without them is for the simulation to refuse.
fn inside(machine: &Machine, record: &Record) -> bool {
    let Some(range) = machine.range() else { return true };
    if record.scheduling.columns.is_empty() {
        return record.position.as_ref().is_none_or(|p| range.check(p).is_ok());
    }
    (0..record.len()).all(|k| {
        let p: Vec<f64> = record.scheduling.columns.iter().map(|c| c[k]).collect();
        range.check(&p).is_ok()
    })
}

impl ErrorFigure {
    pub(super) fn new(measured: &[f64], error: &[f64], noise: Option<f64>) -> Self {
        let rms = (error.iter().map(|e| e * e).sum::<f64>() / error.len().max(1) as f64).sqrt();
        Self {
            rms,
            over_noise: noise.filter(|n| *n > 0.0).map(|n| rms / n),
            fit_percent: fit_percent(measured, error),
        }
    }
}
