//! Force proportional to speed.

use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "viscous-friction",
        family: Family::Friction,
        place,
        needs: Needs::of(place),
        meaning: "force of the guides proportional to speed",
        parameters: &[EffectParameter {
            name: "coefficient",
            unit: "u s/y",
            scale: Scale::Linear,
        }],
        extends: None,
        // An axis has viscous friction of its own.
        starts: &|screen, _| {
            if !matches!(screen.base, Base::Axis(_)) {
                vec![vec![0.0]]
            } else {
                vec![]
            }
        },
        on_response: None,
        block: &|v, machine, place| Box::new(Viscous(super::motor_forces(machine, place.first(), v[0]))),
    }
}

#[derive(Debug)]
struct Viscous(Pair);

impl Block for Viscous {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            forces.motors[i] -= self.0[i] * at.motion.motor_speed[i];
        }
    }
}
