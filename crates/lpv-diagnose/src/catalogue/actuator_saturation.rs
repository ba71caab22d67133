//! Force that grows less than proportionally.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "actuator-saturation",
        family: Family::Actuator,
        place,
        needs: Needs::of(place),
        meaning: "force that grows less than proportionally with the command",
        parameters: &[EffectParameter {
            name: "softness",
            unit: "1/u^2",
            scale: Scale::NotNegative,
        }],
        extends: None,
        starts: &|_, _| vec![vec![0.0]],
        on_response: None,
        block: &|v, machine, place| {
            Box::new(Saturation {
                root: v[0].sqrt(),
                unit: super::motor_forces(machine, place.first(), 1.0),
            })
        },
    }
}

/// `F_max tanh(F / F_max)` with `softness = 1 / F_max^2`.
#[derive(Debug)]
struct Saturation {
    root: f64,
    unit: Pair,
}

impl Block for Saturation {
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in 0..2 {
            let part = self.root / self.unit[i];
            if part > 0.0 && part.is_finite() {
                forces.motors[i] = (part * forces.motors[i]).tanh() / part;
            }
        }
    }
}
