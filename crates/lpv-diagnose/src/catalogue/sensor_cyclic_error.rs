//! Interferometer error periodic in the measured position.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};
use crate::screen::Trial;
use std::f64::consts::TAU;

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Output(0)), at(Place::Output(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "sensor-cyclic-error",
        family: Family::Sensor,
        place,
        needs: Needs::of(place),
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
        starts: &|screen, place| {
            let (shortest, travel) = screen.periods(place.first());
            super::pitches(screen, (travel, f64::max(1e-3 * travel, shortest)), |pitch| {
                let waves = screen.waves(|track, k, _| {
                    let mut gains = [0.0; 2];
                    gains[place.first()] = 1.0;
                    (TAU / pitch * track.outputs[k][place.first()], gains)
                });
                waves.map(Trial::Outputs).into()
            })
            .into_iter()
            .map(|(pitch, v)| vec![v[0], v[1], pitch])
            .collect()
        },
        on_response: None,
        block: &|v, _, place| {
            Box::new(Cyclic {
                channel: place.first(),
                sine: v[0],
                cosine: v[1],
                turn: TAU / v[2],
            })
        },
    }
}

#[derive(Debug)]
struct Cyclic {
    channel: usize,
    sine: f64,
    cosine: f64,
    turn: f64,
}

impl Block for Cyclic {
    fn sense(&self, _at: &Moment<'_>, _own: &[f64], outputs: &mut Pair) {
        let (s, c) = (self.turn * outputs[self.channel]).sin_cos();
        outputs[self.channel] += self.sine * s + self.cosine * c;
    }
}
