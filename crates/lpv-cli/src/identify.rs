//! Bundle in, model out: which chain serves, and its account.

use crate::deviation::FrozenDeviation;
use crate::diagnose::{self, Explanation};
use crate::finding::{self, Severity};
use crate::inspect::inspect;
use crate::moves::Moves;
use crate::pipeline::{Identified, identify};
use crate::progress::{Progress, silent};
use crate::responses::{estimate_bundle, estimate_local, examine_records, load_records};
use crate::signal::fit_percent;
use crate::summary::{AxisSummary, HeldOut, OrderRow, Summary, TimeSummary};
use crate::validation::{Known, Scope, validate_knowing};
use crate::verdict::Verdict;
use crate::{Direct, FitFocus, IdentifyConfig, LfrKind, ModelFile, PipelineError, Structure};
use experiment_data::Bundle;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Discrete, FrfEstimate, Model, Purpose, Record, StateSpace};
use lti_ident::{DirectTerm, Focus, InnovationFit, InnovationSettings, OrderEntry, Segment};
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, fit};
use rayon::prelude::*;
use residual_trace::Base;

/// A model with its account.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The model.
    pub model: Model,
    /// The account.
    pub summary: Summary,
    /// How well the frozen response is known; only of a small LFR from responses of known noise.
    pub deviation: Option<FrozenDeviation>,
    /// The machine behind it; only from first principles.
    pub explanation: Option<Explanation>,
    /// The stages behind it.
    pub stages: Stages,
}

/// The stages of one chain, for whoever wants to look inside.
#[derive(Debug, Clone)]
pub enum Stages {
    /// From frequency responses: pole fit, and with several positions basis, regression, interpolation, LFR.
    Frequency(Box<Identified>),
    /// From records without periods: prediction error.
    Time(Box<InnovationFit>),
    /// The xy-table from first principles.
    Table(Box<residual_trace::FrozenFit>),
    /// A diagnosis.
    Diagnosis,
    /// Servo axes.
    Axes(Box<lti_ident::rigid_body::RigidBodyFit>),
}

/// Identifies a model from the estimation records of a bundle.
///
/// With a scheduling channel and several positions the model is LPV; else it is time-invariant: from periodic records by
/// the pole fit, from others by a prediction-error fit that starts at the local rational response. What the
/// configuration gives is taken; all else is chosen from the data, with the reason in the summary.
///
/// # Errors
/// Those of the stages, with file, record or position.
pub fn identify_bundle(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Outcome, PipelineError> {
    config.check()?;
    let entries = &bundle.description().records;
    let periodic = entries
        .iter()
        .any(|e| e.purpose == Purpose::Estimation && e.is_periodic());
    let scheduled = !bundle.description().channels.scheduling.is_empty();
    let judge = |outcome: Outcome| judged(outcome, bundle, config, None, progress);
    let outcome = match config.structure {
        Some(Structure::RigidBody) => axes(bundle, config, progress).and_then(judge),
        Some(Structure::XyTable) => table(bundle, progress).and_then(judge),
        Some(Structure::Lti) if !periodic => in_time(bundle, config, progress).and_then(judge),
        None if !periodic && !scheduled => in_time(bundle, config, progress).and_then(judge),
        structure => in_frequency(bundle, structure, config, progress),
    };
    outcome.map_err(|refused| with_cause(refused, bundle))
}

/// A refusal with what is wrong with the data behind it, where they contradict themselves.
fn with_cause(refused: PipelineError, bundle: &Bundle) -> PipelineError {
    if matches!(refused, PipelineError::Data(_)) {
        return refused;
    }
    let found = inspect(bundle, &silent).map_or_else(|_| Vec::new(), |found| found.findings);
    match found
        .into_iter()
        .find(|f| f.severity() == Severity::Contradiction)
    {
        Some(finding) => PipelineError::Contradicted {
            finding: Box::new(finding),
            refused: Box::new(refused),
        },
        None => refused,
    }
}

/// The outcome with its verdict: the model against what the bundle holds out, else against what it was made from.
fn judged(
    mut outcome: Outcome,
    bundle: &Bundle,
    config: &IdentifyConfig,
    responses: Option<(&[FrfEstimate], Option<&[f64]>)>,
    progress: Progress<'_>,
) -> Result<Outcome, PipelineError> {
    let file = ModelFile {
        model: outcome.model.clone(),
        identification: None,
        explanation: outcome.explanation.clone(),
    };
    let known = Known {
        hold_out: config.hold_out,
        responses,
    };
    let verdict = match validate_knowing(&file, bundle, Scope::HeldOut, known, progress) {
        Ok((found, _)) => found.verdict,
        // A model that cannot be run along a record is written all the same, and the first line says so.
        Err(error) => Verdict::unjudged(&error),
    };
    let contradictions = finding::contradictions(&outcome.summary.findings);
    outcome.summary.verdict = Some(verdict.in_view_of(contradictions));
    Ok(outcome)
}

fn in_frequency(
    bundle: &Bundle,
    structure: Option<Structure>,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Outcome, PipelineError> {
    let responses = estimate_bundle(bundle, config.skip_periods, progress)?;
    let positions = responses.estimates.len();
    let scheduled = !bundle.description().channels.scheduling.is_empty();
    if structure == Some(Structure::Lpv) && !scheduled {
        return Err(PipelineError::Structure {
            problem: "structure = \"lpv\" needs [channels.scheduling], and the bundle has none; name the position's column there",
        });
    }
    if structure == Some(Structure::Lpv) && positions == 1 {
        return Err(PipelineError::Structure {
            problem: "structure = \"lpv\" needs records at several positions, and the bundle has one; measure more, or use structure = \"lti\"",
        });
    }
    if structure == Some(Structure::Lti) && positions > 1 {
        return Err(PipelineError::Structure {
            problem: "structure = \"lti\" is for one position and the bundle has several; leave the structure to the data, or make a bundle of one position",
        });
    }
    let moves = match config.lfr {
        LfrKind::Small if positions > 1 => Moves::of(bundle, config, &responses, progress)?,
        _ => Moves::none("the exact LFR does not use them"),
    };
    let identified = identify(&responses.estimates, responses.clock, &moves, config, progress)?;
    let mut summary = Summary::of_responses(&identified, &responses.estimates, responses.clock)?;
    summary.reasons.splice(0..0, responses.reasons);
    summary.findings = responses.findings;
    let outcome = Outcome {
        explanation: None,
        deviation: FrozenDeviation::of(&identified, &responses.estimates, responses.clock)?,
        model: identified.model()?,
        summary,
        stages: Stages::Frequency(Box::new(identified)),
    };
    let known = (responses.estimates.as_slice(), responses.noise.as_deref());
    judged(outcome, bundle, config, Some(known), progress)
}

/// The estimation records, and the last sample of each that may be fitted.
fn estimation_records(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<(Vec<Record>, Vec<usize>), PipelineError> {
    let entries = &bundle.description().records;
    let records = load_records(bundle, |i| entries[i].purpose == Purpose::Estimation, progress)?;
    if records.is_empty() {
        return Err(PipelineError::NoResponses {
            bundle: bundle.description().name.clone(),
        });
    }
    let fitted = records.iter().map(|r| fitted_samples(r, config)).collect();
    Ok((records, fitted))
}

/// Samples of a record that are not held out.
pub(crate) fn fitted_samples(record: &Record, config: &IdentifyConfig) -> usize {
    ((1.0 - config.hold_out) * record.len() as f64).round() as usize
}

/// Numbers of states that are tried where none is given.
const ORDERS: std::ops::RangeInclusive<usize> = 1..=12;

fn in_time(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Outcome, PipelineError> {
    let clock = bundle.clock()?;
    let (records, fitted) = estimation_records(bundle, config, progress)?;
    let findings = examine_records(bundle, &records);
    let orders: Vec<usize> = match config.order {
        Some(order) => vec![order],
        None => ORDERS.collect(),
    };
    let cut: Vec<Record> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| crate::validation::cut(r, n))
        .collect();
    let (estimates, reason) = estimate_local(cut, clock, progress)?;
    let mut reasons = vec![reason];
    let (slope, integrators) = match config.integrators {
        Some(n) => (f64::NAN, n),
        None => crate::poles::integrators_from_slope(&estimates[0]),
    };
    progress("prediction error", 0, 1);
    let starts = local_starts(&estimates[0], clock, &orders);
    let closed = bundle.description().controller.is_some() || records.iter().all(|r| moves(&r.references));
    let (focus, why) = match config.focus {
        Some(focus) => (focus, "as asked".to_owned()),
        None if integrators > 0 => (
            FitFocus::Prediction,
            format!("{integrators} integrator(s) would let a simulation drift"),
        ),
        None if closed => (
            FitFocus::Prediction,
            "the bundle has a controller or moving references, and in closed loop the simulation error is biased by the noise that is fed back"
                .to_owned(),
        ),
        // A single order may put a pole outside for want of a better one; an unstable plant shows at every order.
        None if !starts.is_empty() && starts.iter().all(unstable) => (
            FitFocus::Prediction,
            "the local response has poles outside the unit circle at every order".to_owned(),
        ),
        None => (
            FitFocus::Simulation,
            format!("|F| falls with the power {slope:.2} of frequency at the lowest lines, no integrator"),
        ),
    };
    let error = match focus {
        FitFocus::Simulation => "the simulated output",
        FitFocus::Prediction => "the one-step prediction",
    };
    reasons.push(format!("the error of {error} is minimised: {why}"));
    let direct = config
        .direct
        .unwrap_or(if closed { Direct::Zero } else { Direct::Estimated });
    if closed && config.direct.is_none() {
        reasons.push("no direct term: the controller acts on the output of the same sample".to_owned());
    }
    let settings = InnovationSettings::new(orders)
        .focus(match focus {
            FitFocus::Simulation => Focus::Simulation,
            FitFocus::Prediction => Focus::Prediction,
        })
        .direct(match direct {
            Direct::Zero => DirectTerm::Zero,
            Direct::Estimated => DirectTerm::Estimated,
        });
    let segments: Vec<Segment<'_>> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| Segment::new(r, 0..n))
        .collect();
    let mut found = lti_ident::identify(&segments, clock, &settings.check()?, &starts)?;
    progress("prediction error", 1, 1);
    if !closed && config.order.is_none() {
        reasons.extend(refuse_unstable(
            &mut found,
            fitted.iter().copied().max().unwrap_or(0),
        ));
    }
    let chosen = found.chosen();
    let rows: Vec<OrderRow> = found.entries.iter().map(OrderRow::new).collect();
    reasons.push(order_reason(&rows, chosen.order, config));
    let held_out = held_out(chosen, &records, &fitted)?;
    let model = Model::InnovationStateSpace(chosen.model.clone());
    let mut summary = Summary::of_time(&model, TimeSummary::new(chosen, rows, held_out)?, reasons);
    summary.findings = findings;
    Ok(Outcome {
        model,
        summary,
        deviation: None,
        explanation: None,
        stages: Stages::Time(Box::new(found)),
    })
}

/// Whether every signal of a group changes; an empty group does not.
fn moves(signals: &lpv_core::Signals) -> bool {
    let changes = |c: &Vec<f64>| c.iter().any(|v| *v != c[0]);
    !signals.columns.is_empty() && signals.columns.iter().all(changes)
}

fn unstable(system: &StateSpace<Discrete>) -> bool {
    system.is_stable().is_ok_and(|stable| !stable)
}

/// Takes the best order whose model stays bounded over so many samples, where the chosen one does not: measured in open loop, the
/// machine did.
fn refuse_unstable(found: &mut InnovationFit, samples: usize) -> Option<String> {
    let explodes = |e: &OrderEntry| {
        crate::validation::stability(&e.model.model().poles().unwrap_or_default(), samples).is_unstable()
    };
    let refused = found.chosen().order;
    if !explodes(found.chosen()) {
        return None;
    }
    let (best, entry) = found
        .entries
        .iter()
        .enumerate()
        .filter(|(_, e)| e.expected_cost.is_finite() && !explodes(e))
        .min_by(|a, b| a.1.expected_cost.total_cmp(&b.1.expected_cost))?;
    let taken = entry.order;
    found.chosen = best;
    Some(format!(
        "{refused} states have the least cost to expect, but the model grows without bound where the record does not: {taken} are taken"
    ))
}

fn order_reason(rows: &[OrderRow], chosen: usize, config: &IdentifyConfig) -> String {
    if config.order.is_some() {
        return format!("{chosen} states as asked");
    }
    let tried: Vec<String> = rows
        .iter()
        .filter_map(|r| Some(format!("{}: {:.4}", r.order, r.expected_cost?)))
        .collect();
    format!(
        "{chosen} states by the cost to expect on other data ({})",
        tried.join(", ")
    )
}

/// Pole fits of the local response, one an order; those that fail are no starts.
fn local_starts(estimate: &FrfEstimate, clock: Discrete, orders: &[usize]) -> Vec<StateSpace<Discrete>> {
    orders
        .par_iter()
        .filter_map(|&order| {
            let settings = PoleFitSettings::new(order)
                .integrators(Integrators::Free)
                .numerator(NumeratorDegree::Proper)
                .smoothing_lines(4)
                .check()
                .ok()?;
            let found = fit(estimate, clock, &settings).ok()?;
            found.state_space().ok()
        })
        .collect()
}

/// The fit on what follows the fitted part of each record; the state is carried over, no output is used to simulate.
fn held_out(
    entry: &OrderEntry,
    records: &[Record],
    fitted: &[usize],
) -> Result<Option<HeldOut>, PipelineError> {
    let mut measured: Vec<Vec<f64>> = Vec::new();
    let (mut simulated, mut predicted): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for ((record, &n), x0) in records.iter().zip(fitted).zip(&entry.initial_states) {
        if n >= record.len() {
            continue;
        }
        let whole = Segment::whole(record);
        let (u, y) = (whole.inputs(), whole.outputs());
        let runs = [
            entry.model.simulate(x0, &u)?.outputs,
            entry.model.predict_one_step(x0, &u, &y)?.outputs,
        ];
        measured.resize(y.nrows(), Vec::new());
        for (errors, run) in [&mut simulated, &mut predicted].into_iter().zip(&runs) {
            errors.resize(y.nrows(), Vec::new());
            append_errors(errors, &y, run, n);
        }
        for (i, m) in measured.iter_mut().enumerate() {
            m.extend(y.row(i).iter().skip(n));
        }
    }
    if measured.is_empty() {
        return Ok(None);
    }
    let percent = |errors: &[Vec<f64>]| -> Vec<f64> {
        measured
            .iter()
            .zip(errors)
            .map(|(m, e)| fit_percent(m, e))
            .collect()
    };
    Ok(Some(HeldOut {
        samples: measured[0].len(),
        simulated_fit_percent: percent(&simulated),
        one_step_fit_percent: percent(&predicted),
    }))
}

fn append_errors(errors: &mut [Vec<f64>], measured: &DMatrix<f64>, run: &DMatrix<f64>, from: usize) {
    for (i, e) in errors.iter_mut().enumerate() {
        e.extend((from..measured.ncols()).map(|k| measured[(i, k)] - run[(i, k)]));
    }
}

fn axes(bundle: &Bundle, config: &IdentifyConfig, progress: Progress<'_>) -> Result<Outcome, PipelineError> {
    let clock = bundle.clock()?;
    let (records, fitted) = estimation_records(bundle, config, progress)?;
    let findings = examine_records(bundle, &records);
    let segments: Vec<Segment<'_>> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| Segment::new(r, 0..n))
        .collect();
    progress("inverse dynamics", 0, 1);
    let settings = lti_ident::rigid_body::RigidBodySettings::new().check()?;
    let found = lti_ident::rigid_body::identify(&segments, clock, &settings)?;
    progress("inverse dynamics", 1, 1);
    let units = &bundle.description().channels.output.units;
    let axes: Vec<AxisSummary> = found
        .model
        .axes()
        .iter()
        .zip(&found.axes)
        .enumerate()
        .map(|(i, (axis, account))| {
            AxisSummary::new(
                &records[0].inputs.names[i],
                &records[0].outputs.names[i],
                units.get(i).map_or("", String::as_str),
                axis,
                account,
            )
        })
        .collect();
    let reasons = axes
        .iter()
        .map(AxisSummary::reason)
        .chain(axes.iter().filter_map(AxisSummary::warning))
        .collect();
    let model = Model::RigidBody(found.model.clone());
    let mut summary = Summary::of_axes(&model, axes, reasons);
    summary.findings = findings;
    Ok(Outcome {
        summary,
        model,
        deviation: None,
        explanation: None,
        stages: Stages::Axes(Box::new(found)),
    })
}

/// The table from first principles, its masses estimated, from the responses.
fn table(bundle: &Bundle, progress: Progress<'_>) -> Result<Outcome, PipelineError> {
    let geometry = bundle.description().geometry.as_ref();
    let geometry = geometry.ok_or(PipelineError::Structure {
        problem: "structure = \"xy-table\" needs [geometry]: motor_from_output, and force_from_input to the second power of p",
    })?;
    let clock = bundle.clock()?;
    let mut reasons = Vec::new();
    let (mut fit, estimates) = diagnose::table(bundle, geometry, clock, &mut reasons, progress)?;
    // The geometry's own masses serve a diagnosis, where moves decide between the two.
    if let Some(free) = fit.free.take() {
        fit = *free;
    }
    let positions: Vec<f64> = estimates.iter().filter_map(FrfEstimate::position).collect();
    let explanation = Explanation::of_base(&fit.base, &fit.parameter_deviations(), bundle);
    reasons.extend(explanation.lines());
    let model = match &fit.base {
        Base::XyTable(table) => Model::ContinuousLpv(table.to_lpv(diagnose::range_of(&positions)?)?),
        _ => {
            return Err(PipelineError::Structure {
                problem: "the fit is no xy-table",
            });
        }
    };
    Ok(Outcome {
        summary: Summary::of_axes(&model, Vec::new(), reasons),
        model,
        deviation: None,
        explanation: Some(explanation),
        stages: Stages::Table(Box::new(fit)),
    })
}
