//! Scale error.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Path, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECT: Effect = Effect {
    name: "sensor-gain",
    family: Family::Sensor,
    channel: 0,
    needs: Needs::Nothing,
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
    block: |v, _| Box::new(Gain(v[0])),
};

#[derive(Debug)]
struct Gain(f64);

impl Block for Gain {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut Pair) {
        outputs[0] *= 1.0 + self.0;
    }

    fn respond(&self, _s: C64, path: &mut Path) {
        path.sensor *= 1.0 + self.0;
    }
}
