//! The sensor reads a point away from the assumed one.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "abbe-offset",
    family: Family::Sensor,
    place: Place::Output(0),
    needs: Needs::TwoChannels,
    meaning: "sensor of the translation that reads a point away from the assumed one",
    parameters: &[EffectParameter {
        name: "offset",
        unit: "y",
        scale: Scale::Linear,
    }],
    extends: None,
    starts: &|_, _| vec![vec![0.0]],
    on_response: None,
    block: &|v, _, _| Box::new(Abbe(v[0])),
};

#[derive(Debug)]
struct Abbe(f64);

impl Block for Abbe {
    fn sense(&self, _at: &Moment<'_>, _own: &[f64], outputs: &mut Pair) {
        outputs[0] += self.0 * outputs[1];
    }
}
