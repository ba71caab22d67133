//! Forces from outside.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force, severity_of};
use crate::MachineParameters;
use crate::mechanics::State;
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "periodic-disturbance",
        family: "disturbance",
        unit: "m/s^2",
        meaning: "amplitude of a force along y on both ends of the beam, 0.37 Hz",
        default: 5e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, shape| {
            Box::new(Periodic {
                amplitude: half_force(severity, machine),
                frequency: shape.pick("frequency", 0.37, [0.15, 3.0]),
                phase: shape.phase("phase", 0.0),
            })
        },
    },
    EffectInfo {
        name: "limit-cycle",
        family: "disturbance",
        unit: "m/s^2",
        meaning: "amplitude of the force along y of an inner loop that oscillates by itself near 0.9 Hz \
                  (van der Pol), faster while the beam moves",
        default: 4e-5,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, shape| {
            Box::new(LimitCycle {
                amplitude: half_force(severity, machine),
                rate: TAU * shape.pick("frequency", 0.9, [0.5, 1.5]),
            })
        },
    },
    EffectInfo {
        name: "constant-force",
        family: "disturbance",
        unit: "m/s^2",
        meaning: "constant force along y on both ends of the beam: a machine that is not level",
        default: 5e-6,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Constant(half_force(severity, machine))),
    },
];

/// Force at each end, N.
#[derive(Debug)]
struct Constant(f64);

impl Effect for Constant {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        forces.push_ends(at.machine, [self.0; 2]);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        let force = severity_of(self.0, machine);
        vec![("left_force", force), ("right_force", force)]
    }
}

/// Amplitude at each end, N.
#[derive(Debug)]
struct Periodic {
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Effect for Periodic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let push = self.amplitude * (TAU * self.frequency * at.time + self.phase).sin();
        forces.push_ends(at.machine, [push; 2]);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        let amplitude = severity_of(self.amplitude, machine);
        vec![
            ("sine", amplitude * self.phase.cos()),
            ("cosine", amplitude * self.phase.sin()),
            ("frequency", self.frequency),
        ]
    }
}

/// Own states: an oscillation of amplitude 2 and its rate over its frequency.
#[derive(Debug)]
struct LimitCycle {
    amplitude: f64,
    rate: f64,
}

/// Speed of the beam, m/s, at which the oscillation is twice as fast.
const TWICE_AS_FAST: f64 = 0.1;

impl Effect for LimitCycle {
    fn start(&self, _machine: &State) -> Vec<f64> {
        vec![0.5, 0.0]
    }
    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let v = at.state[8] / TWICE_AS_FAST;
        let rate = self.rate * (1.0 + v * v).sqrt();
        rates[0] = rate * own[1];
        rates[1] = rate * (0.5 * (1.0 - own[0] * own[0]) * own[1] - own[0]);
        forces.push_ends(at.machine, [0.5 * self.amplitude * own[0]; 2]);
    }
}
