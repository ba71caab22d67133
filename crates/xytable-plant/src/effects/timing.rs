//! Effects between the controller's command and the force.

use super::{Effect, EffectInfo, Forces, Moment, Since};
use crate::MachineParameters;
use crate::mechanics::State;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "delay",
        family: "timing",
        unit: "s",
        meaning: "time from the command u' to the motors, any part of a sample",
        default: 4e-5,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Delay(severity)),
    },
    EffectInfo {
        name: "actuator-lag",
        family: "timing",
        unit: "s",
        meaning: "time constant of the amplifiers: T F' = F_commanded - F",
        default: 1e-3,
        range: [1e-4, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Lag(severity)),
    },
];

#[derive(Debug)]
struct Delay(f64);

impl Effect for Delay {
    fn delay(&self) -> f64 {
        self.0
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("time", self.0)]
    }
}

/// Own states: the forces of both motors.
#[derive(Debug)]
struct Lag(f64);

impl Effect for Lag {
    fn start(&self, _machine: &State) -> Vec<f64> {
        vec![0.0; 2]
    }

    fn act(&self, _at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        for ((force, commanded), rate) in own.iter().zip(&mut forces.motors).zip(rates) {
            *rate = (*commanded - force) / self.0;
            *commanded = *force;
        }
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("time_constant", self.0)]
    }
}
