//! Force that changes smoothly with where a motor is: gravity over less than a turn, an arm that moves, a magnet beside the guide.

use super::parameter;
use crate::base::{Base, Forces, Pair};
use crate::effect::{Block, Effect, Extends, Family, Moment, Needs, Place, Scale};
use crate::screen::Screen;
use std::f64::consts::PI;

pub(super) static EFFECTS: [Effect; 6] = [
    at(Place::Motor(0)),
    at(Place::Motor(1)),
    straight(Place::Motor(0)),
    straight(Place::Motor(1)),
    of_any_shape(Place::Motor(0)),
    of_any_shape(Place::Motor(1)),
];

/// Whether it is the straight form.
pub(super) fn is_straight(effect: &Effect) -> bool {
    EFFECTS[2..4].iter().any(|e| e.is(effect))
}

const NAME: &str = "position-force";

const fn at(place: Place) -> Effect {
    Effect {
        name: NAME,
        family: Family::PositionForce,
        place,
        needs: Needs::FreeMotor(place.first()),
        meaning: "force that changes smoothly with the position of the motor",
        parameters: const {
            &[
                parameter("slope", "u/y", Scale::Linear),
                parameter("square", "u/y^2", Scale::Linear),
                parameter("cube", "u/y^3", Scale::Linear),
            ]
        },
        extends: Some(Extends {
            name: NAME,
            starts: |v, _, _| vec![vec![v[0], 0.0, 0.0]],
        }),
        starts: &starts,
        on_response: None,
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Smooth {
                unit,
                powers: [v[0], v[1], v[2]],
            })
        },
    }
}

/// The same along a straight line, which is all that some records tell: a curve of them leads astray beyond.
const fn straight(place: Place) -> Effect {
    Effect {
        parameters: const { &[parameter("slope", "u/y", Scale::Linear)] },
        extends: None,
        starts: &|screen, place| match starts(screen, place).is_empty() {
            true => Vec::new(),
            false => vec![vec![0.0]],
        },
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Smooth {
                unit,
                powers: [v[0], 0.0, 0.0],
            })
        },
        ..at(place)
    }
}

/// The same of any smooth shape: Chebyshev polynomials over the stroke, as far as a cubic does not tell it.
const fn of_any_shape(place: Place) -> Effect {
    Effect {
        meaning: "force of any smooth shape along the stroke of the motor",
        parameters: const {
            &[
                parameter("from", "y", Scale::Chosen),
                parameter("to", "y", Scale::Chosen),
                parameter("chebyshev_1", "u", Scale::Linear),
                parameter("chebyshev_2", "u", Scale::Linear),
                parameter("chebyshev_3", "u", Scale::Linear),
                parameter("chebyshev_4", "u", Scale::Linear),
                parameter("chebyshev_5", "u", Scale::Linear),
                parameter("chebyshev_6", "u", Scale::Linear),
                parameter("chebyshev_7", "u", Scale::Linear),
                parameter("chebyshev_8", "u", Scale::Linear),
                parameter("chebyshev_9", "u", Scale::Linear),
                parameter("chebyshev_10", "u", Scale::Linear),
                parameter("chebyshev_11", "u", Scale::Linear),
                parameter("chebyshev_12", "u", Scale::Linear),
                parameter("chebyshev_13", "u", Scale::Linear),
                parameter("chebyshev_14", "u", Scale::Linear),
                parameter("chebyshev_15", "u", Scale::Linear),
                parameter("chebyshev_16", "u", Scale::Linear),
            ]
        },
        extends: Some(Extends {
            name: NAME,
            starts: shapes,
        }),
        starts: &|_, _| Vec::new(),
        block: &|v, machine, place| {
            let unit = super::motor_forces(machine, place.first(), 1.0);
            Box::new(Shape {
                unit,
                stroke: [v[0], v[1]],
                weights: v[2..].to_vec(),
            })
        },
        ..at(place)
    }
}

/// Polynomials of a shape, without the constant, which a base has of its own.
const POLYNOMIALS: usize = 16;

/// What a polynomial of the position is over the stroke of the fitted records.
fn shapes(v: &[f64], screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    let places = screen.motions.iter().flatten();
    let places = places.map(|m| m.motor_position[place.first()]);
    let (from, to) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| {
        (a.min(y), b.max(y))
    });
    if from >= to {
        return Vec::new();
    }
    let force = |y: f64| v.iter().rev().fold(0.0, |sum, c| y * (c + sum));
    vec![[from, to].into_iter().chain(weights(force, [from, to])).collect()]
}

/// Weights of the polynomials of a function over a stroke, from its values at their zeros.
fn weights(force: impl Fn(f64) -> f64, [from, to]: [f64; 2]) -> Vec<f64> {
    let angles = (0..=POLYNOMIALS).map(|i| PI * (i as f64 + 0.5) / (POLYNOMIALS + 1) as f64);
    let samples: Vec<(f64, f64)> = angles
        .map(|angle| (angle, force(0.5 * (from + to) + 0.5 * (to - from) * angle.cos())))
        .collect();
    let weight = |n: usize| {
        let sum: f64 = samples
            .iter()
            .map(|(angle, f)| f * (n as f64 * angle).cos())
            .sum();
        2.0 * sum / samples.len() as f64
    };
    (1..=POLYNOMIALS).map(weight).collect()
}

/// Where an observer holds an axis at its records, and these show more of the curve than a straight line.
fn starts(screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    /// Travels from zero within which powers of the position are told apart.
    const FAR: f64 = 10.0;
    let motor = place.first();
    let is_near = screen.farthest(motor) <= FAR * screen.travel(motor);
    let is_held = screen.tracks.iter().all(|t| t.follows);
    match matches!(screen.base, Base::Axis(_)) && is_held && is_near {
        true => vec![vec![0.0; 3]],
        false => Vec::new(),
    }
}

/// What a polynomial of the position without its constant, which a base has of its own, takes from the force of the motor.
#[derive(Debug)]
struct Smooth {
    unit: Pair,
    powers: [f64; 3],
}

impl Block for Smooth {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let [slope, square, cube] = self.powers;
        for i in at.motors() {
            let y = at.motion.motor_position[i];
            forces.motors[i] -= self.unit[i] * y * (slope + y * (square + y * cube));
        }
    }
}

/// What Chebyshev polynomials over a stroke take from the force of the motor; beyond, the force at its end.
#[derive(Debug)]
struct Shape {
    unit: Pair,
    stroke: [f64; 2],
    weights: Vec<f64>,
}

impl Shape {
    fn force(&self, y: f64) -> f64 {
        let [from, to] = self.stroke;
        let x = ((2.0 * y - from - to) / (to - from)).clamp(-1.0, 1.0);
        // Clenshaw's recurrence, without the constant.
        let (mut next, mut after) = (0.0, 0.0);
        for weight in self.weights.iter().rev() {
            (next, after) = (weight + 2.0 * x * next - after, next);
        }
        x * next - after
    }
}

impl Block for Shape {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for i in at.motors() {
            forces.motors[i] -= self.unit[i] * self.force(at.motion.motor_position[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Shape, weights};

    #[test]
    fn a_cubic_over_a_stroke_is_itself_but_for_a_constant() {
        let cubic = |y: f64| y * (3.0 + y * (-2.0 + y * 0.7));
        let stroke = [-0.4, 1.9];
        let shape = Shape {
            unit: [1.0, 0.0],
            stroke,
            weights: weights(cubic, stroke),
        };
        let gap = |y: f64| shape.force(y) - cubic(y);
        for y in [-0.4, -0.1, 0.3, 1.2, 1.9] {
            assert!((gap(y) - gap(0.0)).abs() < 1e-12, "{y}");
        }
        // Beyond the stroke it stays.
        assert!((shape.force(5.0) - shape.force(1.9)).abs() < 1e-12);
    }
}
