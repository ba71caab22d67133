//! What a small LFR says between the measured positions.

use lfr_fit::{Candidate, FrozenData, Units};
use lfr_realize::{BetweenWarning, BoundSettings, RealizeError, bound_between};
use lpv_core::Continuous;

/// What the positions support between them. Model and data are in these units.
pub(super) fn between(
    candidate: &Candidate<Continuous>,
    data: &FrozenData,
    units: &Units,
    reasons: &mut Vec<String>,
) -> Result<(), RealizeError> {
    let found = bound_between(candidate, data, &BoundSettings::default())?;
    let place = |p: &[f64]| units.undo_places(p)[0];
    let positions: Vec<f64> = data.scheduling().map(place).collect();
    let worst = found
        .intervals
        .iter()
        .filter(|i| i.bound.is_finite())
        .max_by(|a, b| a.bound.total_cmp(&b.bound));
    if let Some(worst) = worst {
        reasons.push(format!(
            "between positions: models fitted to half of them differ from this one by at most {:.1} dB at every p (bounded, the largest between {:.5} and {:.5})",
            20.0 * worst.bound.log10(),
            place(&worst.from),
            place(&worst.to)
        ));
    }
    let ends = |interval: usize| {
        let at = &found.intervals[interval];
        format!("between {:.5} and {:.5}", place(&at.from), place(&at.to))
    };
    let mut coarse: Option<(f64, String)> = None;
    for warning in &found.warnings {
        match warning {
            // Where models of half the positions agree, modes may move by more than their width.
            BetweenWarning::Coarse { interval, .. } if found.intervals[*interval].bound < AGREE => {}
            BetweenWarning::Coarse {
                interval,
                frequency_hz,
                shift,
            } => {
                if coarse.as_ref().is_none_or(|(most, _)| shift > most) {
                    let (ends, frequency) = (ends(*interval), units.undo_frequency(*frequency_hz));
                    coarse = Some((*shift, format!("warning: modes shift by more than their half-width from one position to the next, most the one at {frequency:.3}, by {shift:.1} half-widths {ends}; measure between them")));
                }
            }
            BetweenWarning::NotPredicted {
                position,
                left_out,
                fitted,
            } => reasons.push(format!(
                "warning: without position {:.5} a model misses it by {left_out:.3}, against {fitted:.3} with it; what it says between positions is not supported there",
                positions[*position]
            )),
            BetweenWarning::Unbounded { interval } => {
                reasons.push(format!("warning: no bound {}", ends(*interval)));
            }
        }
    }
    reasons.extend(coarse.map(|(_, warning)| warning));
    Ok(())
}

/// Models of half the positions that differ by less than this part of the response agree.
const AGREE: f64 = 0.1;
