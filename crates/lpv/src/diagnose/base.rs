//! The model that effects are added to.

use super::BaseKind;
use crate::config::IdentifyConfig;
use crate::poles::fit_poles;
use crate::progress::Progress;
use crate::responses::estimate_bundle;
use crate::{ModelFile, PipelineError, Structure, identify_bundle};
use experiment_data::Bundle;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, FrfEstimate, Model, Record, SchedulingRange};
use lpv_diagnose::{Axis, Base, BaseParameter, FrozenFit, Lpv, Prior, TraceError, fit_table};
use lpv_numerics::statistics::range;
use std::f64::consts::TAU;

/// A base model, and what is known of it.
pub(super) struct Start {
    pub(super) base: Base,
    pub(super) prior: Option<Prior>,
    /// The same with parameters free that `base` holds.
    pub(super) free: Option<(Base, Prior)>,
    /// Responses that tell the base, where it is from first principles.
    pub(super) responses: Vec<FrfEstimate>,
    /// The identified model behind the base; none from first principles.
    pub(super) model: Option<Model>,
}

/// How well gains and modes of an identified model are thought to be known, relative: effects were there when it was made.
const KNOWN: f64 = 0.01;

/// Factor of the stated deviations of a first-principles model: effects were there when it was made.
const DOUBT: f64 = 3.0;

/// The base model of a bundle: `model`, or what the bundle allows.
pub(super) fn start(
    bundle: &Bundle,
    model: Option<&ModelFile>,
    (fitted, judged): (&[Record], &[Record]),
    clock: Discrete,
    reasons: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<Start, PipelineError> {
    let records: Vec<&Record> = fitted.iter().chain(judged).collect();
    let description = bundle.description();
    if let Some(file) = model {
        return told(file, bundle, &records, reasons);
    }
    if let Some(geometry) = &description.geometry {
        let (fit, estimates) = table(bundle, geometry, clock, reasons, progress)?;
        return Ok(Start {
            base: fit.base,
            prior: Some(fit.prior),
            free: fit.free.map(|free| (free.base, free.prior)),
            model: None,
            responses: estimates,
        });
    }
    let channels = &description.channels;
    if channels.scheduling.is_empty() && channels.input.len() == 1 && channels.output.len() == 1 {
        return Ok(plain(lpv_diagnose::servo_axis(fitted, clock, reasons)?));
    }
    let config = IdentifyConfig {
        structure: (!channels.scheduling.is_empty()).then_some(Structure::Lpv),
        ..IdentifyConfig::default()
    };
    let found = identify_bundle(bundle, &config, progress)?;
    reasons.extend(found.summary.reasons);
    given(&found.model, bundle, &records).map_err(|error| match error {
        PipelineError::Trace(source @ (TraceError::Core(_) | TraceError::NoBase { .. })) => {
            PipelineError::NoBase { source }
        }
        other => other,
    })
}

/// What a file holds: of a model with effects the base alone.
fn told(
    file: &ModelFile,
    bundle: &Bundle,
    records: &[&Record],
    reasons: &mut Vec<String>,
) -> Result<Start, PipelineError> {
    let Some(explanation) = &file.explanation else {
        return given(&file.model, bundle, records);
    };
    if !explanation.effects.is_empty() {
        let names: Vec<&str> = explanation.effects.iter().map(|e| e.effect.as_str()).collect();
        reasons.push(format!(
            "the effects of the given model ({}) are looked for anew",
            names.join(", ")
        ));
    }
    let base = explanation.machine(&file.model, bundle)?.base;
    match explanation.base {
        BaseKind::XyTable => {}
        BaseKind::Identified => {
            let start = given(&file.model, bundle, records)?;
            return Ok(Start { base, ..start });
        }
        // An axis is its parameters: the model of the file is what they make of it.
        BaseKind::ServoAxis
        | BaseKind::SpringAxis
        | BaseKind::MotorAndLoad
        | BaseKind::MotorAndMeasuredLoad => return of_one_axis(base, bundle),
    }
    // Deviations are told of the parameters that were fitted; of the others nothing better is known.
    let deviation = |p: BaseParameter| {
        let told = explanation.base_parameters.get(p.name).and_then(|v| v.std);
        told.map_or(KNOWN, |std| std / p.value.abs()).max(1e-6)
    };
    let weights: Vec<f64> = base.fitted().map(|p| 1.0 / (DOUBT * deviation(p))).collect();
    Ok(Start {
        prior: Some(Prior {
            mean: DVector::from_vec(base.coordinates()),
            weight: DMatrix::from_diagonal(&DVector::from_vec(weights)),
            firm: false,
        }),
        free: None,
        base,
        model: None,
        responses: Vec::new(),
    })
}

/// One servo axis.
pub(super) fn axis_of(model: &Model) -> Result<Base, PipelineError> {
    match model {
        Model::RigidBody(body) if body.axes().iter().any(|a| !a.output.is_position()) => {
            Err(PipelineError::Structure {
                problem: "the output of this model is a speed, and effects are traced along positions; make a model of the position",
            })
        }
        Model::RigidBody(body) if body.axes().len() == 1 => {
            let axis = body.axes()[0];
            Ok(Base::Axis(Axis::new(axis.inertia, axis.viscous, axis.offset)))
        }
        _ => Err(PipelineError::Structure {
            problem: "effects are added to one servo axis, and the model is another or has several; make a bundle of one of them",
        }),
    }
}

/// One axis, of which nothing else is known, for a bundle of one.
fn of_one_axis(base: Base, bundle: &Bundle) -> Result<Start, PipelineError> {
    let channels = &bundle.description().channels;
    let bundle_has = (channels.input.len(), channels.output.len());
    if bundle_has != (1, 1) {
        return Err(PipelineError::Channels {
            model: (1, 1),
            bundle: bundle_has,
        });
    }
    Ok(plain(base))
}

/// A base of which nothing else is known.
fn plain(base: Base) -> Start {
    Start {
        base,
        prior: None,
        free: None,
        model: None,
        responses: Vec::new(),
    }
}

/// A model of a file.
fn given(model: &Model, bundle: &Bundle, records: &[&Record]) -> Result<Start, PipelineError> {
    if let Model::RigidBody(_) = model {
        return of_one_axis(axis_of(model)?, bundle);
    }
    let lpv = lpv(model, bundle)?;
    let [low, high] = lpv.range();
    for record in records {
        let Some(p) = record.scheduling.columns.first() else {
            continue;
        };
        let (least, most) = range(p);
        let margin = 0.01 * (high - low);
        if !lpv.is_constant() && (least < low - margin || most > high + margin) {
            return Err(lpv_diagnose::TraceError::Record {
                record: record.name.clone(),
                problem: format!(
                    "its scheduling goes from {least} to {most}, and the model holds from {low} to {high}; measure responses at positions as far, or leave the record out"
                ),
            }
            .into());
        }
    }
    let base = Base::Lpv(lpv);
    let mean = DVector::from_vec(base.coordinates());
    let weight = DMatrix::identity(mean.len(), mean.len()) / KNOWN;
    Ok(Start {
        prior: Some(Prior {
            mean,
            weight,
            firm: false,
        }),
        free: None,
        base,
        model: Some(model.clone()),
        responses: Vec::new(),
    })
}

/// A dynamic model as a base.
pub(super) fn lpv(model: &Model, bundle: &Bundle) -> Result<Lpv, PipelineError> {
    let description = bundle.description();
    let channels = &description.channels;
    if let Model::RigidBody(_) = model {
        return Err(PipelineError::Structure {
            problem: "effects cannot be added to this kind of model",
        });
    }
    let bounds = match model.range().map(SchedulingRange::bounds) {
        None => None,
        Some([one]) => Some(*one),
        Some(_) => {
            return Err(PipelineError::Structure {
                problem: "effects are added to models with one scheduling parameter",
            });
        }
    };
    let in_states = model.in_states()?;
    let frozen = |p: f64| in_states.frozen(&[p])?.continuous();
    let mut found = Lpv::new(model.describe(), bounds, description.geometry.as_ref(), frozen)?;
    if let Some((inputs, outputs)) = model.offsets() {
        let pair = |v: &DVector<f64>| [0, 1].map(|i: usize| v.get(i).copied().unwrap_or(0.0));
        found = found.about(pair(&inputs), pair(&outputs));
    }
    if !found.is_constant() && channels.scheduling.is_empty() {
        return Err(PipelineError::Structure {
            problem: "the model depends on a scheduling signal and the bundle has none: name its column in [channels.scheduling]",
        });
    }
    let shape = |n: usize| (n, n);
    let bundle_has = (channels.input.len(), channels.output.len());
    if shape(found.channels()) != bundle_has {
        return Err(PipelineError::Channels {
            model: shape(found.channels()),
            bundle: bundle_has,
        });
    }
    Ok(found)
}

/// The xy-table, and its responses.
pub(crate) fn table(
    bundle: &Bundle,
    geometry: &lpv_core::Geometry,
    clock: Discrete,
    reasons: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<(FrozenFit, Vec<FrfEstimate>), PipelineError> {
    /// Poles with more damping belong to no mode.
    const MOST_DAMPING: f64 = 0.5;
    let config = IdentifyConfig::default();
    let responses = estimate_bundle(bundle, config.skip_periods, progress)?;
    let poles = fit_poles(&responses.estimates, clock, &config)?;
    let middle = &poles.fits[poles.fits.len() / 2];
    let modes: Vec<f64> = middle
        .flexible_poles()
        .iter()
        .filter(|z| z.im > 0.0)
        .map(|z| z.ln())
        .filter(|s| s.re.abs() <= MOST_DAMPING * s.norm())
        .map(|s| s.norm() / clock.sample_time() / TAU)
        .collect();
    progress("first-principles model", 0, 1);
    let fit = fit_table(geometry, &responses.estimates, clock, &modes)?;
    progress("first-principles model", 1, 1);
    reasons.push(format!(
        "first-principles model from the responses at {} positions, residual {:.2} times what its weights say; modes of the translation and the rotation near {}",
        responses.estimates.len(),
        fit.misfit.sqrt(),
        modes.iter().map(|f| format!("{f:.4}")).collect::<Vec<_>>().join(", ")
    ));
    Ok((fit, responses.estimates))
}
