//! Force proportional to the square of the speed, against it.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "quadratic-friction",
    family: Family::Friction,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "force against the motion that grows with the square of the speed, as that of air or oil",
    parameters: &[EffectParameter {
        name: "coefficient",
        unit: "u s^2/y^2",
        scale: Scale::Linear,
    }],
    extends: None,
    starts: &|_, _| vec![vec![0.0]],
    on_response: None,
    block: &|v, _, _| Box::new(Quadratic(v[0])),
};

/// `-c v |v|`.
#[derive(Debug)]
struct Quadratic(f64);

impl Block for Quadratic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let speed = at.motion.motor_speed[0];
        forces.motors[0] -= self.0 * speed * speed.abs();
    }
}
