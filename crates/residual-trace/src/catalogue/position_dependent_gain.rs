//! Force constant that varies along the stroke.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "position-dependent-gain",
    family: Family::Actuator,
    channel: 0,
    needs: Needs::Nothing,
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
    starts: |_| vec![vec![0.0; 2]],
    block: |v, _| {
        Box::new(Gain {
            slope: v[0],
            curvature: v[1],
        })
    },
};

#[derive(Debug)]
struct Gain {
    slope: f64,
    curvature: f64,
}

impl Block for Gain {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in 0..2 {
            let y = at.motion.motor_position[i];
            forces.motors[i] *= 1.0 + y * (self.slope + self.curvature * y);
        }
    }
}
