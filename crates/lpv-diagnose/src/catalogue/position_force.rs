//! Force that changes smoothly with where a motor is: gravity over less than a turn, an arm that moves, a magnet beside the guide.

use super::parameter;
use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, Extends, Family, Moment, Needs, Place, Scale};
use crate::screen::Screen;

pub(super) static EFFECTS: [Effect; 4] = [
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    straight(Place::Motor(0)),
    straight(Place::Motor(1)),
];

const NAME: &str = "position-force";

const fn at(place: Place) -> Effect {
    Effect {
        name: NAME,
        family: Family::PositionForce,
        place,
        needs: Needs::FreeMotor(place.first()),
        meaning: "force that changes smoothly with the position of the motor",
        parameters: const {
            &[
                parameter("slope", "u/y", Scale::Linear),
                parameter("square", "u/y^2", Scale::Linear),
                parameter("cube", "u/y^3", Scale::Linear),
            ]
        },
        extends: Some(Extends {
            name: NAME,
            starts: |v, _, _| vec![vec![v[0], 0.0, 0.0]],
        }),
        starts,
        on_response: None,
        block: |v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Smooth {
                unit,
                powers: [v[0], v[1], v[2]],
            })
        },
    }
}

/// The same along a straight line, which is all that some records tell: a curve of them leads astray beyond.
const fn straight(place: Place) -> Effect {
    Effect {
        parameters: const { &[parameter("slope", "u/y", Scale::Linear)] },
        extends: None,
        starts: |screen, place| match starts(screen, place).is_empty() {
            true => Vec::new(),
            false => vec![vec![0.0]],
        },
        block: |v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Smooth {
                unit,
                powers: [v[0], 0.0, 0.0],
            })
        },
        ..at(place)
    }
}

/// Where an observer holds an axis at its records, and these show more of the curve than a straight line.
fn starts(screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    /// Travels from zero within which powers of the position are told apart.
    const FAR: f64 = 10.0;
    let motor = place.first();
    let is_near = screen.farthest(motor) <= FAR * screen.travel(motor);
    let is_held = screen.tracks.iter().all(|t| t.follows);
    match matches!(screen.base, Base::Axis(_)) && is_held && is_near {
        true => vec![vec![0.0; 3]],
        false => Vec::new(),
    }
}

/// What a polynomial of the position without its constant, which a base has of its own, takes from the force of the motor.
#[derive(Debug)]
struct Smooth {
    unit: Pair,
    powers: [f64; 3],
}

impl Block for Smooth {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let [slope, square, cube] = self.powers;
        for i in 0..2 {
            let y = at.motion.motor_position[i];
            forces.motors[i] -= self.unit[i] * y * (slope + y * (square + y * cube));
        }
    }
}
