//! A mass on a guide with one motor, free or held by a spring to ground.

use super::{BaseParameter, Body, Forces, Motion, Pair, Start};
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex64 as C64;

/// `M q'' + F_v q' + k q + offset = force`, k zero unless a spring holds the mass; the input the force of the motor, the output its position.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(super) mass: f64,
    viscous: f64,
    offset: f64,
    /// Of the spring to ground, if there is one.
    stiffness: Option<f64>,
    /// Whether responses are fitted, which do not know the offset.
    linear: bool,
}

impl Axis {
    /// Mass, viscous friction, and the force that the motor needs at rest.
    pub fn new(mass: f64, viscous: f64, offset: f64) -> Self {
        Self {
            mass,
            viscous,
            offset,
            stiffness: None,
            linear: false,
        }
    }

    /// The same on a spring to ground.
    #[must_use]
    pub fn on_spring(self, stiffness: f64) -> Self {
        Self {
            stiffness: Some(stiffness),
            ..self
        }
    }

    /// Stiffness of the spring to ground; none for a free axis.
    pub fn stiffness(&self) -> Option<f64> {
        self.stiffness
    }

    /// The same for frequency responses, which do not know the offset.
    #[must_use]
    pub fn linear(self) -> Self {
        Self {
            offset: 0.0,
            linear: true,
            ..self
        }
    }

    /// Mass.
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Force over motion at the complex frequency s.
    pub(crate) fn dynamic(&self, s: C64) -> C64 {
        s * (s * self.mass + self.viscous) + self.stiffness.unwrap_or(0.0)
    }

    pub(super) fn frozen(&self) -> [DMatrix<f64>; 3] {
        [
            dmatrix![0.0, 1.0; -self.stiffness.unwrap_or(0.0) / self.mass, -self.viscous / self.mass],
            dmatrix![0.0; 1.0 / self.mass],
            dmatrix![1.0, 0.0],
        ]
    }

    pub(super) fn parameters(&self) -> Vec<BaseParameter> {
        let parameter = |name, unit, value, positive| BaseParameter {
            name,
            unit,
            value,
            positive,
            held: false,
        };
        let offset = BaseParameter {
            held: self.linear,
            ..parameter("offset", "u", self.offset, false)
        };
        let spring = self.stiffness.map(|k| parameter("stiffness", "u/y", k, true));
        [
            parameter("mass", "u s^2/y", self.mass, true),
            parameter("viscous friction", "u s/y", self.viscous, false),
            offset,
        ]
        .into_iter()
        .chain(spring)
        .collect()
    }

    pub(super) fn set(&mut self, v: &[f64]) {
        self.mass = v[0];
        self.viscous = v[1];
        self.offset = v[2];
        if let Some(stiffness) = &mut self.stiffness {
            *stiffness = v[3];
        }
    }
}

impl Body for Axis {
    fn begin(&self, _p: f64, start: &Start, x: &mut [f64]) {
        x[..2].copy_from_slice(&[start.position[0], start.speed[0]]);
    }

    fn commanded(&self, _p: f64, u: Pair) -> Pair {
        u
    }

    fn motion(&self, x: &[f64], _p: f64) -> Motion {
        Motion {
            motor_position: [x[0], 0.0],
            motor_speed: [x[1], 0.0],
            load_position: [x[0], 0.0],
            load_speed: [x[1], 0.0],
            deflection: [0.0; 2],
        }
    }

    fn rates(&self, x: &[f64], _p: f64, forces: &Forces, rates: &mut [f64]) {
        rates[0] = x[1];
        let spring = self.stiffness.unwrap_or(0.0) * x[0];
        rates[1] =
            (forces.motors[0] + forces.load[0] - self.viscous * x[1] - spring - self.offset) / self.mass;
    }

    fn outputs(&self, x: &[f64], _p: f64) -> Pair {
        [x[0], 0.0]
    }
}
