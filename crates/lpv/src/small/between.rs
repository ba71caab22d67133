//! What a small LFR says between the measured positions.

use crate::Summary;
use lfr_fit::{Candidate, FrozenData, Units};
use lfr_realize::{BetweenWarning, BoundSettings, RealizeError, bound_between, largest_shift_of};
use lpv_core::Continuous;
use lpv_core::num_complex::Complex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest error that is to be expected between two neighbouring positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BetweenPositions {
    /// The two positions.
    pub positions: [f64; 2],
    /// Error midway over the noise of the responses.
    pub over_noise: f64,
    /// Error midway, percent of the response.
    pub error_percent: f64,
}

impl BetweenPositions {
    /// Whether more than noise is to be expected there.
    pub(crate) fn is_missed(&self) -> bool {
        self.over_noise > EXPECTED
    }
}

/// Expected error between the positions, over the noise, from which on it is a warning.
const EXPECTED: f64 = 1.5;

impl Summary {
    /// What is to be expected between the positions of the small LFR, where they tell.
    pub(crate) fn between(&self) -> Option<&BetweenPositions> {
        let lpv = self.frequency.as_ref()?.lpv.as_ref()?;
        lpv.small.as_ref()?.between.as_ref()
    }
}

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

/// A warning where modes move by more than their half-width from one position to the next, of a model that is not at the noise and so
/// tells nothing between them; positions in the user's unit.
pub(super) fn coarse(modes: &[Vec<Complex<f64>>], positions: &[f64]) -> Option<String> {
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_by(|a, b| positions[*a].total_cmp(&positions[*b]));
    let upper = |at: usize| -> Vec<Complex<f64>> {
        let above = modes[at].iter().filter(|z| z.im > 0.0);
        above.map(|z| z.ln()).collect()
    };
    let shifts = order.windows(2).filter_map(|pair| {
        let (shift, _) = largest_shift_of(&upper(pair[0]), &upper(pair[1]))?;
        Some((shift, pair[0], pair[1]))
    });
    let (shift, here, there) = shifts.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (shift > 1.0).then(|| {
        format!(
            "warning: the noise is not reached, and modes shift by up to {shift:.1} of their half-widths between {:.5} and {:.5}: between the positions the model may err by much more than at them; measure at more",
            positions[here], positions[there]
        )
    })
}

/// Models of half the positions that differ by less than this part of the response agree.
const AGREE: f64 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_shift_is_named_with_its_place() {
        let mode = |hz: f64| {
            let w = std::f64::consts::TAU * hz / 1000.0;
            let z = Complex::new(-0.01 * w, w).exp();
            vec![z, z.conj()]
        };
        // Half-width 1 Hz; positions out of order.
        let modes = [mode(100.0), mode(104.0), mode(101.0)];
        let found = coarse(&modes, &[-1.0, 1.0, 0.0]).unwrap();
        assert!(
            found.contains("3.0 of their half-widths between 0.00000 and 1.00000"),
            "{found}"
        );
        assert!(coarse(&modes[..1], &[0.0]).is_none());
        assert!(coarse(&[mode(100.0), mode(100.5)], &[0.0, 1.0]).is_none());
    }
}
