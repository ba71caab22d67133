//! Play between a motor and the sensor of what it moves, or between a motor and its load.

use super::parameter;
use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [BEFORE_A_SENSOR, IN_A_COUPLING];

/// At the first sensor, which tells the motor of an axis.
const BEFORE_A_SENSOR: Effect = Effect {
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

/// In the coupling of a motor and a load that swings on it.
const IN_A_COUPLING: Effect = Effect {
    place: Place::Motor(0),
    needs: Needs::Load,
    meaning: "play between a motor and its load: the spring between them pulls beyond it alone",
    starts: &|screen, _| {
        /// Gaps over the deflection.
        const PARTS: [f64; 3] = [0.1, 0.6, 3.0];
        let deflection = screen.deflection(0);
        let of = |part: f64| vec![part * deflection];
        PARTS.into_iter().map(of).filter(|_| deflection > 0.0).collect()
    },
    block: &|v, machine, _| {
        let [stiffness, damping] = machine.spring_of_load();
        Box::new(Loose {
            half: 0.5 * v[0],
            stiffness,
            damping,
        })
    },
    ..BEFORE_A_SENSOR
};

/// `k (e - gap / 2) + d e'` beyond a deflection e of half the gap, where motor and load press on each other, as on the other side; nothing within.
#[derive(Debug)]
struct Loose {
    half: f64,
    stiffness: f64,
    damping: f64,
}

impl Block for Loose {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let deflection = at.motion.deflection[0];
        let damped = self.damping * (at.motion.motor_speed[0] - at.motion.load_speed[0]);
        // A fit may ask about less than no play.
        let beyond = deflection - deflection.signum() * deflection.abs().min(self.half);
        let pull = self.stiffness * beyond + damped;
        let pressed = if beyond > 0.0 {
            pull.max(0.0)
        } else if beyond < 0.0 {
            pull.min(0.0)
        } else {
            0.0
        };
        forces.coupling[0] += pressed - (self.stiffness * deflection + damped);
    }
}

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
