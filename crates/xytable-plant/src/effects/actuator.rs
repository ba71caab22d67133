//! Effects of the linear motors.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force, severity_of};
use crate::MachineParameters;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "position-dependent-gain",
        family: "actuator",
        unit: "",
        meaning: "relative change of the force constant over 0.1 m of each motor's travel along y",
        default: 6e-5,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(PositionGain(severity / 0.1)),
    },
    EffectInfo {
        name: "motor-asymmetry",
        family: "actuator",
        unit: "",
        meaning: "force constant of the left motor less that of the right, relative to their mean",
        default: 2e-4,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Asymmetry(severity)),
    },
    EffectInfo {
        name: "actuator-saturation",
        family: "actuator",
        unit: "m/s^2",
        meaning: "largest force F_max, smaller is stronger: each motor gives F_max tanh(F_commanded / F_max)",
        default: 5.0,
        range: [1e-6, 1e9],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Saturation(half_force(severity, machine))),
    },
];

/// Gain as `1 + slope times coordinate`, slope in 1/m.
#[derive(Debug)]
struct PositionGain(f64);

impl Effect for PositionGain {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        for (force, y) in forces.motors.iter_mut().zip(at.motor_positions()) {
            *force *= 1.0 + self.0 * y;
        }
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("slope", self.0)]
    }
}

#[derive(Debug)]
struct Asymmetry(f64);

impl Effect for Asymmetry {
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors[0] *= 1.0 + 0.5 * self.0;
        forces.motors[1] *= 1.0 - 0.5 * self.0;
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("difference", self.0)]
    }
}

/// Largest force of a motor, N.
#[derive(Debug)]
struct Saturation(f64);

impl Effect for Saturation {
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.motors = forces.motors.map(|f| self.0 * (f / self.0).tanh());
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("softness", severity_of(self.0, machine).powi(-2))]
    }
}
