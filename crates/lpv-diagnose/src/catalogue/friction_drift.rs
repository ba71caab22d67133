//! Coulomb friction that changes along a record, as that of a guide or a gear that warms up.

use super::parameter;
use crate::base::Forces;
use crate::effect::{Block, Effect, Extends, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "friction-drift",
    family: Family::Friction,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "friction of the guides that changes from the start of a record on",
    parameters: const {
        &[
            parameter("level", "u", Scale::NotNegative),
            parameter("change", "u", Scale::Linear),
            parameter("creep_speed", "y/s", Scale::Logarithmic),
            parameter("time_constant", "s", Scale::Duration),
        ]
    },
    extends: Some(Extends {
        name: "coulomb-friction",
        // What was fitted is a mean: friction may begin above it and fall, or below it and grow.
        starts: |v, screen, _| {
            let times = [0.1, 0.4, 2.0].map(|part| part * screen.duration());
            let of = |time: f64| {
                [(1.0, 0.0), (1.5, -0.8), (0.4, 1.2)]
                    .map(|(level, change)| vec![level * v[0], change * v[0], v[1], time])
            };
            times.into_iter().flat_map(of).collect()
        },
    }),
    starts: &|_, _| Vec::new(),
    on_response: None,
    block: &|v, machine, place| {
        let force = |input| super::motor_forces(machine, place.first(), input)[0];
        Box::new(Drifting {
            level: force(v[0]),
            change: force(v[1]),
            creep: v[2],
            rate: v[3].recip(),
        })
    },
};

/// `-(F + dF (1 - exp(-t / T))) tanh(v / creep)`, no less than nothing.
#[derive(Debug)]
struct Drifting {
    level: f64,
    change: f64,
    creep: f64,
    rate: f64,
}

impl Block for Drifting {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let level = (self.level - self.change * (-at.time * self.rate).exp_m1()).max(0.0);
        super::rub(0, level, (at.motion.motor_speed[0], self.creep), forces);
    }
}
