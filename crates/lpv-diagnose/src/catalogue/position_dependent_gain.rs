//! Force constant that varies along the stroke.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "position-dependent-gain",
        family: Family::Actuator,
        place,
        needs: Needs::of(place),
        meaning: "force constant of the motors that varies along the stroke",
        parameters: &[
            EffectParameter {
                name: "slope",
                unit: "1/y",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "curvature",
                unit: "1/y^2",
                scale: Scale::Linear,
            },
        ],
        extends: None,
        starts: &|_, _| vec![vec![0.0; 2]],
        on_response: None,
        block: &|v, machine, place| {
            Box::new(Gain {
                slope: super::of_motors(machine, place, v[0]),
                curvature: super::of_motors(machine, place, v[1]),
            })
        },
    }
}

#[derive(Debug)]
struct Gain {
    slope: Pair,
    curvature: Pair,
}

impl Block for Gain {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            let y = at.motion.motor_position[i];
            forces.motors[i] *= 1.0 + y * (self.slope[i] + self.curvature[i] * y);
        }
    }
}
