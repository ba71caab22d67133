//! Forces that depend on how fast the scheduling moves.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "scheduling-rate",
    family: Family::Scheduling,
    place: Place::Motor(0),
    needs: Needs::TwoChannels,
    meaning: "forces on the load from the rate of the scheduling times its own motion (Coriolis)",
    parameters: &[
        EffectParameter {
            name: "force",
            unit: "kg",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "torque",
            unit: "kg",
            scale: Scale::Linear,
        },
    ],
    extends: None,
    starts: &|_, _| vec![vec![0.0; 2]],
    on_response: None,
    block: &|v, _, _| {
        Box::new(Rate {
            force: v[0],
            torque: v[1],
        })
    },
};

/// Force `-c_F p' R'` and torque `-c_T p' y'`.
#[derive(Debug)]
struct Rate {
    force: f64,
    torque: f64,
}

impl Block for Rate {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.load[0] -= self.force * at.rate * at.motion.load_speed[1];
        forces.load[1] -= self.torque * at.rate * at.motion.load_speed[0];
    }
}
