//! Constant force against the direction of motion.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 4] = [
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    sticking(Place::Motor(0)),
    sticking(Place::Motor(1)),
];

const fn at(place: Place) -> Effect {
    Effect {
        name: "coulomb-friction",
        family: Family::Friction,
        place,
        needs: Needs::of(place),
        meaning: "constant force of the guides against the direction of motion",
        parameters: &[
            EffectParameter {
                name: "level",
                unit: "u",
                scale: Scale::NotNegative,
            },
            EffectParameter {
                name: "creep_speed",
                unit: "y/s",
                scale: Scale::Logarithmic,
            },
        ],
        extends: None,
        starts: &|screen, place| vec![vec![0.0, screen.top_speed(place.first()) / 300.0]],
        on_response: None,
        block: &|v, machine, place| {
            Box::new(Coulomb {
                force: super::motor_forces(machine, place.first(), v[0]),
                creep: v[1],
            })
        },
    }
}

/// The form in which a machine rests, at a channel.
pub(super) fn at_rest(place: Place) -> Option<&'static Effect> {
    EFFECTS[2..].iter().find(|e| e.place == place)
}

/// The same where the machine rests in it: what presliding friction is called whose distance no reading resolves.
const fn sticking(place: Place) -> Effect {
    Effect {
        parameters: &[
            EffectParameter {
                name: "level",
                unit: "u",
                scale: Scale::NotNegative,
            },
            EffectParameter {
                name: "presliding_distance",
                unit: "y",
                scale: Scale::Logarithmic,
            },
        ],
        starts: &|_, _| Vec::new(),
        on_response: None,
        block: &|v, machine, place| {
            super::hysteresis::builds_up(super::motor_forces(machine, place.first(), v[0]), v[1])
        },
        ..at(place)
    }
}

/// `-F tanh(v / creep)`: what creeps slower than that sticks nearly.
#[derive(Debug)]
struct Coulomb {
    force: Pair,
    creep: f64,
}

impl Block for Coulomb {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            super::rub(i, self.force[i], (at.motion.motor_speed[i], self.creep), forces);
        }
    }
}
