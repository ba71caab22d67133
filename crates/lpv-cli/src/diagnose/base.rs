//! The model that effects are added to.

use crate::config::IdentifyConfig;
use crate::poles::fit_poles;
use crate::progress::Progress;
use crate::responses::estimate_bundle;
use crate::signal::range;
use crate::{ModelFile, PipelineError, Structure, identify_bundle};
use experiment_data::Bundle;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{CoreError, Discrete, Model, Purpose, Record, SchedulingRange, StateSpace};
use lti_ident::Segment;
use residual_trace::{Axis, Base, FrozenFit, Lpv, Prior, fit_table};
use std::f64::consts::TAU;

/// A base model, and what is known of it.
pub(super) struct Start {
    pub(super) base: Base,
    pub(super) prior: Option<Prior>,
    /// The same with parameters free that `base` holds.
    pub(super) free: Option<(Base, Prior)>,
    /// Parts of a sample.
    pub(super) substeps: usize,
}

/// Parts of a sample for an xy-table, and for an axis.
const PARTS: [usize; 2] = [6, 2];

/// How well gains and modes of an identified model are thought to be known, relative: effects were there when it was made.
const KNOWN: f64 = 0.01;

/// The base model of a bundle: `model`, or what the bundle allows.
pub(super) fn start(
    bundle: &Bundle,
    model: Option<&ModelFile>,
    records: &[Record],
    clock: Discrete,
    reasons: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<Start, PipelineError> {
    let description = bundle.description();
    let plain = |base, substeps| Start {
        base,
        prior: None,
        free: None,
        substeps,
    };
    if let Some(file) = model {
        return given(&file.model, bundle, records, clock);
    }
    if let Some(geometry) = &description.geometry {
        let fit = table(bundle, geometry, clock, reasons, progress)?;
        return Ok(Start {
            base: fit.base,
            prior: Some(fit.prior),
            free: fit.free,
            substeps: PARTS[0],
        });
    }
    let channels = &description.channels;
    if channels.scheduling.is_empty() && channels.input.len() == 1 && channels.output.len() == 1 {
        return Ok(plain(servo_axis(records, clock)?, PARTS[1]));
    }
    let config = IdentifyConfig {
        structure: (!channels.scheduling.is_empty()).then_some(Structure::Lpv),
        ..IdentifyConfig::default()
    };
    let found = identify_bundle(bundle, &config, progress)?;
    reasons.extend(found.summary.reasons);
    given(&found.model, bundle, records, clock)
}

/// A model of a file.
fn given(
    model: &Model,
    bundle: &Bundle,
    records: &[Record],
    clock: Discrete,
) -> Result<Start, PipelineError> {
    if let Model::RigidBody(body) = model {
        let [axis] = body.axes() else {
            return Err(PipelineError::Structure {
                problem: "effects are added to one servo axis, and the model has several; make a bundle of one of them",
            });
        };
        return Ok(Start {
            base: Base::Axis(Axis::new(axis.inertia, axis.viscous, axis.offset)),
            prior: None,
            free: None,
            substeps: PARTS[1],
        });
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
            return Err(residual_trace::TraceError::Record {
                record: record.name.clone(),
                problem: format!(
                    "its scheduling goes from {least} to {most}, and the model holds from {low} to {high}; measure responses at positions as far, or leave the record out"
                ),
            }
            .into());
        }
    }
    let substeps = lpv.parts(clock.sample_time());
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
        substeps,
    })
}

/// A dynamic model as a base.
fn lpv(model: &Model, bundle: &Bundle) -> Result<Lpv, PipelineError> {
    let description = bundle.description();
    let channels = &description.channels;
    let sampled = |s: StateSpace<Discrete>| s.undo_zero_order_hold();
    let make = |range: Option<&SchedulingRange>, frozen: &dyn Fn(f64) -> Result<StateSpace<_>, CoreError>| {
        let bounds = match range.map(SchedulingRange::bounds) {
            None => None,
            Some([one]) => Some(*one),
            Some(_) => {
                return Err(PipelineError::Structure {
                    problem: "effects are added to models with one scheduling parameter",
                });
            }
        };
        let lpv = Lpv::new(
            crate::convert::describe(model),
            bounds,
            description.geometry.as_ref(),
            frozen,
        )?;
        Ok(lpv)
    };
    let found = match model {
        Model::ContinuousLfr(m) => make(Some(m.range()), &|p| m.frozen(&[p])),
        Model::ContinuousLpv(m) => make(Some(m.range()), &|p| m.frozen(&[p])),
        Model::ContinuousStateSpace(m) => make(None, &|_| Ok(m.clone())),
        Model::DiscreteLfr(m) => make(Some(m.range()), &|p| sampled(m.frozen(&[p])?)),
        Model::DiscreteLpv(m) => make(Some(m.range()), &|p| sampled(m.frozen(&[p])?)),
        Model::DiscreteStateSpace(m) => make(None, &|_| sampled(m.clone())),
        Model::InnovationStateSpace(m) => make(None, &|_| sampled(m.model().clone())),
        Model::SeriesExpansion(m) => {
            let m = m.to_state_space()?;
            make(Some(m.range()), &|p| sampled(m.frozen(&[p])?))
        }
        _ => Err(PipelineError::Structure {
            problem: "effects cannot be added to this kind of model",
        }),
    }?;
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

/// The xy-table.
fn table(
    bundle: &Bundle,
    geometry: &experiment_data::Geometry,
    clock: Discrete,
    reasons: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<FrozenFit, PipelineError> {
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
    Ok(fit)
}

fn servo_axis(records: &[Record], clock: Discrete) -> Result<Base, PipelineError> {
    let segments: Vec<Segment<'_>> = records
        .iter()
        .filter(|r| r.purpose == Purpose::Estimation)
        .map(Segment::whole)
        .collect();
    let settings = lti_ident::rigid_body::RigidBodySettings::new().check()?;
    let found = lti_ident::rigid_body::identify(&segments, clock, &settings)?;
    let axis = found.model.axes()[0];
    Ok(Base::Axis(Axis::new(axis.inertia, axis.viscous, axis.offset)))
}
