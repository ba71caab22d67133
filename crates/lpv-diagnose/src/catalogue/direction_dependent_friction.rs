//! Viscous friction that differs by direction.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "direction-dependent-friction",
        family: Family::Friction,
        place,
        needs: Needs::of(place),
        meaning: "viscous friction of the guides that is so much more forward, and so much less backward",
        parameters: &[EffectParameter {
            name: "viscous_forward_more",
            unit: "u s/y",
            scale: Scale::Linear,
        }],
        extends: None,
        starts: &|_, _| vec![vec![0.0]],
        on_response: None,
        block: &|v, machine, place| Box::new(Directed(super::motor_forces(machine, place.first(), v[0]))),
    }
}

/// `-c |v|`.
#[derive(Debug)]
struct Directed(Pair);

impl Block for Directed {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            forces.motors[i] -= self.0[i] * at.motion.motor_speed[i].abs();
        }
    }
}
