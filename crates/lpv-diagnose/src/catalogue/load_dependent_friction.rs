//! Coulomb friction that grows with the force that is handed on, as that of a gear or of a screw.

use super::parameter;
use crate::base::Forces;
use crate::effect::{Block, Effect, Extends, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "load-dependent-friction",
    family: Family::Friction,
    place: Place::Motor(0),
    needs: Needs::Axis,
    meaning: "friction that grows with the force that the motor hands on",
    parameters: const {
        &[
            parameter("level", "u", Scale::NotNegative),
            parameter("coefficient", "", Scale::Positive),
            parameter("creep_speed", "y/s", Scale::Logarithmic),
        ]
    },
    extends: Some(Extends {
        name: "coulomb-friction",
        // Of what an axis of its force at rest and its acceleration alone takes, friction takes a part.
        starts: |v, _, _| [0.9, 0.1].map(|part| vec![part * v[0], 1e-3, v[1]]).to_vec(),
    }),
    starts: &|_, _| Vec::new(),
    on_response: None,
    block: &|v, machine, place| {
        Box::new(Loaded {
            level: super::motor_forces(machine, place.first(), v[0])[0],
            coefficient: v[1],
            creep: v[2],
        })
    },
};

/// `-(F + k |L|) tanh(v / creep)` with the force L that is handed on, which is the motor's without the friction.
#[derive(Debug)]
struct Loaded {
    level: f64,
    coefficient: f64,
    creep: f64,
}

impl Loaded {
    /// The friction of a motion with this sign, where the motor gives this force: L = drive - sign (F + k |L|) is solved on the side on
    /// which `drive - sign F` lies.
    fn level(&self, drive: f64, sign: f64) -> f64 {
        // A machine that holds itself has no such friction.
        let part = self.coefficient.clamp(-0.9, 0.9);
        let rest = drive - sign * self.level;
        let load = rest / (1.0 + part * sign * rest.signum());
        (self.level + part * load.abs()).max(0.0)
    }
}

impl Block for Loaded {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let speed = at.motion.motor_speed[0];
        let drive = at.machine.commanded(at.p, at.track.inputs[at.sample])[0];
        let level = self.level(drive, speed.signum());
        super::rub(0, level, (speed, self.creep), forces);
    }
}

#[cfg(test)]
mod tests {
    use super::Loaded;

    /// `f = F + k |drive - sign f|` by its own equation.
    #[test]
    fn the_friction_is_that_of_the_force_that_is_left() {
        let friction = Loaded {
            level: 0.3,
            coefficient: 0.2,
            creep: 1.0,
        };
        for (drive, sign) in [(2.0, 1.0), (2.0, -1.0), (-5.0, 1.0), (0.1, 1.0), (0.0, -1.0)] {
            let f = friction.level(drive, sign);
            assert!(
                (f - (0.3 + 0.2 * (drive - sign * f).abs())).abs() < 1e-12,
                "{drive} {sign}: {f}"
            );
        }
    }
}
