//! Presliding friction.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at::<0>(), at::<1>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "hysteresis",
        family: Family::Friction,
        channel: CHANNEL,
        needs: Needs::motor(CHANNEL),
        meaning: "friction that builds up over a presliding distance (Dahl)",
        parameters: &[
            EffectParameter {
                name: "level",
                unit: "u",
                scale: Scale::NotNegative,
            },
            EffectParameter {
                name: "distance",
                unit: "y",
                scale: Scale::Logarithmic,
            },
        ],
        extends: Some(Extends {
            name: "coulomb-friction",
            starts: |v, screen| {
                let travel = screen.travel(CHANNEL);
                [1e-4, 1e-3, 1e-2, 0.1]
                    .map(|part| vec![v[0], part * travel])
                    .to_vec()
            },
        }),
        starts: |screen| {
            let travel = screen.travel(CHANNEL);
            [0.002, 0.02, 0.1].map(|part| vec![0.0, part * travel]).to_vec()
        },
        on_response: None,
        block: |v, machine| builds_up(super::motor_forces(machine, CHANNEL, v[0]), v[1]),
    }
}

/// Friction with these levels at the motors, which it reaches over a distance.
pub(super) fn builds_up(level: Pair, distance: f64) -> Box<dyn Block> {
    Box::new(Dahl { level, distance })
}

/// A bristle that bends with the motion up to `distance`: `z' = v - |v| z / distance`, force `-F z / distance`.
#[derive(Debug)]
struct Dahl {
    level: Pair,
    distance: f64,
}

impl Block for Dahl {
    fn states(&self) -> usize {
        2
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        for i in 0..2 {
            let v = at.motion.motor_speed[i];
            // z / distance is the state; its rate is held within what the integration follows.
            let fall = (v.abs() / self.distance).min(1.3 / at.step);
            rates[i] = fall * (v.signum() - own[i]);
            forces.motors[i] -= self.level[i] * own[i];
        }
    }
}
