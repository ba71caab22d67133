//! An input whose scale is another in one record.

use super::parameter;
use super::since;
use crate::base::Forces;
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

/// The scale of all records is that of mass and friction.
pub(super) static EFFECT: Effect = Effect {
    name: "input-gain",
    family: Family::Actuator,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "scale of the input that is so much larger in one record than in the others",
    parameters: const { &[parameter("gain", "", Scale::Linear), since::RECORD] },
    extends: None,
    starts: &|screen, _| {
        let single = since::single(screen).into_iter();
        single.map(|record| vec![0.0, record as f64]).collect()
    },
    on_response: None,
    block: &|v, _, _| {
        Box::new(Scaled {
            gain: v[0],
            since: since::Since::new(f64::NEG_INFINITY, v[1]),
        })
    },
};

#[derive(Debug)]
struct Scaled {
    gain: f64,
    since: since::Since,
}

impl Block for Scaled {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors[0] *= 1.0 + self.gain * self.since.part(at);
    }
}
