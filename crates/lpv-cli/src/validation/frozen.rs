//! The frozen model against frequency responses.

use super::check::FrozenCheck;
use super::machine::Machine;
use super::simulate::Frozen;
use super::{decibel, frozen_error};
use crate::PipelineError;
use crate::progress::Progress;
use crate::responses::{estimate_periodic, sample_noise};
use crate::signal::median;
use lpv_core::{Frf, FrfEstimate, Purpose, Record};

/// The comparison and what it was made from.
#[derive(Default)]
pub(super) struct Against {
    pub(super) check: Option<FrozenCheck>,
    /// Deviation of the noise of one sample, by output.
    pub(super) noise: Option<Vec<f64>>,
    pub(super) estimates: Vec<FrfEstimate>,
    pub(super) responses: Vec<Frf>,
}

/// The frozen error, and the noise of one sample by output.
pub(super) fn frozen_check(
    machine: &Machine,
    periodic: Vec<Record>,
    clock: lpv_core::Discrete,
    notes: &mut Vec<String>,
    progress: Progress<'_>,
) -> Result<Against, PipelineError> {
    if periodic.is_empty() {
        notes.push(
            "no periodic records: no frequency response to compare with, and the noise level is not known"
                .to_owned(),
        );
        return Ok(Against::default());
    }
    let any_held = periodic.iter().any(|r| r.purpose == Purpose::Validation);
    let wanted = if any_held {
        Purpose::Validation
    } else {
        Purpose::Estimation
    };
    let mut used: Vec<Record> = periodic.into_iter().filter(|r| r.purpose == wanted).collect();
    let estimates = estimate_periodic(&mut used, clock, None, progress)?;
    let noise = sample_noise(&used, &estimates);
    let inside = |e: &FrfEstimate| match (machine.range(), e.position()) {
        (Some(range), Some(p)) => range.check(&[p]).is_ok(),
        (Some(_), None) => false,
        (None, _) => true,
    };
    let all = estimates.len();
    let estimates: Vec<FrfEstimate> = estimates.into_iter().map(|e| e.estimate).filter(inside).collect();
    if estimates.len() < all {
        notes.push(format!(
            "{} of {all} positions lie outside the range of the model and were left out",
            all - estimates.len()
        ));
    }
    if estimates.is_empty() {
        return Ok(Against {
            noise: Some(noise),
            ..Against::default()
        });
    }
    let model = estimates
        .iter()
        .map(|e| {
            let p: Vec<f64> = e.position().into_iter().collect();
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
    let check = FrozenCheck {
        source: if any_held { "validation" } else { "estimation" },
        positions: estimates.iter().filter_map(FrfEstimate::position).collect(),
        error: frozen_error(&model, &truth)?,
        noise_db: decibel(median(&deviations)),
        error_over_noise: median(&ratios),
        relative_rms_percent: crate::summary::relative_rms_percent(&model, &truth),
    };
    Ok(Against {
        check: Some(check),
        noise: Some(noise),
        estimates,
        responses: model,
    })
}
