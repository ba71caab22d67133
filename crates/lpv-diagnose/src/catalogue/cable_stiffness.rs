//! A cable or hose between machine and ground.

use super::parameter;
use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

/// Motors that are coupled are the ends of one beam.
pub(super) static EFFECTS: [Effect; 3] = [
    Effect {
        needs: Needs::CoupledMotors,
        meaning: "spring to ground at each end of the beam, from a cable or hose",
        parameters: &[
            parameter("left_stiffness", "u/y", Scale::Linear),
            parameter("right_stiffness", "u/y", Scale::Linear),
            parameter("left_cubic", "u/y^3", Scale::Linear),
            parameter("right_cubic", "u/y^3", Scale::Linear),
        ],
        starts: &|_, _| vec![vec![0.0; 4]],
        on_response: None,
        block: &|v, machine, _| {
            let unit = super::motor_forces(machine, 0, 1.0);
            Box::new(Cable {
                linear: [unit[0] * v[0], unit[1] * v[1]],
                cubic: [unit[0] * v[2], unit[1] * v[3]],
            })
        },
        ..at(Place::Motor(0))
    },
    at(Place::Motor(0)),
    at(Place::Motor(1)),
];

const fn at(place: Place) -> Effect {
    Effect {
        name: "cable-stiffness",
        family: Family::PositionForce,
        place,
        needs: Needs::FreeMotor(place.first()),
        meaning: "spring to ground, from a cable or hose",
        parameters: const {
            &[
                parameter("stiffness", "u/y", Scale::Linear),
                parameter("cubic", "u/y^3", Scale::Linear),
            ]
        },
        extends: None,
        starts: &|_, _| vec![vec![0.0; 2]],
        on_response: None,
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Cable {
                linear: unit.map(|u| u * v[0]),
                cubic: unit.map(|u| u * v[1]),
            })
        },
    }
}

#[derive(Debug)]
struct Cable {
    linear: Pair,
    cubic: Pair,
}

impl Block for Cable {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            let y = at.motion.motor_position[i];
            forces.motors[i] -= y * (self.linear[i] + self.cubic[i] * y * y);
        }
    }
}
