//! Dynamics that also vary with another measured signal.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "second-scheduling",
    family: Family::Scheduling,
    place: Place::Motor(0),
    needs: Needs::Table,
    meaning: "couplings whose stiffness follows a second measured signal",
    parameters: &[
        EffectParameter {
            name: "translation",
            unit: "1/signal",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "rotation",
            unit: "1/signal",
            scale: Scale::Linear,
        },
    ],
    extends: None,
    starts: &|screen, _| {
        if screen.auxiliaries() > 0 {
            vec![vec![0.0; 2]]
        } else {
            vec![]
        }
    },
    on_response: None,
    block: &|v, _, _| Box::new(Second([v[0], v[1]])),
};

/// `k e (1 + c q)`, q the first further signal.
#[derive(Debug)]
struct Second(Pair);

impl Block for Second {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let (q, k) = (at.auxiliary(0), at.machine.coupling_stiffness());
        for i in at.motors() {
            forces.coupling[i] += self.0[i] * q * k[i] * at.motion.deflection[i];
        }
    }
}
