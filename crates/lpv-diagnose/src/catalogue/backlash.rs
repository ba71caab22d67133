//! Play between a motor and the sensor of what it moves.

use super::parameter;
use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};
use crate::screen::Screen;

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Output(0)), at(Place::Output(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "backlash",
        family: Family::Structure,
        place,
        needs: Needs::of(place),
        meaning: "play between a motor and what its sensor reads, which friction holds while the play is crossed",
        parameters: const { &[parameter("gap", "y", Scale::Positive)] },
        extends: None,
        starts,
        on_response: None,
        block: |v, _, place| {
            Box::new(Play {
                channel: place.first(),
                gap: v[0],
            })
        },
    }
}

/// Gaps over the travel.
fn starts(screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    const PARTS: [f64; 2] = [3e-4, 1e-2];
    match screen.base {
        Base::Axis(_) => PARTS
            .map(|part| vec![part * screen.travel(place.first())])
            .to_vec(),
        Base::XyTable(_) | Base::Lpv(_) => Vec::new(),
    }
}

/// Where the motor is within its play, from -1 to 1: `z' = 2 v / gap` between its ends, which it reaches in the manner of Bouc and Wen.
#[derive(Debug)]
struct Play {
    channel: usize,
    gap: f64,
}

impl Block for Play {
    fn states(&self) -> usize {
        1
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], _forces: &mut Forces) {
        /// How sharp an end is.
        const SHARP: i32 = 8;
        let v = at.motion.motor_speed[self.channel];
        // Held within what the integration follows: the end is `SHARP` times as stiff as the way there.
        let rate = (2.0 * v / self.gap).clamp(-0.3 / at.step, 0.3 / at.step);
        let end = if rate * own[0] > 0.0 {
            1.0 - own[0].powi(SHARP)
        } else {
            1.0
        };
        rates[0] = rate * end;
    }

    fn sense(&self, _at: &Moment<'_>, own: &[f64], outputs: &mut Pair) {
        outputs[self.channel] -= 0.5 * self.gap * own[0];
    }
}
