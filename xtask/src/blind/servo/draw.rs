//! Machines, moves and effects that nobody has seen, drawn from a seed over wide ranges.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use xytable_plant::servo_axis::{AxisEffect, AxisMoves, Drive, Encoders, Load, ServoAxis};
use xytable_plant::split_seed;

/// Records to fit, and one that is held out.
pub(super) const RECORDS: usize = 4;

/// Uniform numbers from a seed.
pub(super) struct Draw(ChaCha8Rng);

impl Draw {
    pub(super) fn new(seed: u64, what: &str) -> Self {
        Self(ChaCha8Rng::seed_from_u64(split_seed(seed, what)))
    }
    /// Uniform.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }
    /// Uniform in the logarithm.
    fn about(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.random::<f64>())
    }
    fn sign(&mut self) -> f64 {
        if self.0.random::<bool>() { 1.0 } else { -1.0 }
    }
    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.0.random_range(0..all.len())]
    }
}

/// One axis with its setpoints, record by record.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    pub(super) axis: ServoAxis,
    pub(super) moves: Vec<AxisMoves>,
    /// Travel, m.
    pub(super) stroke: f64,
    /// Highest speed and acceleration of the setpoints, m/s and m/s^2.
    pub(super) speed: f64,
    pub(super) acceleration: f64,
    /// Length of a record, s.
    pub(super) time: f64,
}

/// The axes of a machine.
#[derive(Debug, Clone)]
pub(super) struct Machine {
    pub(super) kind: &'static str,
    pub(super) axes: Vec<Drawn>,
    pub(super) samples: usize,
    /// Which axis has the effect.
    pub(super) hidden_in: usize,
}

const KINDS: [&str; 8] = [
    "rigid",
    "rigid",
    "rigid, open loop",
    "flexure",
    "flexure, open loop",
    "motor and load, one encoder",
    "motor and load, two encoders",
    "two axes",
];

pub(super) fn machine(seed: u64, hidden: Option<&str>) -> Machine {
    let mut draw = Draw::new(seed, "machine");
    // A cable beside a flexure is a flexure, and there alone a stiffness may change; a coupling joins a motor to a load.
    let kinds: Vec<&str> = KINDS
        .into_iter()
        .filter(|k| match hidden {
            Some("cable-stiffness") => !k.starts_with("flexure"),
            Some("stiffness-drift") => k.starts_with("flexure"),
            Some("backlash-of-the-load") => k.starts_with("motor and load"),
            _ => true,
        })
        .collect();
    let kind = draw.one_of(&kinds);
    let count = if kind == "two axes" { 2 } else { 1 };
    let rate = draw.about(200.0, 10_000.0);
    let samples = (draw.about(2500.0, 4800.0) / if count == 2 { 1.5 } else { 1.0 }) as usize;
    let axes = (0..count)
        .map(|_| axis(&mut draw, kind, (rate, samples)))
        .collect();
    let hidden_in = if count == 2 { draw.one_of(&[0, 1]) } else { 0 };
    Machine {
        kind,
        axes,
        samples,
        hidden_in,
    }
}

fn axis(draw: &mut Draw, kind: &str, (rate, samples): (f64, usize)) -> Drawn {
    let time = samples as f64 / rate;
    let stroke = draw.about(1e-3, 10.0);
    let mass = draw.about(1e-3, 1e3);
    let moves: Vec<AxisMoves> = (0..RECORDS).map(|_| setpoints(draw, stroke, time)).collect();
    let along = |i: usize| {
        let values = moves
            .iter()
            .flat_map(|m| (0..samples).map(move |k| m.at(k as f64 / rate)[i].abs()));
        values.fold(0.0, f64::max)
    };
    let (speed, acceleration) = (along(1), along(2));
    let typical = acceleration / speed / TAU;
    let bandwidth = (typical * draw.about(2.0, 6.0)).min(rate / 40.0);
    let is_open = kind.ends_with("open loop");
    let feedforward = draw.between(0.85, 1.15);
    let spring = if kind.starts_with("flexure") {
        let w = TAU * typical * draw.about(0.7, 4.0);
        mass * w * w
    } else {
        0.0
    };
    let load = kind.starts_with("motor and load").then(|| Load {
        part: draw.between(0.2, 0.7),
        resonance_hz: (bandwidth * draw.about(15.0, 60.0)).min(rate / 6.0),
        damping: draw.between(0.03, 0.1),
        encoders: match kind.ends_with("two encoders") {
            true => Encoders::Both,
            false => draw.one_of(&[Encoders::Motor, Encoders::Motor, Encoders::Load]),
        },
    });
    let axis = ServoAxis {
        mass_kg: mass,
        viscous_n_s_per_m: mass * acceleration / speed * draw.about(0.01, 0.5),
        offset_n: draw.sign() * mass * acceleration * draw.about(1e-3, 0.3),
        stiffness_n_per_m: spring,
        load,
        rate_hz: rate,
        resolution_m: stroke / draw.about(1e4, 1e6),
        drive: match is_open {
            // A free axis drifts away from a command that is wrong for its mass, no further than a part of the stroke.
            true => Drive::Open {
                feedforward: draw.between(0.95, 1.05),
            },
            false => Drive::Tracking {
                bandwidth_hz: bandwidth,
                feedforward,
            },
        },
    };
    Drawn {
        axis,
        moves,
        stroke,
        speed,
        acceleration,
        time,
    }
}

fn setpoints(draw: &mut Draw, stroke: f64, time: f64) -> AxisMoves {
    let kind = draw.one_of(&["trapezoids", "s-curves", "sines"]);
    if kind == "sines" {
        let slowest = draw.about(2.0, 6.0) / time;
        let mut sines = vec![[0.3 * stroke, slowest]];
        for _ in 0..draw.one_of(&[0, 1, 2]) {
            let f = slowest * draw.about(1.3, 4.0);
            sines.push([stroke * draw.about(0.02, 0.1) * slowest / f, f]);
        }
        return AxisMoves::Sines { sines };
    }
    let count = draw.one_of(&[4, 5, 6, 7, 8]);
    let size = draw.between(0.4, 1.0);
    // There and back, by ways of their own.
    let side = draw.sign();
    let point = |i: usize, draw: &mut Draw| {
        let turn = if i.is_multiple_of(2) { side } else { -side };
        turn * 0.5 * stroke * size * draw.between(0.3, 1.0)
    };
    let points_m = (0..=count).map(|i| point(i, draw)).collect();
    let (time_s, rest, ramp) = (
        time / count as f64,
        draw.between(0.0, 0.3),
        draw.between(0.15, 0.45),
    );
    match kind {
        "trapezoids" => AxisMoves::Trapezoids {
            points_m,
            time_s,
            rest,
            ramp,
        },
        _ => AxisMoves::SCurves {
            points_m,
            time_s,
            rest,
            ramp,
        },
    }
}

/// An effect of some size for an axis; None for a name that nobody has.
pub(super) fn effect(name: &str, seed: u64, on: &Drawn, samples: usize) -> Option<AxisEffect> {
    let mut draw = Draw::new(seed, name);
    let Drawn {
        axis,
        stroke,
        speed,
        acceleration,
        time,
        ..
    } = on;
    let (stroke, speed, time) = (*stroke, *speed, *time);
    // A force that is small beside those of the motion.
    let force = 1e-3 * axis.mass_kg * acceleration;
    let step = 1.0 / axis.rate_hz;
    let (sine, cosine) = (TAU * draw.between(0.0, 1.0)).sin_cos();
    // Pitches that the readings and the samples resolve.
    let least = (20.0 * axis.resolution_m).max(6.0 * speed * step);
    let pitch = draw.about(least.max(stroke / 1000.0), stroke);
    let sign = draw.sign();
    Some(match name {
        "coulomb-friction" => AxisEffect::CoulombFriction { level: force },
        "stribeck-friction" => AxisEffect::StribeckFriction {
            level: force,
            breakaway: force * draw.between(0.3, 1.0),
            speed: speed * draw.about(0.01, 0.2),
        },
        "friction-drift" => AxisEffect::FrictionDrift {
            level: force,
            change: force
                * if sign > 0.0 {
                    draw.about(0.3, 2.0)
                } else {
                    -draw.between(0.3, 0.9)
                },
            time_constant: time * draw.about(0.1, 1.0),
        },
        "load-dependent-friction" => AxisEffect::LoadDependentFriction {
            level: force,
            coefficient: 1e-3 * draw.about(0.5, 2.0),
        },
        "stiffness-drift" => AxisEffect::StiffnessDrift {
            change: sign * force / stroke,
            time_constant: time * draw.about(0.1, 1.0),
        },
        "input-gain" => AxisEffect::InputGain {
            gain: 1e-3 * sign,
            record: draw.one_of(&[0, 1, 2]),
        },
        "viscous-friction" => AxisEffect::ViscousFriction {
            coefficient: force / speed,
        },
        "direction-dependent-friction" => AxisEffect::DirectionDependentFriction {
            more: sign * force / speed,
        },
        "quadratic-friction" => AxisEffect::QuadraticDrag {
            factor: force / (speed * speed),
        },
        "temperature" => AxisEffect::Temperature {
            per_degree: 0.1 * sign * force / speed,
            rise: draw.about(1.0, 20.0),
            time_constant: time * draw.about(0.1, 2.0),
        },
        "hysteresis" => AxisEffect::Hysteresis {
            level: force,
            distance: draw.about((5.0 * axis.resolution_m).max(stroke * 1e-4), stroke * 0.1),
        },
        "constant-force" => AxisEffect::ConstantForce { force: sign * force },
        "gravity" => AxisEffect::Gravity {
            force,
            turn: stroke * draw.about(0.8, 4.0),
            start: stroke * draw.between(-1.0, 1.0),
        },
        "position-force" => AxisEffect::PositionForce {
            waves: (0..3)
                .map(|_| {
                    [
                        force * draw.between(0.3, 1.0),
                        stroke * draw.about(0.7, 4.0),
                        TAU * draw.between(0.0, 1.0),
                    ]
                })
                .collect(),
        },
        "cogging" | "cogging-two-orders" => AxisEffect::Cogging {
            sine: force * sine,
            cosine: force * cosine,
            pitch: if name == "cogging" {
                pitch
            } else {
                pitch.max(3.0 * least).min(stroke)
            },
            order: draw.one_of(&[2.0, 3.0]),
            second: if name == "cogging" {
                0.0
            } else {
                draw.between(0.3, 0.9)
            },
        },
        "cable-stiffness" => AxisEffect::CableStiffness {
            stiffness: force / stroke,
        },
        "cubic-stiffness" => AxisEffect::CubicStiffness {
            cube: force / (stroke * stroke * stroke),
        },
        "delay" => AxisEffect::Delay { time: 0.01 * step },
        "actuator-lag" => AxisEffect::ActuatorLag {
            time_constant: 0.01 * step,
        },
        "actuator-saturation" => AxisEffect::ActuatorSaturation {
            softness: 1e-3 / (axis.mass_kg * acceleration).powi(2),
        },
        "position-dependent-gain" => AxisEffect::PositionDependentGain {
            slope: 1e-3 * sign / stroke,
            curvature: 1e-3 * draw.between(-1.0, 1.0) / (stroke * stroke),
        },
        "sensor-cyclic-error" => AxisEffect::SensorCyclicError {
            sine: axis.resolution_m * sine,
            cosine: axis.resolution_m * cosine,
            period: pitch,
        },
        "sensor-drift" => AxisEffect::SensorDrift {
            drift: sign * axis.resolution_m,
            time_constant: time * draw.about(0.05, 2.0),
        },
        "quantization" => AxisEffect::Quantization {
            step: axis.resolution_m,
        },
        "periodic-disturbance" => AxisEffect::PeriodicDisturbance {
            sine: force * sine,
            cosine: force * cosine,
            frequency: draw.about(2.5 / time, 0.1 * axis.rate_hz),
        },
        "payload" => AxisEffect::Payload {
            mass: 1e-3 * axis.mass_kg,
            record: draw.one_of(&[0, 1, 2]),
        },
        "backlash" => AxisEffect::Backlash {
            gap: axis.resolution_m,
        },
        "backlash-of-the-load" => AxisEffect::CouplingBacklash {
            gap: axis.resolution_m,
        },
        "force-step" => AxisEffect::ForceStep {
            force: sign * force,
            time: time * draw.between(0.3, 0.7),
        },
        "mass-jump" => AxisEffect::MassJump {
            mass: 1e-3 * axis.mass_kg,
            time: time * draw.between(0.3, 0.7),
        },
        "friction-zone" => AxisEffect::FrictionZone {
            level: force,
            from: stroke * draw.between(-0.2, 0.2),
        },
        "swept-force" => AxisEffect::SweptForce {
            force,
            low: draw.about(2.5 / time, 5.0 / time),
            high: draw.about(10.0 / time, 100.0 / time).min(0.1 * axis.rate_hz),
            span: time,
        },
        "random-force" => AxisEffect::RandomForce {
            deviation: force,
            corner: draw.about(4.0, samples as f64 / 50.0) / time / PI,
            seed: split_seed(seed, "random"),
        },
        _ => return None,
    })
}
