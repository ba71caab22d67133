//! Left and right motors with different force constants.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "motor-asymmetry",
    family: Family::Actuator,
    place: Place::Motor(0),
    needs: Needs::CoupledMotors,
    meaning: "left and right motors with different force constants",
    parameters: &[EffectParameter {
        name: "difference",
        unit: "",
        scale: Scale::Linear,
    }],
    extends: None,
    starts: &|_, _| vec![vec![0.0]],
    on_response: None,
    block: &|v, _, _| Box::new(Asymmetry(v[0])),
};

/// The left one stronger by half of the difference, the right one weaker.
#[derive(Debug)]
struct Asymmetry(f64);

impl Block for Asymmetry {
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors[0] *= 1.0 + 0.5 * self.0;
        forces.motors[1] *= 1.0 - 0.5 * self.0;
    }
}
