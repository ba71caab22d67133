//! Force proportional to speed.

use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 3] = [at(Place::Motor(0)), at(Place::Motor(1)), OF_A_LOAD];

/// Of the guide of a load on a spring; the axis has that of its motor.
const OF_A_LOAD: Effect = Effect {
    needs: Needs::Load,
    meaning: "force of the guides of the load proportional to its speed",
    parameters: &[EffectParameter {
        name: "coefficient_of_the_load",
        unit: "u s/y",
        scale: Scale::Linear,
    }],
    starts: &|_, _| vec![vec![0.0]],
    block: &|v, machine, _| Box::new(OfLoad(super::motor_forces(machine, 0, v[0])[0])),
    ..at(Place::Motor(0))
};

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
struct OfLoad(f64);

impl Block for OfLoad {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.load[0] -= self.0 * at.motion.load_speed[0];
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
