//! A cable or hose between machine and ground.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at::<0>(), at::<1>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "cable-stiffness",
        family: Family::PositionForce,
        channel: CHANNEL,
        needs: Needs::motor(CHANNEL),
        meaning: "spring to ground at each end of the beam, from a cable or hose",
        parameters: &[
            EffectParameter {
                name: "left_stiffness",
                unit: "u/y",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "right_stiffness",
                unit: "u/y",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "left_cubic",
                unit: "u/y^3",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "right_cubic",
                unit: "u/y^3",
                scale: Scale::Linear,
            },
        ],
        extends: None,
        starts: |_| vec![vec![0.0; 4]],
        block: |v, machine| {
            let unit = super::motor_forces(machine, CHANNEL, 1.0);
            Box::new(Cable {
                linear: [unit[0] * v[0], unit[1] * v[1]],
                cubic: [unit[0] * v[2], unit[1] * v[3]],
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
        for i in 0..2 {
            let y = at.motion.motor_position[i];
            forces.motors[i] -= y * (self.linear[i] + self.cubic[i] * y * y);
        }
    }
}
