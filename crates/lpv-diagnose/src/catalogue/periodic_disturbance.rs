//! Force at a fixed frequency in time.

use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};
use crate::screen::Trial;
use std::f64::consts::TAU;

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Motor(0)), at(Place::Motor(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "periodic-disturbance",
        family: Family::Disturbance,
        place,
        needs: Needs::of(place),
        meaning: "force at a fixed frequency in time, counted from the start of a record",
        parameters: &[
            EffectParameter {
                name: "sine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "cosine",
                unit: "u",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "frequency",
                unit: "Hz",
                scale: Scale::Frequency,
            },
        ],
        extends: None,
        starts: &|screen, place| {
            let unit = super::motor_forces(screen.base, place.first(), 1.0);
            let width = 0.25 / screen.duration();
            let mut found = Vec::new();
            for peak in screen.peaks(2) {
                // A line may lie between those of the spectrum.
                let at = |i: usize| peak + (i as f64 - 4.0) * width;
                let trials = |i: usize| {
                    let waves = screen.waves(|track, k, _| (TAU * at(i) * k as f64 * track.step, unit));
                    waves.map(Trial::Motors).into()
                };
                let best = screen.best(9, trials).into_iter().next();
                found.extend(
                    best.filter(|(i, _)| at(*i) > 0.0)
                        .map(|(i, v)| vec![v[0], v[1], at(i)]),
                );
            }
            found
        },
        on_response: None,
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Periodic {
                sine: unit.map(|f| f * v[0]),
                cosine: unit.map(|f| f * v[1]),
                rate: TAU * v[2],
            })
        },
    }
}

#[derive(Debug)]
struct Periodic {
    sine: Pair,
    cosine: Pair,
    rate: f64,
}

impl Block for Periodic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let (s, c) = (self.rate * at.time).sin_cos();
        for i in at.motors() {
            forces.motors[i] += self.sine[i] * s + self.cosine[i] * c;
        }
    }
}
