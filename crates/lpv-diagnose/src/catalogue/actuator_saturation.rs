//! Force that grows less than proportionally.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Place, Scale};
use crate::track::Track;

pub(super) static EFFECTS: [Effect; 4] = [
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    clipped(Place::Motor(0)),
    clipped(Place::Motor(1)),
];

const NAME: &str = "actuator-saturation";

const fn at(place: Place) -> Effect {
    Effect {
        name: NAME,
        family: Family::Actuator,
        place,
        needs: Needs::of(place),
        meaning: "force that grows less than proportionally with the command",
        parameters: &[EffectParameter {
            name: "softness",
            unit: "1/u^2",
            scale: Scale::NotNegative,
        }],
        extends: None,
        starts: &|_, _| vec![vec![0.0]],
        on_response: None,
        block: &|v, machine, place| {
            Box::new(Saturation {
                root: v[0].sqrt(),
                unit: super::motor_forces(machine, place.first(), 1.0),
            })
        },
    }
}

/// The same of a drive that follows its command up to a limit.
const fn clipped(place: Place) -> Effect {
    Effect {
        meaning: "force that follows the command up to a limit",
        parameters: &[EffectParameter {
            name: "limit",
            unit: "u",
            scale: Scale::Positive,
        }],
        extends: Some(Extends {
            name: NAME,
            starts: |v, screen, place| {
                let soft = 1.0 / v[0].sqrt();
                let near = [0.7, 1.0, 1.4].map(|times| times * soft);
                let largest = screen.input_sizes(place.first()).last().copied().unwrap_or(0.0);
                near.into_iter()
                    .filter(|limit| *limit < largest)
                    .map(|limit| vec![limit])
                    .collect()
            },
        }),
        starts: &|screen, place| {
            /// Parts of the largest command, and of the commands that are smaller.
            const PARTS: [f64; 3] = [0.98, 0.8, 0.5];
            const SMALLER: [f64; 4] = [0.98, 0.9, 0.75, 0.6];
            let sizes = screen.input_sizes(place.first());
            let Some(largest) = sizes.last().filter(|largest| **largest > 0.0) else {
                return Vec::new();
            };
            let smaller = SMALLER.map(|part| sizes[(part * sizes.len() as f64) as usize]);
            let limits = PARTS.map(|part| part * largest).into_iter().chain(smaller);
            limits
                .filter(|limit| *limit > 0.0)
                .map(|limit| vec![limit])
                .collect()
        },
        block: &|v, machine, place| {
            Box::new(Limit(
                super::motor_forces(machine, place.first(), v[0]).map(f64::abs),
            ))
        },
        ..at(place)
    }
}

/// Whether commands are seldom beyond the limit of a form: most are what the drive gives, or the records tell of no drive.
pub(super) fn is_seldom(effect: &Effect, value: f64, tracks: &[Track]) -> bool {
    /// Part of the samples.
    const MOST: f64 = 0.5;
    let is_limit = effect.parameters.iter().any(|p| p.name == "limit");
    let limit = if is_limit {
        value
    } else {
        1.0 / value.max(0.0).sqrt()
    };
    let commands = || {
        tracks
            .iter()
            .flat_map(|t| &t.inputs)
            .map(|u| u[effect.place.first()].abs())
    };
    let beyond = commands().filter(|u| *u > limit).count();
    beyond as f64 <= MOST * commands().count() as f64
}

/// `min(|F|, F_max) sign F`; motors of zero are not those of the input. What an observer gives is no command and passes beside it.
#[derive(Debug)]
struct Limit(Pair);

impl Block for Limit {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let commands = match at.track.follows {
            true => at.machine.commanded(at.p, at.track.inputs[at.sample]),
            false => forces.motors,
        };
        for i in at.motors() {
            let limit = self.0[i];
            if limit > 0.0 {
                forces.motors[i] += commands[i].clamp(-limit, limit) - commands[i];
            }
        }
    }
}

/// `F_max tanh(F / F_max)` with `softness = 1 / F_max^2`.
#[derive(Debug)]
struct Saturation {
    root: f64,
    unit: Pair,
}

impl Block for Saturation {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            let part = self.root / self.unit[i];
            if part > 0.0 && part.is_finite() {
                forces.motors[i] = (part * forces.motors[i]).tanh() / part;
            }
        }
    }
}
