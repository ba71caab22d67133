//! A coupling or spring that stiffens with deflection.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [
    Effect {
        name: "cubic-stiffness",
        family: Family::Structure,
        place: Place::Motor(0),
        needs: Needs::Coupling,
        meaning: "coupling between beam and carriage, or motor and load, that stiffens with its deflection",
        parameters: &[EffectParameter {
            name: "cubic",
            unit: "1/y^2",
            scale: Scale::Linear,
        }],
        extends: None,
        starts: &|_, _| vec![vec![0.0]],
        on_response: None,
        block: &|v, _, _| Box::new(Cubic(v[0])),
    },
    Effect {
        name: "cubic-stiffness",
        family: Family::Structure,
        place: Place::Motor(0),
        needs: Needs::Spring,
        meaning: "spring to ground whose force is not proportional to its deflection",
        parameters: &[
            EffectParameter {
                name: "square",
                unit: "u/y^2",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "cube",
                unit: "u/y^3",
                scale: Scale::Linear,
            },
        ],
        extends: None,
        starts: &|_, _| vec![vec![0.0; 2]],
        on_response: None,
        block: &|v, _, _| {
            Box::new(Spring {
                square: v[0],
                cube: v[1],
            })
        },
    },
];

/// `k e (1 + cubic e^2)` in the translation.
#[derive(Debug)]
struct Cubic(f64);

impl Block for Cubic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.coupling[0] += self.0 * at.machine.coupling_stiffness()[0] * at.motion.deflection[0].powi(3);
    }
}

/// What a spring to ground has beside `k y`.
#[derive(Debug)]
struct Spring {
    square: f64,
    cube: f64,
}

impl Block for Spring {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let y = at.motion.motor_position[0];
        forces.motors[0] -= y * y * (self.square + self.cube * y);
    }
}
