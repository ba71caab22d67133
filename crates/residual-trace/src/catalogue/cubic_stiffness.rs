//! A coupling that stiffens with deflection.

use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "cubic-stiffness",
    family: Family::Structure,
    channel: 0,
    needs: Needs::Table,
    meaning: "coupling between beam and carriage that stiffens with its deflection",
    parameters: &[EffectParameter {
        name: "cubic",
        unit: "1/y^2",
        scale: Scale::Linear,
    }],
    extends: None,
    starts: |_| vec![vec![0.0]],
    block: |v, _| Box::new(Cubic(v[0])),
};

/// `k e (1 + cubic e^2)` in the translation.
#[derive(Debug)]
struct Cubic(f64);

impl Block for Cubic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.coupling[0] += self.0 * at.machine.coupling_stiffness()[0] * at.motion.deflection[0].powi(3);
    }
}
