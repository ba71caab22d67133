//! Friction in the two guides along y, at the ends of the beam.

use super::{Effect, EffectInfo, Forces, Moment, Since, half_force};

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "coulomb-friction",
        family: "friction",
        unit: "m/s^2",
        meaning: "level of the friction in the guides, tanh(speed / 0.1 mm/s) in place of a sign",
        default: 1e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine| Box::new(Coulomb(half_force(severity, machine))),
    },
    EffectInfo {
        name: "viscous-friction",
        family: "friction",
        unit: "1/s",
        meaning: "friction of the guides proportional to speed, over the mass",
        default: 4e-5,
        range: [0.0, 10.0],
        since: Since::Grid,
        make: |severity, machine| Box::new(Viscous(half_force(severity, machine))),
    },
];

/// Below this speed, m/s, the regularised friction is nearly proportional to it. The Runge-Kutta steps converge because
/// the force is smooth; the price is that a guide creeps where dry friction would hold it.
pub(super) const CREEP_M_PER_S: f64 = 1e-4;

/// Force of each guide, N.
#[derive(Debug)]
struct Coulomb(f64);

impl Effect for Coulomb {
    fn act(&self, at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], forces: &mut Forces) {
        let drag = at.motor_speeds().map(|v| -self.0 * (v / CREEP_M_PER_S).tanh());
        forces.push_ends(at.machine, drag);
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
}
