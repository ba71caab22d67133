//! The frozen model against frequency responses.

use super::bands::bands;
use super::check::FrozenCheck;
use super::frozen_error;
use super::stable::WITHOUT_RECORDS;
use crate::progress::Progress;
use crate::responses::measured::{join, measured_responses};
use crate::responses::{periodic_responses, sample_noise};
use crate::verdict::{Stability, Verdict};
use crate::{PipelineError, Summary};
use experiment_data::Bundle;
use lpv_core::{Discrete, Frf, FrfEstimate, Model, Purpose};
use lpv_diagnose::{Explained, response};
use lpv_numerics::statistics::{amplitude_db, median};
use lpv_simulate::{Frozen, Machine};

/// The comparison and what it was made from.
#[derive(Default)]
pub(super) struct Against {
    pub(super) check: Option<FrozenCheck>,
    /// Deviation of the noise of one sample, by output.
    pub(super) noise: Option<Vec<f64>>,
    pub(super) estimates: Vec<FrfEstimate>,
    pub(super) responses: Vec<Frf>,
}

/// The frozen error, and the noise of one sample by output; with effects that were traced on responses, that of the model with
/// them.
pub(super) fn frozen_check(
    machine: &Machine,
    traced: Option<&Explained>,
    bundle: &Bundle,
    known: Option<(&[FrfEstimate], Option<&[f64]>)>,
    notes: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<Against, PipelineError> {
    let entries = &bundle.description().records;
    let periodic = |i: usize| entries[i].is_periodic() || entries[i].is_response();
    let held = |i: usize| periodic(i) && entries[i].purpose == Purpose::Validation;
    let any_held = (0..entries.len()).any(held);
    let known = known.filter(|_| !any_held);
    if known.is_none() && !(0..entries.len()).any(periodic) {
        notes.push(
            "no periodic records: no frequency response to compare with, and the noise level is not known"
                .to_owned(),
        );
        return Ok(Against::default());
    }
    let wanted = if any_held {
        Purpose::Validation
    } else {
        Purpose::Estimation
    };
    let used = |i: usize| periodic(i) && entries[i].purpose == wanted;
    let (found, noise) = match known {
        Some((estimates, noise)) => (estimates.to_vec(), noise.map(<[f64]>::to_vec)),
        None => {
            let found = periodic_responses(bundle, |i| used(i) && entries[i].is_periodic(), None, progress)?;
            let measured = measured_responses(bundle, used, progress)?;
            notes.extend(measured.iter().flat_map(|m| m.reasons.clone()));
            let noise = (!found.is_empty()).then(|| sample_noise(&found));
            let estimates = found.into_iter().map(|f| f.estimate.estimate).collect();
            (join(estimates, &measured)?, noise)
        }
    };
    // A model of other parameters has no response there, inside its range or not.
    for p in found.iter().filter_map(FrfEstimate::position) {
        if let Some(range) = machine.range().filter(|r| r.parameters() != p.len()) {
            range.check(p)?;
        }
    }
    let inside = |e: &FrfEstimate| match (machine.range(), e.position()) {
        (Some(range), Some(p)) => range.check(p).is_ok(),
        (Some(_), None) => false,
        (None, _) => true,
    };
    let all = found.len();
    let estimates: Vec<FrfEstimate> = found.into_iter().filter(inside).collect();
    if estimates.len() < all {
        notes.push(format!(
            "{} of {all} positions lie outside the range of the model and were left out",
            all - estimates.len()
        ));
    }
    if estimates.is_empty() {
        return Ok(Against {
            noise,
            ..Against::default()
        });
    }
    let source = if any_held { "validation" } else { "estimation" };
    let (check, estimates, responses) = compared(machine, traced, estimates, source)?;
    Ok(Against {
        check: Some(check),
        noise,
        estimates,
        responses,
    })
}

/// A model against responses within its range; with the responses as they are compared, and those of the model.
fn compared(
    machine: &Machine,
    traced: Option<&Explained>,
    estimates: Vec<FrfEstimate>,
    source: &'static str,
) -> Result<(FrozenCheck, Vec<FrfEstimate>, Vec<Frf>), PipelineError> {
    let estimates = estimates
        .into_iter()
        .map(|e| match (traced, e.is_of_held_input()) {
            (None, true) => {
                let p: Vec<f64> = e.position().map_or(Vec::new(), |p| p.to_vec());
                Ok(e.beside_direct(machine.at(&p)?.d()))
            }
            _ => Ok(e),
        })
        .collect::<Result<Vec<FrfEstimate>, PipelineError>>()?;
    let model = estimates
        .iter()
        .map(|e| {
            if let Some(explained) = traced {
                return with_effects(explained, e.frf());
            }
            let p: Vec<f64> = e.position().map_or(Vec::new(), |p| p.to_vec());
            Ok(machine.at(&p)?.frequency_response(e.frf().frequencies_hz())?)
        })
        .collect::<Result<Vec<Frf>, PipelineError>>()?;
    let truth: Vec<Frf> = estimates.iter().map(|e| e.frf().clone()).collect();
    let mut deviations = Vec::new();
    let mut ratios = Vec::new();
    for (g, e) in model.iter().zip(&estimates) {
        for (k, error) in g.relative_error(e.frf())?.into_iter().enumerate() {
            deviations.push(e.relative_deviation(k));
            ratios.push(error / e.relative_deviation(k));
        }
    }
    let known = !estimates.iter().any(FrfEstimate::covariance_is_assumed);
    let check = FrozenCheck {
        source,
        positions: estimates
            .iter()
            .filter_map(FrfEstimate::single_position)
            .collect(),
        error: frozen_error(&model, &truth)?,
        noise_db: known.then(|| amplitude_db(median(&deviations))),
        error_over_noise: known.then(|| median(&ratios)),
        relative_rms_percent: crate::summary::relative_rms_percent(&model, &truth),
        bands: bands(&model, &estimates),
    };
    Ok((check, estimates, model))
}

/// What a model is worth that was made from these responses, and that no record has judged; the summary tells what is to be expected between
/// their places.
///
/// # Errors
/// A response without a place, of a model that depends on it.
pub fn judge_on_responses(
    model: &Model,
    estimates: &[FrfEstimate],
    summary: &Summary,
    clock: Discrete,
) -> Result<Verdict, PipelineError> {
    let machine = Machine::new(model, clock)?;
    let (check, ..) = compared(&machine, None, estimates.to_vec(), "estimation")?;
    let centre = machine.range().map_or_else(Vec::new, |r| r.centre());
    let stability = super::stability(&machine.at(&centre)?.poles()?, WITHOUT_RECORDS);
    let verdict = Verdict::of(Some(&check), &[], stability, false, &[]);
    let undetermined = summary.frequency.as_ref().and_then(|f| f.undetermined.as_ref());
    let verdict = verdict.with_expected(summary.between()).with_open(undetermined);
    // Whatever loop it was measured in, none holds what grows by half in a sample.
    let verdict = match stability {
        Stability::Unstable { radius } if !stability.may_stay_bounded(true) => verdict.unstable(radius),
        _ => verdict,
    };
    Ok(verdict.in_view_of(&summary.findings))
}

/// The response of motor and load at the lines of a measured one.
fn with_effects(explained: &Explained, like: &Frf) -> Result<Frf, PipelineError> {
    let outputs = like.outputs();
    let lines = like.frequencies_hz();
    let values = lines
        .iter()
        .flat_map(|f| {
            let both = response(explained, *f);
            (0..outputs).map(move |i| both[i.min(1)])
        })
        .collect();
    Ok(Frf::new(lines.to_vec(), outputs, 1, values)?)
}
