//! Forces that depend on where the beam stands.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force, severity_of};
use crate::MachineParameters;
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
        make: |severity, machine, shape| {
            Box::new(Cogging {
                amplitude: half_force(severity, machine),
                pitch: shape.pick("pitch", 0.024, [0.012, 0.05]),
                phases: [shape.phase("left", 0.1 * TAU), shape.phase("right", 0.3 * TAU)],
            })
        },
    },
    EffectInfo {
        name: "cable-stiffness",
        family: "position-force",
        unit: "1/s^2",
        meaning: "linear spring to ground at the left end of the beam, over the mass",
        default: 2e-5,
        range: [0.0, 100.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Cable(2.0 * half_force(severity, machine))),
    },
    EffectInfo {
        name: "product-force",
        family: "position-force",
        unit: "1/s^2",
        meaning: "spring to ground at both ends of the beam, over the mass, proportional to the position of the carriage over 0.1 m",
        default: 1e-5,
        range: [0.0, 100.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Product(half_force(severity, machine) / 0.1)),
    },
];

/// Amplitude of each motor, N; the magnet tracks of the two have phases of their own, for nobody mounts them alike.
#[derive(Debug)]
struct Cogging {
    amplitude: f64,
    pitch: f64,
    phases: [f64; 2],
}

impl Effect for Cogging {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let y = at.motor_positions();
        let push = [0, 1].map(|i: usize| self.amplitude * (TAU * y[i] / self.pitch + self.phases[i]).sin());
        forces.push_ends(at.machine, push);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        let amplitude = severity_of(self.amplitude, machine);
        let [left, right] = self.phases;
        vec![
            ("left_sine", amplitude * left.cos()),
            ("left_cosine", amplitude * left.sin()),
            ("right_sine", amplitude * right.cos()),
            ("right_cosine", amplitude * right.sin()),
            ("pitch", self.pitch),
        ]
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
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("left_stiffness", severity_of(self.0, machine)),
            ("right_stiffness", 0.0),
        ]
    }
}

/// Force over the product of two coordinates, N/m².
#[derive(Debug)]
struct Product(f64);

impl Effect for Product {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let push = at.motor_positions().map(|y| -self.0 * at.state[0] * y);
        forces.push_ends(at.machine, push);
    }
}
