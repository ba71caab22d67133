//! Inverse dynamics of an axis with its effects: the force that a motion needs.

use crate::base::{Base, Motion};
use crate::effect::{Effect, Family};
use crate::fit::Explained;
use crate::track::Track;
use lpv_core::Discrete;
use lti_ident::rigid_body::{self, Filter, RigidBodySettings};

impl Explained {
    /// Force of the motor of an axis along a motion of its encoder: positions, speeds and accelerations by sample of a record. Effects with
    /// states of their own stay at their start. None for other machines.
    pub fn inverse_dynamics(&self, track: &Track, motion: [&[f64]; 3]) -> Option<Vec<f64>> {
        let Base::Axis(axis) = &self.base else {
            return None;
        };
        let [q, v, _] = motion;
        let at = |(q, v): (&f64, &f64)| Motion {
            motor_position: [*q, 0.0],
            motor_speed: [*v, 0.0],
            load_position: [*q, 0.0],
            load_speed: [*v, 0.0],
            deflection: [0.0; 2],
        };
        let motions: Vec<Motion> = q.iter().zip(v).map(at).collect();
        let effects = self.forces_along(track, &motions);
        let forces = axis.force_along(motion, track.step).into_iter().zip(effects);
        Some(forces.map(|(force, effect)| force - effect[0]).collect())
    }

    /// Sum of the squared force that it leaves of the input of a record, in the band of the acceleration; none for other machines than an axis.
    pub(crate) fn force_left(&self, track: &Track) -> Option<f64> {
        let first = |pairs: &[[f64; 2]]| pairs.iter().map(|v| v[0]).collect::<Vec<f64>>();
        let (q, u) = (first(&track.outputs), first(&track.inputs));
        let clock = Discrete::new(track.step).ok()?;
        let filter = Filter::new(&[&q], clock, &RigidBodySettings::default()).ok()?;
        let motion = rigid_body::Motion::new(&q, clock, filter.position_cutoff_hz).ok()?;
        let force =
            self.inverse_dynamics(track, [&motion.position, &motion.velocity, &motion.acceleration])?;
        let pushed = filter.held(&u, clock).ok()?;
        let told = filter.reduced(&force, clock).ok()?;
        Some(pushed.iter().zip(&told).map(|(a, b)| (a - b).powi(2)).sum())
    }

    /// Whether its last effect is a force of the motion alone, which the inverse dynamics tell.
    pub(crate) fn ends_with_a_force(&self) -> bool {
        let is_force = |family: Family| matches!(family, Family::Friction | Family::PositionForce);
        let is_of_motion = |(e, v): &(&Effect, Vec<f64>)| (e.block)(v, &self.base, e.place).states() == 0;
        let last = self.effects.last();
        last.is_some_and(|last| is_force(last.0.family) && is_of_motion(last))
    }
}
