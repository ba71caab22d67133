//! Viscous friction that differs by direction.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "direction-dependent-friction",
    family: Family::Friction,
    channel: 0,
    meaning: "Coulomb friction of the guides, and viscous friction that differs by the direction of motion",
    parameters: &[
        EffectParameter {
            name: "level",
            unit: "u",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "viscous_forward_more",
            unit: "u s/y",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "creep_speed",
            unit: "y/s",
            scale: Scale::Logarithmic,
        },
    ],
    extends: Some(Extends {
        name: "coulomb-friction",
        starts: |v, _| vec![vec![v[0], 0.0, v[1]]],
    }),
    // Without the rough part it is not to be seen.
    starts: |_| Vec::new(),
    block: |v, machine| {
        Box::new(Directed {
            level: super::motor_forces(machine, v[0]),
            viscous: super::motor_forces(machine, v[1]),
            creep: v[2],
        })
    },
};

/// `-F s - c v s` with `s = tanh(v / creep)`: so much more forward, so much less backward.
#[derive(Debug)]
struct Directed {
    level: Pair,
    viscous: Pair,
    creep: f64,
}

impl Block for Directed {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in 0..2 {
            let v = at.motion.motor_speed[i];
            let s = (v / self.creep).tanh();
            forces.motors[i] -= (self.level[i] + self.viscous[i] * v) * s;
        }
    }
}
