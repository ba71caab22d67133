//! Masses and couplings that differ from those identified.

use super::{Effect, EffectInfo, Forces, Moment, Since};
use crate::MachineParameters;
use crate::mechanics::State;
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "payload",
        family: "structure",
        unit: "kg",
        meaning: "mass on the carriage, radius of gyration 0.1 m, mounted after the grid was measured",
        default: 2e-3,
        range: [0.0, 1e3],
        since: Since::Moves,
        make: |severity, _| Box::new(Payload(severity)),
    },
    EffectInfo {
        name: "extra-mode",
        family: "structure",
        unit: "kg",
        meaning: "mass on the carriage that swings along y on a spring, 4.4 cycles per unit of time, damping ratio 0.02, \
                  mounted after the grid was measured",
        default: 2e-3,
        range: [0.0, 1e3],
        since: Since::Moves,
        make: |severity, _| Box::new(Swing(severity)),
    },
    EffectInfo {
        name: "cubic-stiffness",
        family: "structure",
        unit: "",
        meaning: "coupling of carriage and beam in y with force k_y e (1 + severity (e / 1 mm)²)",
        default: 1e-3,
        range: [0.0, 1e3],
        since: Since::Grid,
        make: |severity, machine| Box::new(Cubic(severity * machine.stiffness_y_n_per_m * 1e6)),
    },
];

const GYRATION_M: f64 = 0.1;

#[derive(Debug)]
struct Payload(f64);

impl Effect for Payload {
    fn mount(&self, machine: &mut MachineParameters) {
        machine.carriage_mass_kg += self.0;
        machine.carriage_inertia_kg_m2 += self.0 * GYRATION_M * GYRATION_M;
        machine.servo_mass_kg += self.0;
    }
}

const SWING_RAD: f64 = TAU * 4.4;
const SWING_DAMPING: f64 = 0.02;

/// Own states: position and speed of the mass along y.
#[derive(Debug)]
struct Swing(f64);

impl Effect for Swing {
    fn mount(&self, machine: &mut MachineParameters) {
        machine.servo_mass_kg += self.0;
    }

    fn start(&self, machine: &State) -> Vec<f64> {
        vec![machine[1], machine[6]]
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let (stretch, speed) = (own[0] - at.state[1], own[1] - at.state[6]);
        let pull = SWING_RAD * SWING_RAD * stretch + 2.0 * SWING_DAMPING * SWING_RAD * speed;
        rates[0] = own[1];
        rates[1] = -pull;
        forces.bodies[1] += self.0 * pull;
    }
}

/// Force over the cube of the deflection, N/m³.
#[derive(Debug)]
struct Cubic(f64);

impl Effect for Cubic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let [p, y1, _, y2, turn, ..] = *at.state;
        let push = self.0 * (y1 - y2 - p * turn).powi(3);
        forces.bodies[1] -= push;
        forces.bodies[3] += push;
        forces.bodies[4] += p * push;
    }
}
