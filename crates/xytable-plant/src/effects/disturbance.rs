//! Forces from outside.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force};
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[EffectInfo {
    name: "periodic-disturbance",
    family: "disturbance",
    unit: "m/s^2",
    meaning: "amplitude of a force along y on both ends of the beam, 0.37 cycles per unit of time",
    default: 5e-6,
    range: [0.0, 1.0],
    since: Since::Grid,
    make: |severity, machine| Box::new(Periodic(half_force(severity, machine))),
}];

const FREQUENCY_HZ: f64 = 0.37;

/// Amplitude at each end, N.
#[derive(Debug)]
struct Periodic(f64);

impl Effect for Periodic {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let push = self.0 * (TAU * FREQUENCY_HZ * at.time).sin();
        forces.push_ends(at.machine, [push; 2]);
    }
}
