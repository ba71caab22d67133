//! Dependence on the scheduling that a model frozen in it does not have.

use super::{Effect, EffectInfo, Forces, Moment, Since};
use crate::MachineParameters;
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "scheduling-rate",
        family: "scheduling",
        unit: "",
        meaning: "part c of the carriage's mass in forces of Coriolis: -c m1 x1' R1' along y and -c m1 x1' y1' about the carriage",
        default: 4e-3,
        range: [-10.0, 10.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Coriolis(severity * machine.carriage_mass_kg)),
    },
    EffectInfo {
        name: "second-scheduling",
        family: "scheduling",
        unit: "",
        meaning: "relative change of the stiffness between carriage and beam in y per unit of the second signal",
        default: 2e-3,
        range: [-0.5, 0.5],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Second(severity)),
    },
];

/// A signal, between -1.5 and 1.5, that moves slowly: a height, say, that a program of its own drives in every record.
pub fn second_signal(time: f64) -> f64 {
    (TAU * time / 67.0).sin() + 0.5 * (TAU * time / 23.0 + 1.0).sin()
}

/// Mass, kg.
#[derive(Debug)]
struct Coriolis(f64);

impl Effect for Coriolis {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let drive = self.0 * at.state[5];
        forces.bodies[1] -= drive * at.state[7];
        forces.bodies[2] -= drive * at.state[6];
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("force", self.0), ("torque", self.0)]
    }
}

/// Relative change of the stiffness per unit of the signal.
#[derive(Debug)]
struct Second(f64);

impl Effect for Second {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.pull_coupling(
            at,
            self.0 * second_signal(at.time) * at.machine.stiffness_y_n_per_m * at.deflection(),
        );
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("translation", self.0), ("rotation", 0.0)]
    }
}
