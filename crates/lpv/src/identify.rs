//! Bundle in, model out: which chain serves, and its account.

mod in_time;

use self::in_time::in_time;
use crate::deviation::FrozenDeviation;
use crate::diagnose::{self, Explanation};
use crate::finding::Severity;
use crate::inspect::inspect;
use crate::moves::Moves;
use crate::pipeline::{Identified, identify};
use crate::poles::integrators_from_slope;
use crate::progress::{Progress, silent};
use crate::responses::{estimate_bundle, examine_records, load_records, places};
use crate::speed::{axis_outputs, with_positions};
use crate::summary::{AxisSummary, Summary};
use crate::validation::{Known, Scope, Validation, validate_knowing};
use crate::verdict::Verdict;
use crate::{IdentifyConfig, LfrKind, ModelFile, PipelineError, Structure};
use experiment_data::{Bundle, Quantity};
use lpv_core::{FrfEstimate, Model, Purpose, Record, RigidBody, RigidBodyAxis};
use lpv_diagnose::Base;
use lti_ident::{InnovationFit, Segment};

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
    Table(Box<lpv_diagnose::FrozenFit>),
    /// A diagnosis.
    Diagnosis,
    /// Servo axes.
    Axes(Box<lti_ident::rigid_body::RigidBodyFit>),
}

/// Identifies a model from the estimation records of a bundle.
///
/// With a scheduling channel and several positions the model is LPV; else it is time-invariant: from periodic records by
/// the pole fit, from others by a prediction-error fit that starts at the local rational response. That is tried, too, where
/// records without periods give no good LPV model of a stable machine, and taken where it follows them better. What the
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
        .any(|e| e.purpose == Purpose::Estimation && (e.is_periodic() || e.is_response()));
    let all: Vec<usize> = (0..bundle.len()).collect();
    places::one_signal(bundle, &all)?;
    let scheduled = places::is_scheduled(bundle);
    let judge = |outcome: Outcome| judged(outcome, bundle, config, None, progress);
    let outcome = match config.structure {
        Some(Structure::RigidBody) => axes(bundle, config, progress).and_then(judge),
        Some(Structure::XyTable) => table(bundle, progress).and_then(judge),
        Some(Structure::Lti) if !periodic => in_time(bundle, config, progress).and_then(judge),
        None if !periodic && !scheduled => in_time(bundle, config, progress).and_then(judge),
        None if !periodic => without_periods(bundle, config, progress),
        structure => in_frequency(bundle, structure, config, progress),
    };
    outcome
        .map(|judged| judged.outcome)
        .map_err(|refused| with_cause(refused, bundle))
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

/// An outcome with its verdict, and how far its model is off along records.
struct Judged {
    outcome: Outcome,
    /// Error in open loop over the motion, root mean square over the judged records and their outputs; infinite where the model does not
    /// follow one, or there is none.
    open_loop: f64,
}

/// The outcome with its verdict: the model against what the bundle holds out, else against what it was made from.
fn judged(
    mut outcome: Outcome,
    bundle: &Bundle,
    config: &IdentifyConfig,
    responses: Option<(&[FrfEstimate], Option<&[f64]>)>,
    progress: Progress<'_>,
) -> Result<Judged, PipelineError> {
    let file = ModelFile {
        model: outcome.model.clone(),
        identification: None,
        explanation: outcome.explanation.clone(),
    };
    let known = Known {
        hold_out: config.hold_out,
        responses,
    };
    let (verdict, open_loop) = match validate_knowing(&file, bundle, Scope::HeldOut, known, progress) {
        Ok((found, _)) => {
            let open_loop = open_loop_error(&found);
            (found.verdict, open_loop)
        }
        // A model that cannot be run along a record is written all the same, and the first line says so.
        Err(error) => (Verdict::unjudged(&error), f64::INFINITY),
    };
    let between = outcome.summary.between();
    let undetermined = outcome
        .summary
        .frequency
        .as_ref()
        .and_then(|f| f.undetermined.as_ref());
    let verdict = verdict.with_expected(between).with_open(undetermined);
    outcome.summary.verdict = Some(verdict.in_view_of(&outcome.summary.findings));
    Ok(Judged { outcome, open_loop })
}

fn open_loop_error(found: &Validation) -> f64 {
    let outputs = found.records.iter().flat_map(|r| &r.outputs);
    let squares: Vec<f64> = outputs
        .map(|o| (1.0 - o.open_loop.fit_percent / 100.0).powi(2))
        .collect();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    if mean.is_finite() {
        mean.sqrt()
    } else {
        f64::INFINITY
    }
}

fn in_frequency(
    bundle: &Bundle,
    structure: Option<Structure>,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Judged, PipelineError> {
    let mut responses = estimate_bundle(bundle, config.skip_periods, progress)?;
    let positions = responses.estimates.len();
    if structure == Some(Structure::Lpv) && !places::is_scheduled(bundle) {
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
    let outputs = &bundle.description().channels.output;
    let speed = (0..outputs.len()).find(|k| outputs.quantity_of(*k) == Quantity::Speed);
    if let (Some(k), true, None, Some(middle)) = (
        speed,
        positions > 1,
        config.integrators,
        responses.estimates.get(positions / 2),
    ) && integrators_from_slope(middle).1 == 1
    {
        let output = outputs.columns[k].clone();
        return Err(PipelineError::FreeSpeed { output });
    }
    let moves = match config.lfr {
        LfrKind::Small if positions > 1 => Moves::of(bundle, config, &responses, progress)?,
        _ => Moves::none("the exact LFR does not use them"),
    };
    let identified = identify(&responses.estimates, responses.clock, &moves, config, progress)?;
    responses.estimates = identified.compared(responses.estimates);
    let mut summary = Summary::of_responses(&identified, &responses.estimates, responses.clock)?;
    if responses.estimates.iter().any(FrfEstimate::covariance_is_assumed) {
        // What the stages call noise is here what was assumed.
        let named = |reason: &String| reason.replace("the noise", "the assumed error");
        summary.reasons = summary.reasons.iter().map(named).collect();
    }
    summary.reasons.splice(0..0, responses.reasons);
    summary.findings = responses.findings;
    let outcome = Outcome {
        explanation: None,
        deviation: match responses.estimates.iter().any(FrfEstimate::covariance_is_assumed) {
            true => None,
            false => FrozenDeviation::of(&identified, &responses.estimates, responses.clock)?,
        },
        model: identified.model()?,
        summary,
        stages: Stages::Frequency(Box::new(identified)),
    };
    let known = (responses.estimates.as_slice(), responses.noise.as_deref());
    judged(outcome, bundle, config, Some(known), progress)
}

/// Records without periods at several positions: responses by position, or one prediction-error fit to all records where those give no
/// good model of a machine without integrators, and it follows the records better.
fn without_periods(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Judged, PipelineError> {
    let by_position = in_frequency(bundle, None, config, progress)?;
    let Outcome { summary, stages, .. } = &by_position.outcome;
    let is_good = summary.verdict.as_ref().is_some_and(|v| v.worth.is_good());
    // Integrators drift in open loop, and the errors of two models along records then tell little.
    let drifts = matches!(stages, Stages::Frequency(found) if found.poles().integrators > 0);
    if is_good || drifts {
        return Ok(by_position);
    }
    let one = in_time(bundle, config, progress).and_then(|o| judged(o, bundle, config, None, progress));
    let Ok(mut one) = one else {
        return Ok(by_position);
    };
    if by_position.open_loop <= one.open_loop {
        return Ok(by_position);
    }
    let errs = match by_position.open_loop.is_finite() {
        true => format!(
            "errs by {:.1} % of the motion in open loop",
            100.0 * by_position.open_loop
        ),
        false => "does not follow the records in open loop".to_owned(),
    };
    one.outcome.summary.reasons.insert(
        0,
        format!(
            "warning: the model from responses by position {errs}; one prediction-error fit to the records of all positions errs by {:.1} % and is taken, without a dependence on position; periodic records at each position would show one",
            100.0 * one.open_loop
        ),
    );
    Ok(one)
}

/// The estimation records, and the last sample of each that may be fitted.
fn estimation_records(
    bundle: &Bundle,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<(Vec<Record>, Vec<usize>), PipelineError> {
    let entries = &bundle.description().records;
    let records = load_records(bundle, |i| entries[i].purpose == Purpose::Estimation, progress)?;
    let fitted = |e: &experiment_data::RecordEntry| e.is_response() && e.purpose == Purpose::Estimation;
    if records.is_empty() && entries.iter().any(fitted) {
        return Err(PipelineError::Structure {
            problem: "this structure is fitted to records of samples, and the bundle has measured frequency responses alone; leave `structure` out",
        });
    }
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

fn axes(bundle: &Bundle, config: &IdentifyConfig, progress: Progress<'_>) -> Result<Outcome, PipelineError> {
    let clock = bundle.clock()?;
    let channels = &bundle.description().channels;
    let outputs = axis_outputs(&channels.output)?;
    let (records, fitted) = estimation_records(bundle, config, progress)?;
    let findings = examine_records(bundle, &records);
    let records: Vec<Record> = records
        .into_iter()
        .map(|r| with_positions(r, &outputs, clock))
        .collect();
    let segments: Vec<Segment<'_>> = records
        .iter()
        .zip(&fitted)
        .map(|(r, &n)| Segment::new(r, 0..n))
        .collect();
    progress("inverse dynamics", 0, 1);
    let settings = lti_ident::rigid_body::RigidBodySettings::default();
    let mut found = lti_ident::rigid_body::identify(&segments, clock, &settings)?;
    let axes = found.model.axes().iter().zip(outputs);
    found.model = RigidBody::new(
        axes.map(|(axis, output)| RigidBodyAxis { output, ..*axis })
            .collect(),
    )?;
    progress("inverse dynamics", 1, 1);
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
                [&channels.input.units, &channels.output.units].map(|u| u.get(i).map_or("", String::as_str)),
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
    let positions: Vec<f64> = estimates
        .iter()
        .filter_map(FrfEstimate::single_position)
        .collect();
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
