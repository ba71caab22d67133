//! Forces that depend on where the beam stands.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force};
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "cogging",
        family: "position-force",
        unit: "m/s^2",
        meaning: "amplitude of a force periodic in each motor's coordinate, pitch 24 mm, the motors a fifth of it apart",
        default: 2e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine| Box::new(Cogging(half_force(severity, machine))),
    },
    EffectInfo {
        name: "cable-stiffness",
        family: "position-force",
        unit: "1/s^2",
        meaning: "linear spring to ground at the left end of the beam, over the mass",
        default: 2e-5,
        range: [0.0, 100.0],
        since: Since::Grid,
        make: |severity, machine| Box::new(Cable(2.0 * half_force(severity, machine))),
    },
];

const PITCH_M: f64 = 0.024;
/// Phases of the magnet tracks of the left and the right motor: nobody mounts them alike.
const PHASES: [f64; 2] = [0.1 * TAU, 0.3 * TAU];

/// Amplitude of each motor, N.
#[derive(Debug)]
struct Cogging(f64);

impl Effect for Cogging {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let y = at.motor_positions();
        let push = [0, 1].map(|i: usize| self.0 * (TAU * y[i] / PITCH_M + PHASES[i]).sin());
        forces.push_ends(at.machine, push);
    }
}

/// Stiffness, N/m.
#[derive(Debug)]
struct Cable(f64);

impl Effect for Cable {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let [left, _] = at.motor_positions();
        forces.push_ends(at.machine, [-self.0 * left, 0.0]);
    }
}
