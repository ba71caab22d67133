//! Force periodic in the position of a motor.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};
use crate::screen::Trial;
use std::f64::consts::TAU;

pub(super) static EFFECTS: [Effect; 2] = [at::<0>(), at::<1>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "cogging",
        family: Family::PositionForce,
        channel: CHANNEL,
        needs: Needs::motor(CHANNEL),
        meaning: "force periodic in the position of each motor",
        parameters: &[
            EffectParameter {
                name: "left_sine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "left_cosine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "right_sine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "right_cosine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "pitch",
                unit: "y",
                scale: Scale::Wavelength,
            },
        ],
        extends: None,
        starts: |screen| {
            // What passes within a sample is not seen.
            let step = screen.step();
            let range = (screen.travel(CHANNEL), screen.top_speed(CHANNEL) * step);
            super::pitches(screen, range, |pitch| {
                let turn = TAU / pitch;
                let force = super::motor_forces(screen.base, CHANNEL, 1.0);
                let one = |motor: usize, phase: f64| {
                    Trial::Motors(screen.signal(|_, _, m| {
                        // Mean over the sample that follows.
                        let half = 0.5 * turn * step * m.motor_speed[motor];
                        let mean = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
                        let mut f = [0.0; 2];
                        f[motor] =
                            force[motor] * mean * (turn * m.motor_position[motor] + half + phase).sin();
                        f
                    }))
                };
                let mut all = vec![one(0, 0.0), one(0, 0.25 * TAU)];
                if screen.base.channels() > 1 {
                    all.extend([one(1, 0.0), one(1, 0.25 * TAU)]);
                }
                all
            })
            .into_iter()
            .map(|(pitch, mut v)| {
                v.resize(4, 0.0);
                v.push(pitch);
                v
            })
            .collect()
        },
        block: |v, machine| {
            let unit = super::motor_forces(machine, CHANNEL, 1.0);
            Box::new(Cogging {
                sine: [unit[0] * v[0], unit[1] * v[2]],
                cosine: [unit[0] * v[1], unit[1] * v[3]],
                turn: TAU / v[4],
            })
        },
    }
}

#[derive(Debug)]
struct Cogging {
    sine: Pair,
    cosine: Pair,
    turn: f64,
}

impl Block for Cogging {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in 0..2 {
            let (s, c) = (self.turn * at.motion.motor_position[i]).sin_cos();
            forces.motors[i] += self.sine[i] * s + self.cosine[i] * c;
        }
    }
}
