//! Finite resolution.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Scale};
use crate::screen::Screen;

pub(super) static EFFECT: Effect = Effect {
    name: "quantization",
    family: Family::Sensor,
    channel: 0,
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
    starts: |screen| {
        let steps = [0, 1].map(|i: usize| lattice(screen, i));
        if steps[0] > 0.0 || steps[1] > 0.0 {
            vec![steps.to_vec()]
        } else {
            vec![]
        }
    },
    block: |v, _| Box::new(Steps([v[0], v[1]])),
};

#[derive(Debug)]
struct Steps(Pair);

impl Block for Steps {
    fn resolution(&self) -> Option<Pair> {
        Some(self.0)
    }
}

/// Step of the grid on which all values of an output lie; zero without one.
fn lattice(screen: &Screen<'_>, output: usize) -> f64 {
    let mut values: Vec<f64> = screen
        .tracks
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
        return 0.0;
    };
    // On a grid, values repeat; without one, the smallest gap divides nothing.
    if gaps.len() * 2 > values.len() {
        return 0.0;
    }
    let off = |step: f64| {
        gaps.iter()
            .filter(|g| (*g / step - (*g / step).round()).abs() > 0.05)
            .count()
    };
    if off(smallest) * 50 > gaps.len() {
        return 0.0;
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
    step
}
