//! Presliding friction.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "hysteresis",
        family: Family::Friction,
        place,
        needs: Needs::of(place),
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
            starts: |v, screen, place| {
                let travel = screen.travel(place.first());
                [1e-4, 1e-3, 1e-2, 0.1]
                    .map(|part| vec![v[0], part * travel])
                    .to_vec()
            },
        }),
        starts: &|screen, place| {
            let travel = screen.travel(place.first());
            [0.002, 0.02, 0.1].map(|part| vec![0.0, part * travel]).to_vec()
        },
        on_response: None,
        block: &|v, machine, place| builds_up(super::motor_forces(machine, place.first(), v[0]), v[1]),
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
        for i in at.motors() {
            let v = at.motion.motor_speed[i];
            // z / distance is the state; its rate is held within what the integration follows.
            let fall = (v.abs() / self.distance).min(1.3 / at.step);
            rates[i] = fall * (v.signum() - own[i]);
            forces.motors[i] -= self.level[i] * own[i];
        }
    }
}
