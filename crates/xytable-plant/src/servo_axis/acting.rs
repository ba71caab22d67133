//! What hidden effects do to forces, masses and readings along a motion.

use super::AxisEffect;
use std::f64::consts::TAU;

/// Where an effect finds the motor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) record: usize,
    pub(super) time: f64,
    pub(super) position: f64,
    pub(super) speed: f64,
    /// Bend of the bristle.
    pub(super) bend: f64,
    /// Random force of unit deviation.
    pub(super) random: f64,
}

impl AxisEffect {
    /// Dry friction against a motion of this sign, or against the start of one, N.
    pub(super) fn dry(&self, at: &Moment, drive: f64, sign: f64) -> f64 {
        /// What friction that grows with the force takes of it at the most.
        const MOST: f64 = 0.95;
        let (position, speed) = (at.position, at.speed);
        match *self {
            Self::FrictionDrift {
                level,
                change,
                time_constant,
            } => (level - change * (-at.time / time_constant).exp_m1()).max(0.0),
            Self::LoadDependentFriction { level, coefficient } => {
                // f = level + coefficient |drive - sign f|, by the side on which drive - sign f lies.
                let part = coefficient.min(MOST);
                let handed_on = drive - sign * level;
                level + part * handed_on.abs() / (1.0 + part * sign * handed_on.signum())
            }
            Self::CoulombFriction { level } => level,
            Self::FrictionZone { level, from } if position >= from => level,
            Self::StribeckFriction {
                level,
                breakaway,
                speed: fall,
            } => level + breakaway * (-(speed / fall) * (speed / fall)).exp(),
            _ => 0.0,
        }
    }

    /// Every other force on the motor, N.
    pub(super) fn force(&self, at: &Moment) -> f64 {
        let (q, v) = (at.position, at.speed);
        match self {
            Self::ViscousFriction { coefficient } => -coefficient * v,
            Self::DirectionDependentFriction { more } => -more * v.abs(),
            Self::QuadraticDrag { factor } => -factor * v * v.abs(),
            Self::Temperature { per_degree, .. } => {
                let above = self.degrees(at.record, at.time).map_or(0.0, |t| t - 20.0);
                -per_degree * above * v
            }
            Self::Hysteresis { level, distance } => -level * at.bend / distance,
            Self::ConstantForce { force } => *force,
            Self::Gravity { force, turn, start } => -force * (TAU * (q - start) / turn).sin(),
            Self::PositionForce { waves } => {
                let one = |[a, length, phase]: &[f64; 3]| a * (TAU * q / length + phase).sin();
                waves.iter().map(one).sum()
            }
            Self::Cogging {
                sine,
                cosine,
                pitch,
                order,
                second,
            } => {
                let wave = |turn: f64| sine * turn.sin() + cosine * turn.cos();
                wave(TAU * q / pitch) + second * wave(TAU * order * q / pitch)
            }
            Self::CableStiffness { stiffness } => -stiffness * q,
            Self::StiffnessDrift {
                change,
                time_constant,
            } => change * (-at.time / time_constant).exp_m1() * q,
            Self::CubicStiffness { cube } => -cube * q * q * q,
            Self::PeriodicDisturbance {
                sine,
                cosine,
                frequency,
            } => {
                let (s, c) = (TAU * frequency * at.time).sin_cos();
                sine * s + cosine * c
            }
            Self::ForceStep { force, time } if at.time >= *time => *force,
            Self::SweptForce {
                force,
                low,
                high,
                span,
            } => {
                let turns = at.time * (low + 0.5 * (high - low) * at.time / span);
                force * (TAU * turns).sin()
            }
            Self::RandomForce { deviation, .. } => deviation * at.random,
            _ => 0.0,
        }
    }

    /// Whether there is dry friction.
    pub(super) fn is_dry(&self) -> bool {
        matches!(
            self,
            Self::CoulombFriction { .. }
                | Self::StribeckFriction { .. }
                | Self::FrictionZone { .. }
                | Self::FrictionDrift { .. }
                | Self::LoadDependentFriction { .. }
        )
    }

    /// What the drive makes of a command in a record.
    pub(super) fn driven(&self, u: f64, position: f64, record: usize) -> f64 {
        match *self {
            Self::InputGain { gain, record: own } if own == record => (1.0 + gain) * u,
            Self::ActuatorSaturation { softness } if softness > 0.0 => {
                let part = softness.sqrt();
                (part * u).tanh() / part
            }
            Self::PositionDependentGain { slope, curvature } => {
                u * (1.0 + position * (slope + curvature * position))
            }
            _ => u,
        }
    }

    /// What an encoder reads before it rounds.
    pub(super) fn sensed(&self, y: f64, time: f64) -> f64 {
        match *self {
            Self::SensorCyclicError { sine, cosine, period } => {
                let (s, c) = (TAU * y / period).sin_cos();
                y + sine * s + cosine * c
            }
            Self::SensorDrift { drift, time_constant } => y - drift * (-time / time_constant).exp_m1(),
            _ => y,
        }
    }

    /// What a coupling with this stiffness and damping pulls with at a deflection and its rate, where that is no spring alone.
    pub(super) fn pull(&self, [stiffness, damping]: [f64; 2], [bent, rate]: [f64; 2]) -> Option<f64> {
        let Self::CouplingBacklash { gap } = *self else {
            return None;
        };
        // Two faces on either side of a tooth: each pushes, none pulls.
        let [ahead, behind] = [bent - 0.5 * gap, -bent - 0.5 * gap];
        Some(if ahead > 0.0 {
            (stiffness * ahead + damping * rate).max(0.0)
        } else if behind > 0.0 {
            -(stiffness * behind - damping * rate).max(0.0)
        } else {
            0.0
        })
    }

    /// Mass more on the load, kg.
    pub(super) fn mass(&self, time: f64, record: usize) -> f64 {
        match *self {
            Self::Payload { mass, record: own } if own == record => mass,
            Self::MassJump { mass, time: from } if time >= from => mass,
            _ => 0.0,
        }
    }

    /// Highest rate at which the effect changes along a motion of this speed, rad/s.
    pub(super) fn fastest(&self, speed: f64, mass: f64) -> f64 {
        match *self {
            Self::Hysteresis { level, distance } => {
                (speed / distance).max((level.abs() / (distance * mass)).sqrt())
            }
            Self::Cogging {
                pitch, order, second, ..
            } => TAU * speed / pitch * if second == 0.0 { 1.0 } else { order.max(1.0) },
            Self::PeriodicDisturbance { frequency, .. } | Self::SweptForce { high: frequency, .. } => {
                TAU * frequency
            }
            Self::StribeckFriction {
                level,
                breakaway,
                speed: fall,
            } => (level + breakaway) / (fall * mass),
            Self::CableStiffness { stiffness } => (stiffness.abs() / mass).sqrt(),
            _ => 0.0,
        }
    }
}
