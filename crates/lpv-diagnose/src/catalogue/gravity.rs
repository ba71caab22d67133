//! Gravity on an arm that turns: a wave of one turn, of which an axis may travel a part.

use super::parameter;
use crate::base::Forces;
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};
use std::f64::consts::TAU;

/// Least part of a turn that is travelled: over few degrees gravity is a slope and a square, and so is much else.
pub(crate) const LEAST_TURN: f64 = 1.0 / 18.0;

/// Of outputs that are angles by their unit.
pub(super) static EFFECT: Effect = Effect {
    name: "gravity",
    family: Family::PositionForce,
    place: Place::Motor(0),
    needs: Needs::FreeAxis,
    meaning: "gravity on an arm that turns",
    parameters: const {
        &[
            parameter("sine", "u", Scale::Linear),
            parameter("cosine", "u", Scale::Linear),
            parameter("turn", "y", Scale::Chosen),
        ]
    },
    extends: None,
    starts: &|screen, _| {
        let turn = screen.tracks.first().and_then(|t| t.turn);
        let turn = turn.filter(|turn| screen.travel(0) > LEAST_TURN * turn);
        turn.map(|turn| vec![0.0, 0.0, turn]).into_iter().collect()
    },
    on_response: None,
    block: &|v, machine, place| {
        let force = |input| super::motor_forces(machine, place.first(), input)[0];
        Box::new(Gravity {
            sine: force(v[0]),
            cosine: force(v[1]),
            angle: TAU / v[2],
        })
    },
};

/// `s sin(angle) + c cos(angle)`.
#[derive(Debug)]
struct Gravity {
    sine: f64,
    cosine: f64,
    /// Radians a unit of the output.
    angle: f64,
}

impl Block for Gravity {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let (sine, cosine) = (self.angle * at.motion.motor_position[0]).sin_cos();
        forces.motors[0] += self.sine * sine + self.cosine * cosine;
    }
}
