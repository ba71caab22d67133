//! Whether the small LFR or the series expansion is the model.

use crate::PipelineError;
use crate::small::SmallStage;
use crate::validation::frozen_error;
use lpv_core::{Discrete, Frf, FrfEstimate};
use lpv_ident::LpvObfModel;
use lpv_numerics::statistics::amplitude_db;

/// A small LFR that misses the noise by no more than the series expansion does is taken all the same; not one that misses the
/// response.
pub(super) fn worth(
    small: SmallStage,
    series: &LpvObfModel,
    estimates: &[FrfEstimate],
    clock: Discrete,
    reasons: &mut Vec<String>,
) -> Result<Option<SmallStage>, PipelineError> {
    /// Decibels that fewer states and deltas are worth.
    const SLACK_DB: f64 = 1.0;
    /// Above half of the response, few states are no reason: the better model counts.
    const MISSED_DB: f64 = -6.0;
    if small.at_noise {
        return Ok(Some(small));
    }
    let (mut near, mut far) = (Vec::new(), Vec::new());
    for estimate in estimates {
        let (position, lines) = (
            estimate.single_position().unwrap_or(0.0),
            estimate.frf().frequencies_hz(),
        );
        near.push(small.response(position, lines, clock)?);
        far.push(series.response(&[position], lines)?);
    }
    let measured: Vec<Frf> = estimates.iter().map(|e| e.frf().clone()).collect();
    let of = |model: &[Frf]| -> Result<(f64, f64), PipelineError> {
        Ok((
            frozen_error(model, &measured)?.median_db,
            rms_db(model, &measured)?,
        ))
    };
    let ((own, own_rms), (others, others_rms)) = (of(&near)?, of(&far)?);
    let taken = if own.max(own_rms) > MISSED_DB {
        own <= others && own_rms <= others_rms
    } else {
        own <= others + SLACK_DB
    };
    reasons.push(format!(
        "median error against the measured responses: {own:.1} dB with the small LFR, {others:.1} dB with the series expansion, so the {} is the model",
        if taken { "small LFR" } else { "exact LFR of the series expansion" }
    ));
    Ok(taken.then_some(small))
}

/// The error of all responses together over their size, in decibels.
fn rms_db(model: &[Frf], measured: &[Frf]) -> Result<f64, PipelineError> {
    let (mut error, mut size) = (0.0, 0.0);
    for (g, f) in model.iter().zip(measured) {
        for (k, relative) in g.relative_error(f)?.into_iter().enumerate() {
            let own = f.line(k).norm_squared();
            error += relative * relative * own;
            size += own;
        }
    }
    Ok(amplitude_db((error / size).sqrt()))
}
