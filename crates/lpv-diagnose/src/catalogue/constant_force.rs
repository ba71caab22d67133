//! A constant force that begins, or ends.

use super::since::{self, Since};
use crate::base::Forces;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "constant-force",
    family: Family::Disturbance,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "constant force that begins at a time of a record, or of every record",
    parameters: &[
        EffectParameter {
            name: "force",
            unit: "u",
            scale: Scale::Linear,
        },
        since::BEGINS,
        since::RECORD,
    ],
    extends: None,
    starts: |screen, _| since::begins(screen, |_, _, _| 1.0),
    on_response: None,
    block: |v, _, _| {
        Box::new(Begun {
            force: v[0],
            since: Since::new(v[1], v[2]),
        })
    },
};

#[derive(Debug)]
struct Begun {
    force: f64,
    since: Since,
}

impl Block for Begun {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors[0] += self.force * self.since.part(at);
    }
}
