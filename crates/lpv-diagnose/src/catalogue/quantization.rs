//! Finite resolution.

use crate::effect::{Block, Effect, EffectParameter, Family, Needs, Place, Scale};
use crate::track::Track;

pub(crate) static EFFECT: Effect = Effect {
    name: "quantization",
    family: Family::Sensor,
    place: Place::Output(0),
    needs: Needs::Nothing,
    meaning: "finite resolution of the sensors",
    parameters: &[
        EffectParameter {
            name: "step",
            unit: "y",
            scale: Scale::NotNegative,
        },
        EffectParameter {
            name: "other_step",
            unit: "y2",
            scale: Scale::NotNegative,
        },
    ],
    extends: None,
    // It is read off the values, not fitted.
    starts: &|_, _| Vec::new(),
    on_response: None,
    block: &|_, _, _| Box::new(Steps),
};

/// In a simulation nothing: which way a reading is rounded depends on the noise. It adds to the noise of the sensors.
#[derive(Debug)]
struct Steps;

impl Block for Steps {}

/// Steps of the outputs with their deviations, zero where values lie on no grid.
pub(crate) fn steps(tracks: &[Track]) -> [(f64, f64); 2] {
    [0, 1].map(|i: usize| lattice(tracks, i))
}

/// Step of the grid on which all values of an output lie.
fn lattice(tracks: &[Track], output: usize) -> (f64, f64) {
    let mut values: Vec<f64> = tracks
        .iter()
        .flat_map(|t| t.outputs.iter().map(|y| y[output]))
        .collect();
    values.sort_by(f64::total_cmp);
    let span = values.last().unwrap_or(&0.0) - values.first().unwrap_or(&0.0);
    let gaps: Vec<f64> = values
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|g| *g > 1e-12 * span)
        .collect();
    let Some(smallest) = gaps.iter().copied().min_by(f64::total_cmp) else {
        return (0.0, 0.0);
    };
    let off = |step: f64| {
        gaps.iter()
            .filter(|g| (*g / step - (*g / step).round()).abs() > 0.05)
            .count()
    };
    if off(smallest) * 50 > gaps.len() {
        return (0.0, 0.0);
    }
    // The first value off zero tells the step the better the farther it is.
    let mut step = smallest;
    for scale in [10.0, 1e2, 1e3, 1e4] {
        let near: Vec<f64> = values
            .iter()
            .copied()
            .filter(|v| v.abs() > 0.3 * scale * step && v.abs() < scale * step)
            .collect();
        let sum: (f64, f64) = near.iter().fold((0.0, 0.0), |(a, b), v| {
            let n = (v / step).round();
            (a + n * v, b + n * n)
        });
        if sum.1 > 0.0 {
            step = sum.0 / sum.1;
        }
    }
    let (rest, count) = values.iter().fold((0.0, 0.0), |(rest, count), v| {
        let n = (v / step).round();
        (rest + (v - n * step).powi(2), count + n * n)
    });
    (
        step,
        (rest / values.len() as f64 / f64::max(count, 1.0))
            .sqrt()
            .max(1e-9 * step),
    )
}
