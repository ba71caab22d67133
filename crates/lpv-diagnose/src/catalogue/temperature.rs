//! What changes with a measured temperature: a force, friction, the force constant, a spring, what a sensor tells.

use super::parameter;
use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Place, Scale};
use crate::screen::Screen;

/// One form for each thing that may change; the machine's own parameters are those at `reference`.
pub(super) static EFFECTS: [Effect; 7] = [
    FORCE,
    VISCOUS,
    DRY,
    GAIN,
    STIFFNESS,
    reading(Place::Output(0)),
    reading(Place::Output(1)),
];

/// Number of the further signal, from one.
const SIGNAL: EffectParameter = parameter("signal", "", Scale::Chosen);
/// Its mean over the fitted records.
const REFERENCE: EffectParameter = parameter("reference", "degree", Scale::Chosen);

/// Of a guide that its bolts bend, of a hose that stiffens.
const FORCE: Effect = Effect {
    family: Family::Disturbance,
    meaning: "force that changes with a measured temperature",
    parameters: const {
        &[
            parameter("force_per_degree", "u/degree", Scale::Linear),
            SIGNAL,
            REFERENCE,
        ]
    },
    block: &|v, machine, place| {
        let force = super::motor_forces(machine, place.first(), v[0])[0];
        made(Part::Force(force), place, &v[1..])
    },
    ..VISCOUS
};

const VISCOUS: Effect = Effect {
    name: "temperature",
    family: Family::Friction,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "viscous friction that changes with a measured temperature",
    parameters: const {
        &[
            parameter("viscous_per_degree", "u s/y/degree", Scale::Linear),
            SIGNAL,
            REFERENCE,
        ]
    },
    extends: None,
    starts: &|screen, _| with(screen, &[0.0]),
    on_response: None,
    block: &|v, _, place| made(Part::Viscous(v[0]), place, &v[1..]),
};

const DRY: Effect = Effect {
    meaning: "Coulomb friction that changes with a measured temperature",
    parameters: const {
        &[
            parameter("level", "u", Scale::NotNegative),
            parameter("level_per_degree", "u/degree", Scale::Linear),
            parameter("creep_speed", "y/s", Scale::Logarithmic),
            SIGNAL,
            REFERENCE,
        ]
    },
    extends: Some(Extends {
        name: "coulomb-friction",
        starts: |v, screen, _| with(screen, &[v[0], 0.0, v[1]]),
    }),
    starts: &|_, _| Vec::new(),
    block: &|v, machine, place| {
        let force = |input| super::motor_forces(machine, place.first(), input)[0];
        let part = Part::Dry {
            level: force(v[0]),
            change: force(v[1]),
            creep: v[2],
        };
        made(part, place, &v[3..])
    },
    ..VISCOUS
};

const GAIN: Effect = Effect {
    family: Family::Actuator,
    meaning: "force constant that changes with a measured temperature",
    parameters: const {
        &[
            parameter("gain_per_degree", "1/degree", Scale::Linear),
            SIGNAL,
            REFERENCE,
        ]
    },
    block: &|v, _, place| made(Part::Gain(v[0]), place, &v[1..]),
    ..VISCOUS
};

const STIFFNESS: Effect = Effect {
    family: Family::Structure,
    needs: Needs::Spring,
    meaning: "stiffness of the spring to ground that changes with a measured temperature",
    parameters: const {
        &[
            parameter("stiffness_per_degree", "u/y/degree", Scale::Linear),
            SIGNAL,
            REFERENCE,
        ]
    },
    block: &|v, _, place| made(Part::Stiffness(v[0]), place, &v[1..]),
    ..VISCOUS
};

const fn reading(place: Place) -> Effect {
    Effect {
        family: Family::Sensor,
        place,
        needs: Needs::of(place),
        meaning: "what a sensor tells that changes with a measured temperature",
        parameters: const {
            &[
                parameter("reading_per_degree", "y/degree", Scale::Linear),
                SIGNAL,
                REFERENCE,
            ]
        },
        block: &|v, _, place| made(Part::Reading(v[0]), place, &v[1..]),
        ..VISCOUS
    }
}

/// These values with each temperature that changes, and its mean.
fn with(screen: &Screen<'_>, values: &[f64]) -> Vec<Vec<f64>> {
    let all = screen.temperatures().into_iter();
    all.map(|(signal, mean)| [values, &[(signal + 1) as f64, mean]].concat())
        .collect()
}

fn made(part: Part, place: Place, signal: &[f64]) -> Box<dyn Block> {
    Box::new(Warm {
        part,
        channel: place.first(),
        // A number of a signal, from one.
        signal: (signal[0] as usize).saturating_sub(1),
        reference: signal[1],
    })
}

/// What changes, per degree.
#[derive(Debug)]
enum Part {
    Force(f64),
    Viscous(f64),
    Dry { level: f64, change: f64, creep: f64 },
    Gain(f64),
    Stiffness(f64),
    Reading(f64),
}

#[derive(Debug)]
struct Warm {
    part: Part,
    channel: usize,
    signal: usize,
    reference: f64,
}

impl Warm {
    fn degrees(&self, at: &Moment<'_>) -> f64 {
        at.auxiliary(self.signal) - self.reference
    }
}

impl Block for Warm {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let speed = at.motion.motor_speed[0];
        match self.part {
            Part::Force(k) => forces.motors[0] += k * self.degrees(at),
            Part::Viscous(c) => forces.motors[0] -= c * self.degrees(at) * speed,
            Part::Dry { level, change, creep } => {
                let level = (level + change * self.degrees(at)).max(0.0);
                super::rub(0, level, (speed, creep), forces);
            }
            Part::Gain(k) => forces.motors[0] *= 1.0 + k * self.degrees(at),
            Part::Stiffness(k) => {
                forces.motors[0] -= k * self.degrees(at) * at.motion.motor_position[0];
            }
            Part::Reading(_) => {}
        }
    }

    fn sense(&self, at: &Moment<'_>, _own: &[f64], outputs: &mut Pair) {
        if let Part::Reading(a) = self.part {
            outputs[self.channel] += a * self.degrees(at);
        }
    }
}
