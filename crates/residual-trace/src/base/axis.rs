//! A mass on a guide with one motor.

use super::{BaseParameter, Body, Forces, Motion, Pair, Start};
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex64 as C64;

/// `M q'' + F_v q' + offset = force`, the input the force of the motor, the output its position.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    pub(super) mass: f64,
    viscous: f64,
    offset: f64,
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
            linear: false,
        }
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

    pub(crate) fn mass(&self) -> f64 {
        self.mass
    }

    /// Force over motion at the complex frequency s.
    pub(crate) fn dynamic(&self, s: C64) -> C64 {
        s * (s * self.mass + self.viscous)
    }

    pub(super) fn frozen(&self) -> [DMatrix<f64>; 3] {
        [
            dmatrix![0.0, 1.0; 0.0, -self.viscous / self.mass],
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
        vec![
            parameter("mass", "u s^2/y", self.mass, true),
            parameter("viscous friction", "u s/y", self.viscous, false),
            offset,
        ]
    }

    pub(super) fn set(&mut self, v: &[f64]) {
        self.mass = v[0];
        self.viscous = v[1];
        self.offset = v[2];
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
        rates[1] = (forces.motors[0] + forces.load[0] - self.viscous * x[1] - self.offset) / self.mass;
    }

    fn outputs(&self, x: &[f64], _p: f64) -> Pair {
        [x[0], 0.0]
    }
}
