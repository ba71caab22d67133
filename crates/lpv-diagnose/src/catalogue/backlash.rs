//! Play between a motor and the sensor of what it moves.

use super::parameter;
use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

/// At the first sensor, which tells the motor of an axis.
pub(super) static EFFECT: Effect = Effect {
    name: "backlash",
    family: Family::Structure,
    place: Place::Output(0),
    needs: Needs::Axis,
    meaning: "play between a motor and what its sensor reads, which friction holds while the play is crossed",
    parameters: const { &[parameter("gap", "y", Scale::Positive)] },
    extends: None,
    starts: &|screen, _| {
        /// Gaps over the travel.
        const PARTS: [f64; 2] = [3e-4, 1e-2];
        PARTS.map(|part| vec![part * screen.travel(0)]).to_vec()
    },
    on_response: None,
    block: &|v, _, _| Box::new(Play(v[0])),
};

/// Where the motor is within its play, from -1 to 1: `z' = 2 v / gap` between its ends, which it reaches in the manner of Bouc and Wen.
#[derive(Debug)]
struct Play(f64);

impl Block for Play {
    fn states(&self) -> usize {
        1
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], _forces: &mut Forces) {
        /// How sharp an end is.
        const SHARP: i32 = 8;
        // Held within what the integration follows: the end is `SHARP` times as stiff as the way there.
        let rate = (2.0 * at.motion.motor_speed[0] / self.0).clamp(-0.3 / at.step, 0.3 / at.step);
        let end = if rate * own[0] > 0.0 {
            1.0 - own[0].powi(SHARP)
        } else {
            1.0
        };
        rates[0] = rate * end;
    }

    fn sense(&self, _at: &Moment<'_>, own: &[f64], outputs: &mut Pair) {
        outputs[0] -= 0.5 * self.0 * own[0];
    }
}
