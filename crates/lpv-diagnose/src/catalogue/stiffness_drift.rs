//! A spring whose stiffness changes along a record.

use super::parameter;
use crate::base::Forces;
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "stiffness-drift",
    family: Family::Structure,
    place: Place::Motor(0),
    needs: Needs::Spring,
    meaning: "stiffness of the spring to ground that changes from the start of a record on",
    parameters: const {
        &[
            parameter("change", "u/y", Scale::Linear),
            parameter("time_constant", "s", Scale::Duration),
        ]
    },
    extends: None,
    starts: &|screen, _| {
        [0.1, 0.4, 2.0]
            .map(|part| vec![0.0, part * screen.duration()])
            .to_vec()
    },
    on_response: None,
    block: &|v, _, _| {
        Box::new(Softening {
            change: v[0],
            rate: v[1].recip(),
        })
    },
};

/// `-dk (1 - exp(-t / T)) y`.
#[derive(Debug)]
struct Softening {
    change: f64,
    rate: f64,
}

impl Block for Softening {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let changed = -(-at.time * self.rate).exp_m1() * self.change;
        forces.motors[0] -= changed * at.motion.motor_position[0];
    }
}
