//! One record: the loop at its samples, the axis between them.

use super::acting::Moment;
use super::{AxisEffect, AxisMoves, Drive, Encoders, ServoAxis};
use crate::{PlantError, split_seed};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Fewest and most parts of a sample, and the largest phase of what is fast in one of them.
const PARTS: [usize; 2] = [8, 400];
const PHASE: f64 = 0.2;

/// Motor position and speed, load position and speed, bend of a bristle.
type State = [f64; 5];

/// What was recorded, and what no record holds.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisRun {
    /// Commands, N.
    pub inputs: Vec<f64>,
    /// Readings of each encoder, m.
    pub outputs: Vec<Vec<f64>>,
    /// What the first encoder would read without rounding, m.
    pub exact: Vec<f64>,
    /// Position of the motor, m.
    pub motor: Vec<f64>,
}

/// Whether dry friction holds the motor, or which way it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Stick,
    Slip(f64),
}

struct Axis<'a> {
    machine: &'a ServoAxis,
    effects: &'a [AxisEffect],
    record: usize,
    bodies: [f64; 4],
    is_dry: bool,
    lag: f64,
    /// Random force of unit deviation at the samples.
    random: Vec<f64>,
}

/// What the drive gives during a part of a sample.
#[derive(Clone, Copy)]
struct Held {
    command: f64,
    /// Force of a lagging drive when the part begins, and that time.
    lagging: f64,
    since: f64,
}

impl ServoAxis {
    /// A record of so many samples along setpoints, the first at rest where they begin.
    ///
    /// # Errors
    /// [`PlantError::Diverged`].
    pub fn run(
        &self,
        effects: &[AxisEffect],
        moves: &AxisMoves,
        (record, samples): (usize, usize),
    ) -> Result<AxisRun, PlantError> {
        let (mass, step) = (self.mass_kg, 1.0 / self.rate_hz);
        let sampled = |k: usize, reading: &[f64]| {
            let t = k as f64 * step;
            let [r, r1, r2] = moves.at(t);
            let (feedback, g) = match self.drive {
                Drive::Tracking {
                    bandwidth_hz,
                    feedforward,
                } => {
                    let w = TAU * bandwidth_hz;
                    let last = reading.len().saturating_sub(2);
                    let speed = (reading[reading.len() - 1] - reading[last]) * self.rate_hz;
                    let off = r - reading[reading.len() - 1];
                    (mass * w * (w * off + 1.4 * (r1 - speed)), feedforward)
                }
                Drive::Open { feedforward } => (0.0, feedforward),
            };
            let spring = self.stiffness_n_per_m * r;
            feedback + g * mass * r2 + self.viscous_n_s_per_m * r1 + spring + self.offset_n
        };
        self.along(
            effects,
            (record, samples),
            [moves.at(0.0)[0], moves.at(0.0)[1]],
            self.speed(moves, samples),
            sampled,
        )
    }

    /// The answer to commands that are given.
    ///
    /// # Errors
    /// [`PlantError::Diverged`].
    pub fn answer(&self, inputs: &[f64], start: [f64; 2], speed: f64) -> Result<AxisRun, PlantError> {
        self.along(&[], (0, inputs.len()), start, speed, |k, _| inputs[k])
    }

    /// The same with effects.
    #[cfg(test)]
    pub(super) fn along_with(
        &self,
        effects: &[AxisEffect],
        inputs: &[f64],
        start: [f64; 2],
    ) -> Result<AxisRun, PlantError> {
        self.along(effects, (0, inputs.len()), start, start[1].abs(), |k, _| {
            inputs[k]
        })
    }

    /// Highest speed of setpoints.
    pub fn speed(&self, moves: &AxisMoves, samples: usize) -> f64 {
        let speeds = (0..samples).map(|k| moves.at(k as f64 / self.rate_hz)[1].abs());
        speeds.fold(0.0, f64::max)
    }

    fn along(
        &self,
        effects: &[AxisEffect],
        (record, samples): (usize, usize),
        start: [f64; 2],
        speed: f64,
        command: impl Fn(usize, &[f64]) -> f64,
    ) -> Result<AxisRun, PlantError> {
        let axis = Axis::new(self, effects, (record, samples));
        let step = 1.0 / self.rate_hz;
        let delay: f64 = effects
            .iter()
            .map(|e| {
                if let AxisEffect::Delay { time } = e {
                    *time
                } else {
                    0.0
                }
            })
            .sum();
        let (late, part) = ((delay / step).floor(), (delay / step).fract());
        let parts = axis.parts(speed, step);
        let mut state = [start[0], start[1], start[0], start[1], 0.0];
        // What a drive that is late still has from the time at rest.
        let rest = self.offset_n + self.stiffness_n_per_m * start[0];
        let mut held = Held {
            command: rest,
            lagging: rest,
            since: 0.0,
        };
        let mut run = AxisRun {
            inputs: Vec::with_capacity(samples),
            outputs: vec![Vec::with_capacity(samples); self.encoders()],
            exact: Vec::with_capacity(samples),
            motor: Vec::with_capacity(samples),
        };
        let mut played = start[0];
        for k in 0..samples {
            let t = k as f64 * step;
            axis.read(&state, t, &mut played, &mut run);
            let u = command(k, &run.outputs[0]);
            run.inputs.push(u);
            let given = |back: f64| {
                let at = k as f64 - back;
                if at < 0.0 { rest } else { run.inputs[at as usize] }
            };
            for (from, to, u) in [(0.0, part, given(late + 1.0)), (part, 1.0, given(late))] {
                let (from, to) = (t + from * step, t + to * step);
                if to <= from {
                    continue;
                }
                held = axis.hold(held, u, from);
                let count = (parts as f64 * (to - from) / step).ceil().max(1.0);
                let h = (to - from) / count;
                for i in 0..count as usize {
                    axis.advance(&mut state, (from + i as f64 * h, h), &held);
                }
            }
            if !state.iter().all(|x| x.is_finite()) {
                return Err(PlantError::Diverged { sample: k });
            }
        }
        Ok(run)
    }
}

impl<'a> Axis<'a> {
    fn new(machine: &'a ServoAxis, effects: &'a [AxisEffect], (record, samples): (usize, usize)) -> Self {
        let lag = effects.iter().map(|e| {
            if let AxisEffect::ActuatorLag { time_constant } = e {
                *time_constant
            } else {
                0.0
            }
        });
        let mut random = Vec::new();
        if let Some((corner, seed)) = effects.iter().find_map(|e| match e {
            AxisEffect::RandomForce { corner, seed, .. } => Some((*corner, *seed)),
            _ => None,
        }) {
            let mut rng = ChaCha8Rng::seed_from_u64(split_seed(seed, &record.to_string()));
            let keep = (-TAU * corner / machine.rate_hz).exp();
            let mut now = 0.0;
            for _ in 0..=samples {
                // Of unit deviation, near enough to a normal one.
                let white = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                now = keep * now + (1.0 - keep * keep).sqrt() * white;
                random.push(now);
            }
        }
        Self {
            machine,
            effects,
            record,
            bodies: machine.bodies(),
            is_dry: effects.iter().any(AxisEffect::is_dry),
            lag: lag.sum(),
            random,
        }
    }

    /// Parts of a sample.
    fn parts(&self, speed: f64, step: f64) -> usize {
        let [motor, load, stiffness, _] = self.bodies;
        let mut fastest = (self.machine.stiffness_n_per_m / motor).sqrt();
        if load > 0.0 {
            fastest = fastest.max((stiffness * (1.0 / motor + 1.0 / load)).sqrt());
        }
        let effects = self.effects.iter().map(|e| e.fastest(speed, motor));
        let fastest = effects.fold(fastest, f64::max);
        ((fastest * step / PHASE).ceil() as usize).clamp(PARTS[0], PARTS[1])
    }

    fn read(&self, state: &State, time: f64, played: &mut f64, run: &mut AxisRun) {
        let [motor, load] = [state[0], state[2]];
        run.motor.push(motor);
        let mut encoders = match self.machine.load.map(|l| l.encoders) {
            None | Some(Encoders::Motor) => vec![motor],
            Some(Encoders::Load) => vec![load],
            Some(Encoders::Both) => vec![motor, load],
        };
        for e in self.effects {
            if let AxisEffect::Backlash { gap } = e {
                *played = played.clamp(encoders[0] - 0.5 * gap, encoders[0] + 0.5 * gap);
                encoders[0] = *played;
            }
            encoders[0] = e.sensed(encoders[0], time);
        }
        run.exact.push(encoders[0]);
        for (i, y) in encoders.into_iter().enumerate() {
            let coarse = self.effects.iter().find_map(|e| match e {
                AxisEffect::Quantization { step } if i == 0 => Some(*step),
                _ => None,
            });
            let step = coarse.unwrap_or(self.machine.resolution_m);
            run.outputs[i].push(step * (y / step).round());
        }
    }

    fn hold(&self, held: Held, command: f64, from: f64) -> Held {
        Held {
            command,
            lagging: self.drive(&held, from),
            since: from,
        }
    }

    /// Force before it saturates.
    fn drive(&self, held: &Held, time: f64) -> f64 {
        if self.lag > 0.0 {
            held.command + (held.lagging - held.command) * (-(time - held.since) / self.lag).exp()
        } else {
            held.command
        }
    }

    fn moment(&self, x: &State, time: f64) -> Moment {
        let [position, speed, _, _, bend] = *x;
        Moment {
            record: self.record,
            time,
            position,
            speed,
            bend,
            random: self.random_at(time),
        }
    }

    /// What the drive gives.
    fn driven(&self, at: &Moment, held: &Held) -> f64 {
        let command = self.drive(held, at.time);
        let effects = self.effects.iter();
        effects.fold(command, |u, e| e.driven(u, at.position, self.record))
    }

    /// Forces on the motor but dry friction, and on the load.
    fn forces(&self, x: &State, time: f64, held: &Held) -> [f64; 2] {
        let [q, v, load, load_speed, _] = *x;
        let m = self.machine;
        let at = self.moment(x, time);
        let drive = self.driven(&at, held);
        let hidden: f64 = self.effects.iter().map(|e| e.force(&at)).sum();
        let force = hidden - m.viscous_n_s_per_m * v - m.stiffness_n_per_m * q - m.offset_n;
        let [_, _, stiffness, damping] = self.bodies;
        let bent = [q - load, v - load_speed];
        let coupled = self
            .effects
            .iter()
            .find_map(|e| e.pull([stiffness, damping], bent));
        let pull = coupled.unwrap_or(stiffness * bent[0] + damping * bent[1]);
        [drive + force - pull, pull]
    }

    fn random_at(&self, time: f64) -> f64 {
        let at = time * self.machine.rate_hz;
        let i = at as usize;
        match (self.random.get(i), self.random.get(i + 1)) {
            (Some(a), Some(b)) => a + (b - a) * at.fract(),
            _ => 0.0,
        }
    }

    fn dry(&self, x: &State, time: f64, held: &Held, sign: f64) -> f64 {
        let at = self.moment(x, time);
        let drive = self.driven(&at, held);
        self.effects.iter().map(|e| e.dry(&at, drive, sign)).sum()
    }

    fn rates(&self, x: &State, time: f64, held: &Held, mode: Mode) -> State {
        let [force, pull] = self.forces(x, time, held);
        let more: f64 = self.effects.iter().map(|e| e.mass(time, self.record)).sum();
        let [motor, load] = match self.bodies {
            [motor, load, ..] if load > 0.0 => [motor, load + more],
            [motor, ..] => [motor + more, 0.0],
        };
        let speed = x[1];
        let acceleration = match mode {
            Mode::Stick => 0.0,
            Mode::Slip(sign) => (force - sign * self.dry(x, time, held, sign)) / motor,
        };
        let bristle = self.effects.iter().find_map(|e| match e {
            AxisEffect::Hysteresis { distance, .. } => Some(speed - speed.abs() * x[4] / distance),
            _ => None,
        });
        let load = if load > 0.0 { pull / load } else { acceleration };
        [speed, acceleration, x[3], load, bristle.unwrap_or(0.0)]
    }

    fn rule(&self, x: &State, (time, h): (f64, f64), held: &Held, mode: Mode) -> State {
        let moved = |k: &State, h: f64| -> State { std::array::from_fn(|i| x[i] + h * k[i]) };
        let a = self.rates(x, time, held, mode);
        let b = self.rates(&moved(&a, 0.5 * h), time + 0.5 * h, held, mode);
        let c = self.rates(&moved(&b, 0.5 * h), time + 0.5 * h, held, mode);
        let d = self.rates(&moved(&c, h), time + h, held, mode);
        std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
    }

    /// A step; where dry friction makes the motor stop in it, from there on with the motor at rest or off again.
    fn advance(&self, x: &mut State, (mut time, h): (f64, f64), held: &Held) {
        /// Stops in one step after which the motor counts as at rest, and halvings that find one.
        const STOPS: usize = 8;
        const HALVINGS: usize = 40;
        let end = time + h;
        for stop in 0..=STOPS {
            let mode = match () {
                () if !self.is_dry => Mode::Slip(0.0),
                () if x[1] != 0.0 => Mode::Slip(x[1].signum()),
                () => {
                    let force = self.forces(x, time, held)[0];
                    match force.abs() <= self.dry(x, time, held, force.signum()) || stop == STOPS {
                        true => Mode::Stick,
                        false => Mode::Slip(force.signum()),
                    }
                }
            };
            let next = self.rule(x, (time, end - time), held, mode);
            let turns = |y: &State| matches!(mode, Mode::Slip(s) if y[1] * s < 0.0);
            if !turns(&next) {
                *x = next;
                return;
            }
            let (mut low, mut high) = (0.0, end - time);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                match turns(&self.rule(x, (time, middle), held, mode)) {
                    true => high = middle,
                    false => low = middle,
                }
            }
            *x = self.rule(x, (time, low), held, mode);
            x[1] = 0.0;
            time += low;
        }
    }
}
