//! Friction in the two guides along y, at the ends of the beam.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force, severity_of};
use crate::MachineParameters;
use crate::mechanics::State;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "coulomb-friction",
        family: "friction",
        unit: "m/s^2",
        meaning: "level of the friction in the guides, tanh(speed / 0.1 mm/s) in place of a sign",
        default: 1e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, shape| {
            Box::new(Coulomb {
                level: half_force(severity, machine),
                creep: shape.pick("creep", CREEP_M_PER_S, [5e-5, 5e-4]),
            })
        },
    },
    EffectInfo {
        name: "stribeck-friction",
        family: "friction",
        unit: "m/s^2",
        meaning: "level of a friction in the guides that is 1.6 times as large near zero speed, falling over 10 mm/s",
        default: 1e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, shape| {
            let level = half_force(severity, machine);
            Box::new(Stribeck {
                level,
                more: level * shape.pick("breakaway", 0.6, [0.3, 1.0]),
                fall: shape.pick("fall", 0.01, [5e-3, 0.03]),
            })
        },
    },
    EffectInfo {
        name: "viscous-friction",
        family: "friction",
        unit: "1/s",
        meaning: "friction of the guides proportional to speed, over the mass",
        default: 4e-5,
        range: [0.0, 10.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Viscous(half_force(severity, machine))),
    },
    EffectInfo {
        name: "hysteresis",
        family: "friction",
        unit: "m/s^2",
        meaning: "level of a friction in the guides that builds up over 3 mm of travel after each reversal (Dahl)",
        default: 1e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, shape| {
            Box::new(Dahl {
                level: half_force(severity, machine),
                distance: shape.pick("distance", 3e-3, [1e-3, 0.01]),
            })
        },
    },
];

/// Below this speed, m/s, the regularised friction is nearly proportional to it. The Runge-Kutta steps converge because
/// the force is smooth; the price is that a guide creeps where dry friction would hold it.
pub(super) const CREEP_M_PER_S: f64 = 1e-4;

/// Force of each guide, N.
#[derive(Debug)]
struct Coulomb {
    level: f64,
    creep: f64,
}

impl Effect for Coulomb {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let drag = at.motor_speeds().map(|v| -self.level * (v / self.creep).tanh());
        forces.push_ends(at.machine, drag);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("level", severity_of(self.level, machine)),
            ("creep_speed", self.creep),
        ]
    }
}

/// Forces of each guide, N, and the speed over which one of them falls, m/s.
#[derive(Debug)]
struct Stribeck {
    level: f64,
    more: f64,
    fall: f64,
}

impl Effect for Stribeck {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let drag = at.motor_speeds().map(|v| {
            let level = self.level + self.more * (-(v / self.fall) * (v / self.fall)).exp();
            -level * (v / CREEP_M_PER_S).tanh()
        });
        forces.push_ends(at.machine, drag);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("level", severity_of(self.level, machine)),
            ("breakaway", severity_of(self.more, machine)),
            ("stribeck_speed", self.fall),
            ("creep_speed", CREEP_M_PER_S),
        ]
    }
}

/// Force over speed of each guide, N s/m.
#[derive(Debug)]
struct Viscous(f64);

impl Effect for Viscous {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let drag = at.motor_speeds().map(|v| -self.0 * v);
        forces.push_ends(at.machine, drag);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("coefficient", severity_of(self.0, machine))]
    }
}

/// Own states: the part of each guide's force that has built up, from -1 to 1.
#[derive(Debug)]
struct Dahl {
    level: f64,
    distance: f64,
}

impl Effect for Dahl {
    fn start(&self, _machine: &State) -> Vec<f64> {
        vec![0.0; 2]
    }
    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        for ((rate, z), v) in rates.iter_mut().zip(own).zip(at.motor_speeds()) {
            *rate = (v - v.abs() * z) / self.distance;
        }
        forces.push_ends(at.machine, [-self.level * own[0], -self.level * own[1]]);
    }
    fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("level", severity_of(self.level, machine)),
            ("distance", self.distance),
        ]
    }
}
