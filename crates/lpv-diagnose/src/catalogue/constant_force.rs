//! A constant force: of a machine that is not level, of a load that hangs, or one that begins.

use super::parameter;
use super::since::{self, Since};
use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

/// A servo axis has one of its own, so that there one can only begin. Motors that are coupled are the ends of one beam.
pub(super) static EFFECTS: [Effect; 4] = [
    Effect {
        needs: Needs::CoupledMotors,
        meaning: "constant force on each end of the beam, in every record",
        parameters: const {
            &[
                parameter("left_force", "u", Scale::Linear),
                parameter("right_force", "u", Scale::Linear),
            ]
        },
        starts: &|_, _| vec![vec![0.0; 2]],
        block: &|v, machine, _| {
            let unit = super::motor_forces(machine, 0, 1.0);
            Box::new(Constant([unit[0] * v[0], unit[1] * v[1]]))
        },
        ..at(Place::Motor(0))
    },
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    BEGINS,
];

const fn at(place: Place) -> Effect {
    Effect {
        place,
        needs: Needs::OwnMotor(place.first()),
        meaning: "constant force on the motor, in every record",
        parameters: const { &[parameter("force", "u", Scale::Linear)] },
        starts: &|screen, _| match screen.base {
            Base::Axis(_) => vec![],
            _ => vec![vec![0.0]],
        },
        block: &|v, machine, place| Box::new(Constant(super::motor_forces(machine, place.first(), v[0]))),
        ..BEGINS
    }
}

const BEGINS: Effect = Effect {
    name: "constant-force",
    family: Family::Disturbance,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "constant force that begins at a time of a record, or of every record",
    parameters: const {
        &[
            parameter("force", "u", Scale::Linear),
            since::BEGINS,
            since::RECORD,
        ]
    },
    extends: None,
    starts: &|screen, _| since::begins(screen, |_, _, _| 1.0),
    on_response: None,
    block: &|v, _, _| {
        Box::new(Begun {
            force: v[0],
            since: Since::new(v[1], v[2]),
        })
    },
};

#[derive(Debug)]
struct Constant(Pair);

impl Block for Constant {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            forces.motors[i] += self.0[i];
        }
    }
}

#[derive(Debug)]
struct Begun {
    force: f64,
    since: Since,
}

impl Block for Begun {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors[0] += self.force * self.since.part(at);
    }
}
