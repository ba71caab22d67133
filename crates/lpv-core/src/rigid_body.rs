//! Axes that move as one mass each.

use crate::{Continuous, CoreError, StateSpace};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// One axis: `J q'' + F_v q' + o = u`, with the deviations of its parameters.
///
/// Units follow from those of the position q and of the force u: J in `u s^2 / q`, F_v in `u s / q`, o in `u`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigidBodyAxis {
    /// Inertia J.
    pub inertia: f64,
    /// Coefficient of viscous friction F_v.
    pub viscous: f64,
    /// Constant force o that the input must balance.
    pub offset: f64,
    /// Standard deviation of the inertia.
    pub inertia_deviation: f64,
    /// Standard deviation of the viscous coefficient.
    pub viscous_deviation: f64,
    /// Standard deviation of the offset.
    pub offset_deviation: f64,
    /// What its output is.
    #[serde(default, skip_serializing_if = "AxisOutput::is_position")]
    pub output: AxisOutput,
}

/// What the output of an axis is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AxisOutput {
    /// Its position q.
    #[default]
    Position,
    /// Its speed q'.
    Speed,
}

impl AxisOutput {
    /// Whether it is the position.
    #[must_use]
    pub fn is_position(&self) -> bool {
        *self == Self::Position
    }
}

impl RigidBodyAxis {
    /// `J q'' + F_v q' + o`: the force of the axis at a velocity and an acceleration.
    #[must_use]
    pub fn force(&self, velocity: f64, acceleration: f64) -> f64 {
        self.inertia * acceleration + self.viscous * velocity + self.offset
    }
}

/// Axes without coupling: input i drives axis i, and output i is its position or its speed.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidBody {
    axes: Vec<RigidBodyAxis>,
}

impl RigidBody {
    /// Checks and keeps the axes.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`] (row: axis, column: parameter in the order of the fields) for a number that is not
    /// finite; [`CoreError::Singular`] for an inertia that is not above zero.
    pub fn new(axes: Vec<RigidBodyAxis>) -> Result<Self, CoreError> {
        for (row, a) in axes.iter().enumerate() {
            let numbers = [
                a.inertia,
                a.viscous,
                a.offset,
                a.inertia_deviation,
                a.viscous_deviation,
                a.offset_deviation,
            ];
            if let Some(column) = numbers.iter().position(|v| !v.is_finite()) {
                let what = "rigid body: parameters";
                return Err(CoreError::NotFinite { what, row, column });
            }
            if a.inertia <= 0.0 {
                return Err(CoreError::Singular {
                    operation: "a rigid body whose inertia is not above zero",
                });
            }
        }
        Ok(Self { axes })
    }

    /// The axes.
    pub fn axes(&self) -> &[RigidBodyAxis] {
        &self.axes
    }

    /// States `q_1, q_1', q_2, q_2', ...`, outputs `q_i`; of an axis whose output is its speed, the only state `q_i'`. The inputs are `u_i - o_i`: offsets are not part of a linear
    /// system, subtract them from the forces.
    ///
    /// # Errors
    /// [`CoreError::NotFinite`] if a quotient overflows.
    pub fn to_state_space(&self) -> Result<StateSpace<Continuous>, CoreError> {
        let n = self.axes.len();
        let own = |axis: &RigidBodyAxis| 1 + usize::from(axis.output.is_position());
        let states = self.axes.iter().map(own).sum();
        let mut a = DMatrix::zeros(states, states);
        let mut b = DMatrix::zeros(states, n);
        let mut c = DMatrix::zeros(n, states);
        let mut first = 0;
        for (i, axis) in self.axes.iter().enumerate() {
            let speed = first + own(axis) - 1;
            if axis.output.is_position() {
                a[(first, speed)] = 1.0;
            }
            a[(speed, speed)] = -axis.viscous / axis.inertia;
            b[(speed, i)] = 1.0 / axis.inertia;
            c[(i, first)] = 1.0;
            first = speed + 1;
        }
        StateSpace::new(a, b, c, DMatrix::zeros(n, n), Continuous)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;

    fn axis(inertia: f64) -> RigidBodyAxis {
        RigidBodyAxis {
            inertia,
            viscous: 2.0,
            offset: -3.0,
            inertia_deviation: 0.1,
            viscous_deviation: 0.2,
            offset_deviation: 0.3,
            output: AxisOutput::Position,
        }
    }

    #[test]
    fn response_by_hand() {
        let fast = RigidBodyAxis {
            output: AxisOutput::Speed,
            ..axis(1.5)
        };
        let body = RigidBody::new(vec![axis(4.0), fast, axis(0.5)]).unwrap();
        let frequency_hz = 0.7;
        let s = num_complex::Complex::new(0.0, std::f64::consts::TAU * frequency_hz);
        let response = body.to_state_space().unwrap();
        let response = response.frequency_response(&[frequency_hz]).unwrap();
        for (i, inertia) in [4.0, 1.5, 0.5].into_iter().enumerate() {
            let times = if i == 1 {
                s
            } else {
                num_complex::Complex::from(1.0)
            };
            let expected = times / (s * s * inertia + s * 2.0);
            assert!((response.line(0)[(i, i)] - expected).norm() < 1e-14);
        }
        assert!(response.line(0)[(0, 1)].norm() < 1e-300);
        assert!((body.axes()[0].force(0.5, 2.0) - (8.0 + 1.0 - 3.0)).abs() < 1e-15);
    }

    #[test]
    fn json_round_trip_is_exact_and_checked() {
        let kept = Model::RigidBody(RigidBody::new(vec![axis(4.5), axis(0.1)]).unwrap());
        let text = kept.to_json().unwrap();
        assert!(!text.contains("output"), "a position says nothing");
        let mut fast = axis(4.5);
        fast.output = AxisOutput::Speed;
        let fast = Model::RigidBody(RigidBody::new(vec![fast]).unwrap());
        assert_eq!(Model::from_json(&fast.to_json().unwrap()).unwrap(), fast);
        assert!(text.contains("rigid-body"));
        assert_eq!(Model::from_json(&text).unwrap(), kept);
        assert!(Model::from_json(&text.replace("4.5", "-4.5")).is_err());
    }

    #[test]
    fn wrong_numbers_are_refused() {
        assert!(matches!(
            RigidBody::new(vec![axis(0.0)]),
            Err(CoreError::Singular { .. })
        ));
        assert!(matches!(
            RigidBody::new(vec![axis(1.0), axis(f64::INFINITY)]),
            Err(CoreError::NotFinite {
                row: 1,
                column: 0,
                ..
            })
        ));
    }
}
