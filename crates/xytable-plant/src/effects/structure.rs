//! Masses and couplings that differ from those identified.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force};
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
        make: |severity, _, shape| {
            Box::new(Payload {
                mass: severity,
                gyration: shape.pick("gyration", 0.1, [0.05, 0.2]),
            })
        },
    },
    EffectInfo {
        name: "extra-mode",
        family: "structure",
        unit: "kg",
        meaning: "mass on the carriage that swings along y on a spring, 4.4 Hz, damping ratio 0.02, \
                  mounted after the grid was measured",
        default: 2e-3,
        range: [0.0, 1e3],
        since: Since::Moves,
        make: |severity, _, shape| {
            Box::new(Swing {
                mass: severity,
                frequency: shape.pick("frequency", 4.4, [3.0, 7.0]),
                damping: shape.pick("damping", 0.02, [0.01, 0.05]),
            })
        },
    },
    EffectInfo {
        name: "cubic-stiffness",
        family: "structure",
        unit: "",
        meaning: "coupling of carriage and beam in y with force k_y e (1 + severity (e / 1 mm)²)",
        default: 1e-3,
        range: [0.0, 1e3],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Cubic(severity * machine.stiffness_y_n_per_m * 1e6)),
    },
    EffectInfo {
        name: "backlash",
        family: "structure",
        unit: "m",
        meaning: "play of the coupling of carriage and beam in y",
        default: 2e-6,
        range: [0.0, 0.1],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Backlash(0.5 * severity)),
    },
    EffectInfo {
        name: "mass-jump",
        family: "structure",
        unit: "kg",
        meaning: "mass on the carriage that appears in each record, at 50 units of time",
        default: 2.5e-3,
        range: [0.0, 1e3],
        since: Since::Moves,
        make: |severity, _, shape| {
            Box::new(Jump {
                mass: severity,
                time: shape.pick("time", 50.0, [50.0, 150.0]),
            })
        },
    },
    EffectInfo {
        name: "thermal-stiffness",
        family: "structure",
        unit: "",
        meaning: "relative loss of the stiffness of carriage and beam in y when warm; the square of the motors' force warms it, \
                  time constant 30",
        default: 1e-3,
        range: [0.0, 0.5],
        since: Since::Grid,
        make: |severity, machine, shape| {
            Box::new(Thermal {
                loss: severity,
                force: half_force(0.02, machine),
                time_constant: shape.pick("time", 30.0, [15.0, 60.0]),
            })
        },
    },
];

/// Mass, kg, and radius of gyration, m.
#[derive(Debug)]
struct Payload {
    mass: f64,
    gyration: f64,
}

impl Effect for Payload {
    fn mount(&self, machine: &mut MachineParameters) {
        machine.carriage_mass_kg += self.mass;
        machine.carriage_inertia_kg_m2 += self.mass * self.gyration * self.gyration;
        machine.servo_mass_kg += self.mass;
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("mass", self.mass),
            ("inertia", self.mass * self.gyration * self.gyration),
        ]
    }
}

/// Own states: position and speed of the mass along y.
#[derive(Debug)]
struct Swing {
    mass: f64,
    frequency: f64,
    damping: f64,
}

impl Effect for Swing {
    fn mount(&self, machine: &mut MachineParameters) {
        machine.servo_mass_kg += self.mass;
    }
    fn start(&self, machine: &State) -> Vec<f64> {
        vec![machine[1], machine[6]]
    }
    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let (stretch, speed) = (own[0] - at.state[1], own[1] - at.state[6]);
        let rate = TAU * self.frequency;
        let pull = rate * rate * stretch + 2.0 * self.damping * rate * speed;
        rates[0] = own[1];
        rates[1] = -pull;
        forces.bodies[1] += self.mass * pull;
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("mass", self.mass),
            ("frequency", self.frequency),
            ("damping", self.damping),
        ]
    }
}

/// Force over the cube of the deflection, N/m³.
#[derive(Debug)]
struct Cubic(f64);

impl Effect for Cubic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.pull_coupling(at, self.0 * at.deflection().powi(3));
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("cubic", self.0 / machine.stiffness_y_n_per_m)]
    }
}

/// Half the play, m: so far the spring does not pull.
#[derive(Debug)]
struct Backlash(f64);

impl Effect for Backlash {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let free = at.deflection().clamp(-self.0, self.0);
        forces.pull_coupling(at, -at.machine.stiffness_y_n_per_m * free);
    }
}

#[derive(Debug)]
struct Jump {
    mass: f64,
    time: f64,
}

impl Effect for Jump {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        if at.time >= self.time {
            let q = at.machine;
            let pull = q.stiffness_y_n_per_m * at.deflection() + q.damping_y_n_s_per_m * at.deflection_rate();
            // The pull has more to accelerate: what is left on the carriage is less by this part.
            forces.bodies[1] += pull * self.mass / (q.carriage_mass_kg + self.mass);
        }
    }
}

/// Own state: how warm it is, 1 in steady state under the given force of each motor.
#[derive(Debug)]
struct Thermal {
    loss: f64,
    force: f64,
    time_constant: f64,
}

impl Effect for Thermal {
    fn start(&self, _machine: &State) -> Vec<f64> {
        vec![0.0]
    }
    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let heat: f64 = forces.motors.iter().map(|f| 0.5 * (f / self.force).powi(2)).sum();
        rates[0] = (heat - own[0]) / self.time_constant;
        forces.pull_coupling(
            at,
            -self.loss * own[0] * at.machine.stiffness_y_n_per_m * at.deflection(),
        );
    }
}
