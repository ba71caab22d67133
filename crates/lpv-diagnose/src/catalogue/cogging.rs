//! Force periodic in the position of a motor.

use super::parameter;
use crate::base::{Forces, Pair};
use crate::effect::{Block, Effect, EffectParameter, Extends, Family, Moment, Needs, Place, Scale};
use crate::screen::{Screen, Trial};
use std::f64::consts::TAU;

/// Motors that are coupled share the pitch.
pub(super) static EFFECTS: [Effect; 5] = [
    Effect {
        needs: Needs::CoupledMotors,
        meaning: "force periodic in the position of each motor",
        parameters: &[
            parameter("left_sine", "u", Scale::Linear),
            parameter("left_cosine", "u", Scale::Linear),
            parameter("right_sine", "u", Scale::Linear),
            parameter("right_cosine", "u", Scale::Linear),
            PITCH,
        ],
        starts: &|screen, _| waves(screen, 0, &[0, 1]),
        on_response: None,
        block: &|v, machine, _| {
            let unit = super::motor_forces(machine, 0, 1.0);
            Box::new(Cogging {
                sine: [unit[0] * v[0], unit[1] * v[2]],
                cosine: [unit[0] * v[1], unit[1] * v[3]],
                turn: TAU / v[4],
            })
        },
        ..at(Place::Motor(0))
    },
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    two_waves(Place::Motor(0)),
    two_waves(Place::Motor(1)),
];

const NAME: &str = "cogging";

const PITCH: EffectParameter = parameter("pitch", "y", Scale::Wavelength);
const PITCH_2: EffectParameter = parameter("pitch_2", "y", Scale::Wavelength);

const fn at(place: Place) -> Effect {
    Effect {
        name: NAME,
        family: Family::PositionForce,
        place,
        needs: Needs::OwnMotor(place.first()),
        meaning: "force periodic in the position of the motor",
        parameters: const {
            &[
                parameter("sine", "u", Scale::Linear),
                parameter("cosine", "u", Scale::Linear),
                PITCH,
            ]
        },
        extends: None,
        starts: &|screen, place| waves(screen, place.first(), &[place.first()]),
        on_response: None,
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Cogging {
                sine: unit.map(|u| u * v[0]),
                cosine: unit.map(|u| u * v[1]),
                turn: TAU / v[2],
            })
        },
    }
}

/// Two of them, orders of one pitch or each with its own: magnets and slots, poles and the turn.
const fn two_waves(place: Place) -> Effect {
    Effect {
        meaning: "force of two periods in the position of the motor",
        parameters: const {
            &[
                parameter("sine", "u", Scale::Linear),
                parameter("cosine", "u", Scale::Linear),
                parameter("sine_2", "u", Scale::Linear),
                parameter("cosine_2", "u", Scale::Linear),
                PITCH,
                PITCH_2,
            ]
        },
        extends: Some(Extends {
            name: NAME,
            starts: second_waves,
        }),
        starts: &|_, _| Vec::new(),
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            let wave = |sine: f64, cosine: f64, pitch: f64| Cogging {
                sine: unit.map(|u| u * sine),
                cosine: unit.map(|u| u * cosine),
                turn: TAU / pitch,
            };
            Box::new(TwoWaves([wave(v[0], v[1], v[4]), wave(v[2], v[3], v[5])]))
        },
        ..at(place)
    }
}

/// Beside a wave: its orders, waves of which it is an order, and what else is seen in what the machine leaves without it. Without an amplitude the
/// second pitch has no slope, and what a start promises is what that pitch does and no other.
fn second_waves(v: &[f64], screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    /// The highest order.
    const ORDERS: u32 = 6;
    let &[sine, cosine, pitch] = v else {
        return Vec::new();
    };
    let orders = (2..=ORDERS).flat_map(|n| [pitch / f64::from(n), pitch * f64::from(n)]);
    let halves = [1.5, 2.0 / 3.0].map(|part| part * pitch);
    let seen = waves(screen, place.first(), &[place.first()]);
    let seen = seen.into_iter().filter_map(|v| v.last().copied());
    orders
        .chain(halves)
        .chain(seen)
        .map(|second| vec![sine, cosine, 0.0, 0.0, pitch, second])
        .collect()
}

/// Parameters of two waves.
pub(super) const TWO_WAVES: usize = 6;

/// Whether a travel tells two waves apart: they differ by a quarter of a period along it, and the smaller is one beside the larger.
pub(super) fn are_apart(v: &[f64], travel: f64) -> bool {
    const PERIODS: f64 = 0.25;
    const PART: f64 = 1e-3;
    let &[sine, cosine, sine_2, cosine_2, pitch, pitch_2] = v else {
        return false;
    };
    let (one, two) = (sine.hypot(cosine), sine_2.hypot(cosine_2));
    (travel / pitch - travel / pitch_2).abs() >= PERIODS && one.min(two) >= PART * one.max(two)
}

/// Sines and cosines of these motors, then the pitch.
fn waves(screen: &Screen<'_>, channel: usize, motors: &[usize]) -> Vec<Vec<f64>> {
    // What passes within a sample is not seen.
    let step = screen.step();
    let range = (screen.travel(channel), screen.top_speed(channel) * step);
    let force = super::motor_forces(screen.base, channel, 1.0);
    let found = super::pitches(screen, range, |pitch| {
        let turn = TAU / pitch;
        let both = |motor: &usize| {
            let waves = screen.waves(|_, _, m| {
                // Mean over the sample that follows.
                let half = 0.5 * turn * step * m.motor_speed[*motor];
                let mean = if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
                let mut gains = [0.0; 2];
                gains[*motor] = force[*motor] * mean;
                (turn * m.motor_position[*motor] + half, gains)
            });
            waves.map(Trial::Motors)
        };
        motors.iter().flat_map(both).collect()
    });
    let start = |(pitch, mut v): (f64, Vec<f64>)| {
        v.push(pitch);
        v
    };
    found.into_iter().map(start).collect()
}

#[derive(Debug)]
struct Cogging {
    sine: Pair,
    cosine: Pair,
    turn: f64,
}

#[derive(Debug)]
struct TwoWaves([Cogging; 2]);

impl Block for TwoWaves {
    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        self.0.iter().for_each(|wave| wave.act(at, own, rates, forces));
    }
}

impl Block for Cogging {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            let (s, c) = (self.turn * at.motion.motor_position[i]).sin_cos();
            forces.motors[i] += self.sine[i] * s + self.cosine[i] * c;
        }
    }
}
