//! Interferometer error periodic in the measured position.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};
use crate::screen::Trial;
use std::f64::consts::TAU;

pub(super) static EFFECT: Effect = Effect {
    name: "sensor-cyclic-error",
    family: Family::Sensor,
    channel: 0,
    needs: Needs::Nothing,
    meaning: "error of a sensor that is periodic in the measured position",
    parameters: &[
        EffectParameter {
            name: "sine",
            unit: "y",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "cosine",
            unit: "y",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "period",
            unit: "y",
            scale: Scale::Wavelength,
        },
    ],
    extends: None,
    starts: |screen| {
        super::pitches(screen, 1e-3 * screen.travel(), |pitch| {
            let one = |phase: f64| {
                Trial::Outputs(
                    screen.signal(|track, k, _| [(TAU / pitch * track.outputs[k][0] + phase).sin(), 0.0]),
                )
            };
            vec![one(0.0), one(0.25 * TAU)]
        })
        .into_iter()
        .map(|(pitch, v)| vec![v[0], v[1], pitch])
        .collect()
    },
    block: |v, _| {
        Box::new(Cyclic {
            sine: v[0],
            cosine: v[1],
            turn: TAU / v[2],
        })
    },
};

#[derive(Debug)]
struct Cyclic {
    sine: f64,
    cosine: f64,
    turn: f64,
}

impl Block for Cyclic {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut Pair) {
        let (s, c) = (self.turn * outputs[0]).sin_cos();
        outputs[0] += self.sine * s + self.cosine * c;
    }
}
