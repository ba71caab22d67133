//! Errors of the position sensors.

use super::{Effect, EffectInfo, Moment, Since};

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "sensor-gain",
        family: "sensor",
        unit: "",
        meaning: "relative scale error of y'_1",
        default: 5e-5,
        range: [-0.9, 10.0],
        since: Since::Grid,
        make: |severity, _| Box::new(Gain(severity)),
    },
    EffectInfo {
        name: "sensor-drift",
        family: "sensor",
        unit: "m",
        meaning: "final drift of y'_1, reached from zero at the start of each record with a time constant of 20",
        default: 3e-4,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _| Box::new(Drift(severity)),
    },
    EffectInfo {
        name: "quantization",
        family: "sensor",
        unit: "m",
        meaning: "step of y'_1; that of y'_2 is the step over half the distance of the motors",
        default: 5e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine| Box::new(Quantization([severity, severity / machine.half_beam_m])),
    },
];

#[derive(Debug)]
struct Gain(f64);

impl Effect for Gain {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] *= 1.0 + self.0;
    }
}

const WARM_UP_TIME: f64 = 20.0;

#[derive(Debug)]
struct Drift(f64);

impl Effect for Drift {
    fn sense(&self, at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] -= self.0 * (-at.time / WARM_UP_TIME).exp_m1();
    }
}

#[derive(Debug)]
struct Quantization([f64; 2]);

impl Effect for Quantization {
    fn resolution(&self) -> Option<[f64; 2]> {
        (self.0[0] > 0.0).then_some(self.0)
    }
}
