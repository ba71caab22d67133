//! Coulomb friction that is larger near zero speed.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "stribeck-friction",
        family: Family::Friction,
        place,
        needs: Needs::of(place),
        meaning: "friction of the guides that is larger near zero speed",
        parameters: &[
            EffectParameter {
                name: "level",
                unit: "u",
                scale: Scale::Positive,
            },
            EffectParameter {
                name: "breakaway",
                unit: "u",
                scale: Scale::Positive,
            },
            EffectParameter {
                name: "creep_speed",
                unit: "y/s",
                scale: Scale::Logarithmic,
            },
            EffectParameter {
                name: "stribeck_speed",
                unit: "y/s",
                scale: Scale::Logarithmic,
            },
        ],
        extends: Some(Extends {
            name: "coulomb-friction",
            starts: |v, screen, place| {
                let top = screen.top_speed(place.first());
                // A peak near zero speed may pass for a sign that changes at once.
                let creep = if v[1] < 1e-3 * top {
                    vec![v[1], 1e-2 * top]
                } else {
                    vec![v[1]]
                };
                let starts =
                    |creep: f64| [3.0, 10.0, 40.0].map(|part| vec![v[0], 0.2 * v[0], creep, top / part]);
                creep.into_iter().flat_map(starts).collect()
            },
        }),
        starts: &|screen, place| {
            let top = screen.top_speed(place.first());
            vec![
                vec![0.0, 0.0, top / 300.0, top / 10.0],
                vec![0.0, 0.0, top / 300.0, top / 40.0],
            ]
        },
        on_response: None,
        block: &|v, machine, place| {
            Box::new(Stribeck {
                level: super::motor_forces(machine, place.first(), v[0]),
                more: super::motor_forces(machine, place.first(), v[1]),
                creep: v[2],
                fall: v[3],
            })
        },
    }
}

/// `-(F_c + F_s exp(-(v / fall)^2)) tanh(v / creep)`.
#[derive(Debug)]
struct Stribeck {
    level: Pair,
    more: Pair,
    creep: f64,
    fall: f64,
}

/// Squares of the speed over that of the fall from which the peak is within the rounding of the level.
const FAR: f64 = 40.0;

impl Block for Stribeck {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            let v = at.motion.motor_speed[i];
            let far = (v / self.fall).powi(2);
            let peak = if far < FAR { (-far).exp() } else { 0.0 };
            let level = self.level[i] + self.more[i] * peak;
            super::rub(i, level, (v, self.creep), forces);
        }
    }
}
