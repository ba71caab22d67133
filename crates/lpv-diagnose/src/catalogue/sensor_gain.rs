//! Scale error.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Path, Place, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Output(0)), at(Place::Output(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "sensor-gain",
        family: Family::Sensor,
        place,
        needs: Needs::of(place),
        meaning: "scale error of a sensor",
        parameters: &[EffectParameter {
            name: "gain",
            unit: "",
            scale: Scale::Linear,
        }],
        extends: None,
        // A scale of the only sensor is one of mass and friction.
        starts: &|screen, _| {
            if screen.base.is_table() {
                vec![vec![0.0]]
            } else {
                vec![]
            }
        },
        on_response: Some(|on| {
            if on.outputs > 1 {
                vec![vec![0.0]]
            } else {
                Vec::new()
            }
        }),
        block: &|v, _, place| {
            Box::new(Gain {
                channel: place.first(),
                gain: v[0],
            })
        },
    }
}

#[derive(Debug)]
struct Gain {
    channel: usize,
    gain: f64,
}

impl Block for Gain {
    fn sense(&self, _at: &Moment<'_>, _own: &[f64], outputs: &mut Pair) {
        outputs[self.channel] *= 1.0 + self.gain;
    }

    fn respond(&self, _s: C64, path: &mut Path) {
        path.sensor *= 1.0 + self.gain;
    }
}
