//! Scale error.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Path, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECTS: [Effect; 2] = [at::<0>(), at::<1>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "sensor-gain",
        family: Family::Sensor,
        channel: CHANNEL,
        needs: Needs::sensor(CHANNEL),
        meaning: "scale error of a sensor",
        parameters: &[EffectParameter {
            name: "gain",
            unit: "",
            scale: Scale::Linear,
        }],
        extends: None,
        // A scale of the only sensor is one of mass and friction.
        starts: |screen| {
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
        block: |v, _| Box::new(Gain::<CHANNEL>(v[0])),
    }
}

#[derive(Debug)]
struct Gain<const CHANNEL: usize>(f64);

impl<const CHANNEL: usize> Block for Gain<CHANNEL> {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut Pair) {
        outputs[CHANNEL] *= 1.0 + self.0;
    }

    fn respond(&self, _s: C64, path: &mut Path) {
        path.sensor *= 1.0 + self.0;
    }
}
