//! Errors of the position sensors.

use super::{Effect, EffectInfo, Moment, Since};
use crate::{MachineParameters, split_seed};
use std::f64::consts::TAU;

pub(super) const EFFECTS: &[EffectInfo] = &[
    EffectInfo {
        name: "sensor-gain",
        family: "sensor",
        unit: "",
        meaning: "relative scale error of y'_1",
        default: 5e-5,
        range: [-0.9, 10.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Gain(severity)),
    },
    EffectInfo {
        name: "sensor-offset",
        family: "sensor",
        unit: "m",
        meaning: "what the sensor of y'_1 reads too much",
        default: 1e-5,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Offset(severity)),
    },
    EffectInfo {
        name: "sensor-drift",
        family: "sensor",
        unit: "m",
        meaning: "final drift of y'_1, reached from zero at the start of each record with a time constant of 20",
        default: 3e-4,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _, shape| {
            Box::new(Drift {
                size: severity,
                time_constant: shape.pick("time", 20.0, [10.0, 60.0]),
            })
        },
    },
    EffectInfo {
        name: "quantization",
        family: "sensor",
        unit: "m",
        meaning: "step of y'_1; that of y'_2 is the step over half the distance of the motors",
        default: 5e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, machine, _| Box::new(Quantization([severity, severity / machine.half_beam_m])),
    },
    EffectInfo {
        name: "abbe-offset",
        family: "sensor",
        unit: "m",
        meaning: "distance of the point that the sensor of y'_1 reads from the assumed one: it adds so many times y'_2",
        default: 1e-3,
        range: [-1.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Abbe(severity)),
    },
    EffectInfo {
        name: "sensor-cyclic-error",
        family: "sensor",
        unit: "m",
        meaning: "amplitude of an error of y'_1 periodic in it, period 20 mm",
        default: 3e-6,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, _, shape| {
            Box::new(Cyclic {
                amplitude: severity,
                period: shape.pick("period", 0.02, [8e-3, 0.04]),
                phase: shape.phase("phase", 0.0),
            })
        },
    },
    EffectInfo {
        name: "lost-samples",
        family: "sensor",
        unit: "s",
        meaning: "age of the reading that stands in for one sample in fifty of y'_1, at random",
        default: 5e-4,
        range: [0.0, 1.0],
        since: Since::Grid,
        make: |severity, _, _| Box::new(Lost(severity)),
    },
];

/// Added to y'_1, m.
#[derive(Debug)]
struct Offset(f64);

impl Effect for Offset {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] += self.0;
    }
}

#[derive(Debug)]
struct Gain(f64);

impl Effect for Gain {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] *= 1.0 + self.0;
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("gain", self.0)]
    }
}

#[derive(Debug)]
struct Drift {
    size: f64,
    time_constant: f64,
}

impl Effect for Drift {
    fn sense(&self, at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] -= self.size * (-at.time / self.time_constant).exp_m1();
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("drift", self.size), ("time_constant", self.time_constant)]
    }
}

#[derive(Debug)]
struct Quantization([f64; 2]);

impl Effect for Quantization {
    fn resolution(&self) -> Option<[f64; 2]> {
        (self.0[0] > 0.0).then_some(self.0)
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("step", self.0[0]), ("other_step", self.0[1])]
    }
}

#[derive(Debug)]
struct Abbe(f64);

impl Effect for Abbe {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] += self.0 * outputs[1];
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![("offset", self.0)]
    }
}

#[derive(Debug)]
struct Cyclic {
    amplitude: f64,
    period: f64,
    phase: f64,
}

impl Effect for Cyclic {
    fn sense(&self, _at: &Moment<'_>, outputs: &mut [f64; 2]) {
        outputs[0] += self.amplitude * (TAU * outputs[0] / self.period + self.phase).sin();
    }
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        vec![
            ("sine", self.amplitude * self.phase.cos()),
            ("cosine", self.amplitude * self.phase.sin()),
            ("period", self.period),
        ]
    }
}

/// Age, s.
#[derive(Debug)]
struct Lost(f64);

impl Effect for Lost {
    fn sense(&self, at: &Moment<'_>, outputs: &mut [f64; 2]) {
        // The moment itself draws the lot.
        if split_seed(at.time.to_bits(), "lost").is_multiple_of(50) {
            let x = at.state;
            let rate = x[6] - x[0] * x[7] - x[5] * x[2];
            outputs[0] -= self.0 * rate;
        }
    }
}
