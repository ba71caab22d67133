//! A base model with effects in the loop of the experiment.

mod late;
mod smooth;

use crate::base::{Base, Body, Forces, MOST_STATES, Motion, Pair};
use crate::effect::{Block, Moment};
use crate::fit::Explained;
use crate::track::Track;
use late::{Lag, delayed};
use lpv_core::ControllerState;

/// Response of a closed loop to the references of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Outputs as the sensors tell them, by sample.
    pub outputs: Vec<Pair>,
    /// Inputs of the machine, by sample.
    pub inputs: Vec<Pair>,
}

impl Response {
    /// What the outputs of a record are beside these, by sample.
    pub fn error(&self, track: &Track) -> Vec<Pair> {
        track.error(&self.outputs)
    }
}

impl Explained {
    /// Response in the closed loop of a record. None where the numbers leave all bounds.
    pub fn closed_loop(&self, controller: &ControllerState, track: &Track) -> Option<Response> {
        simulate(&self.base, &self.blocks(), controller, track, None, &mut ())
    }

    /// Response to the recorded inputs. None where the numbers leave all bounds.
    pub fn open_loop(&self, track: &Track) -> Option<Response> {
        simulate_in(
            track.fine(),
            &self.base,
            &self.blocks(),
            None,
            track,
            None,
            &mut (),
        )
    }

    /// Motion in the closed loop of a record, by sample. None where the numbers leave all bounds.
    pub fn motions(&self, controller: &ControllerState, track: &Track) -> Option<Vec<Motion>> {
        let mut motions = Vec::with_capacity(track.samples);
        simulate(&self.base, &self.blocks(), controller, track, None, &mut motions)?;
        Some(motions)
    }

    /// What the effects do to the forces of the motors along a motion of a record, by sample; effects with states of their own
    /// stay at their start.
    pub fn forces_along(&self, track: &Track, motions: &[Motion]) -> Vec<Pair> {
        let blocks = self.blocks();
        let mut own = [0.0; MOST_STATES];
        let mut rates = own;
        motions
            .iter()
            .enumerate()
            .map(|(k, motion)| {
                let [p, rate] = track.scheduling(k);
                let at = Moment {
                    time: k as f64 * track.step,
                    p,
                    rate,
                    step: track.step,
                    motion: *motion,
                    machine: &self.base,
                    track,
                    sample: k,
                    part: 0.0,
                };
                let mut forces = Forces::default();
                for block in &blocks {
                    let states = block.states();
                    block.start(&at, &mut own[..states]);
                    block.act(&at, &own[..states], &mut rates[..states], &mut forces);
                }
                // What the mass takes that is more.
                forces.motors[0] -= forces.mass * acceleration(motions, k, track.step);
                forces.motors
            })
            .collect()
    }
}

/// Acceleration of the load at a sample, from its speeds at those beside it.
pub(crate) fn acceleration(motions: &[Motion], k: usize, step: f64) -> f64 {
    let (first, last) = (k.saturating_sub(1), (k + 1).min(motions.len() - 1));
    let speed = |k: usize| motions[k].load_speed[0];
    match last - first {
        0 => 0.0,
        samples => (speed(last) - speed(first)) / (samples as f64 * step),
    }
}

/// What is to be seen along a simulation beside the response.
pub(crate) trait Watch {
    fn sample(&mut self, _k: usize, _motion: &Motion) {}
}

impl Watch for () {}

impl Watch for Vec<Motion> {
    fn sample(&mut self, _k: usize, motion: &Motion) {
        self.push(*motion);
    }
}

/// Simulates a record from where it begins, see [`Track::new`], with the classical Runge-Kutta rule in equal parts of a sample.
/// Commands are held, unless the inputs of the record were measured ([`Track::running_on`]); where a delay changes them inside a part, or a lag the forces of the motors, it gets the straight line
/// with their mean and first moment there.
///
/// `noise` is added to the outputs before the controller reads them. None where the numbers leave all bounds.
pub(crate) fn simulate(
    base: &Base,
    blocks: &[Box<dyn Block>],
    controller: &ControllerState,
    track: &Track,
    noise: Option<&[Pair]>,
    watch: &mut impl Watch,
) -> Option<Response> {
    simulate_in(track.fine(), base, blocks, Some(controller), track, noise, watch)
}

/// The same in other equal parts of a sample, a divisor of those of the track; without a controller from the recorded
/// inputs.
pub(crate) fn simulate_in(
    parts: usize,
    base: &Base,
    blocks: &[Box<dyn Block>],
    controller: Option<&ControllerState>,
    track: &Track,
    noise: Option<&[Pair]>,
    watch: &mut impl Watch,
) -> Option<Response> {
    let mut machine = base.clone();
    blocks.iter().for_each(|b| b.mount(&mut machine));
    let run = Run {
        machine: &machine,
        blocks,
        own: blocks.iter().map(|b| b.states()).collect(),
        controller,
        track,
        noise,
        to_load: if track.follows {
            base.correction_of_load()
        } else {
            0.0
        },
        stride: track.substeps / parts,
        part: track.step / parts as f64,
        parts,
    };
    match &machine {
        Base::XyTable(body) => run.wide(body, watch),
        Base::Axis(body) => run.wide(body, watch),
        Base::Lpv(body) => run.wide(body, watch),
    }
}

/// One simulation.
struct Run<'a> {
    machine: &'a Base,
    blocks: &'a [Box<dyn Block>],
    /// States of the blocks.
    own: Vec<usize>,
    controller: Option<&'a ControllerState>,
    track: &'a Track,
    noise: Option<&'a [Pair]>,
    /// Part of what an observer gives that acts on the load.
    to_load: f64,
    /// Parts of a sample, how many of those of the track one is, and its time.
    parts: usize,
    stride: usize,
    part: f64,
}

impl Run<'_> {
    /// With room for the states that there are.
    fn wide(&self, body: &impl Body, watch: &mut impl Watch) -> Option<Response> {
        match self.machine.states() + self.own.iter().sum::<usize>() {
            0..=4 => self.run::<4>(body, watch),
            5..=8 => self.run::<8>(body, watch),
            9..=12 => self.run::<12>(body, watch),
            13..=MOST_STATES => self.run::<MOST_STATES>(body, watch),
            _ => None,
        }
    }

    fn run<const N: usize>(&self, body: &impl Body, watch: &mut impl Watch) -> Option<Response> {
        let (track, blocks) = (self.track, self.blocks);
        let at_rest = self.controller;
        let mut controller = at_rest.map(|at_rest| track.moving.as_ref().unwrap_or(at_rest).clone());
        let bodies = self.machine.states();
        let mut x = [0.0; N];
        self.begin(body, &mut x);
        let first = self.moment(body, &x, (0, 0), true);
        let mut from = bodies;
        for (block, states) in blocks.iter().zip(&self.own) {
            block.start(&first, &mut x[from..from + states]);
            from += states;
        }
        let sum =
            |pairs: &mut dyn Iterator<Item = Pair>| pairs.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let delay = sum(&mut blocks.iter().map(|b| b.delay()));
        let is_late = delay.iter().any(|d| *d > 0.0);
        let lag = sum(&mut blocks.iter().map(|b| b.lag())).map(|lag| Lag::new(lag, self.part));
        // Before the first sample there was no command, or the first one where the machine moves already or was held at rest by it.
        let before = if track.moving.is_some() || track.follows {
            track.inputs[0]
        } else {
            [0.0; 2]
        };
        let mut lagged = body.commanded(track.path[0][0], before);
        let mut response = Response {
            outputs: Vec::with_capacity(track.samples),
            inputs: Vec::with_capacity(track.samples),
        };
        for k in 0..track.samples {
            let now = self.moment(body, &x, (k, 0), true);
            watch.sample(k, &now.motion);
            let mut y = body.outputs(&x, now.p);
            self.sense(&now, &x, &mut y);
            if let Some(noise) = self.noise {
                (0..2).for_each(|i| y[i] += noise[k][i]);
            }
            let mut own = [0.0; 2];
            let logged = match &mut controller {
                Some(controller) => {
                    controller.step(&track.references[k], &y, &mut own);
                    &track.injections
                }
                None => &track.inputs,
            };
            let u = [0, 1].map(|i: usize| logged[k][i] + own[i]);
            response.outputs.push(y);
            response.inputs.push(u);
            // Also where an output is not a number.
            if !(0..2).all(|i| y[i].abs() <= track.bound[i]) {
                return None;
            }
            for part in 0..self.parts {
                let from = 2 * part * self.stride;
                let points = [from, from + self.stride, from + 2 * self.stride];
                let mut commands = [u; 3];
                if track.runs_on {
                    for i in 0..self.machine.channels() {
                        let late = delay[i] / track.step;
                        let time = |point: usize| k as f64 + point as f64 * track.half - late;
                        (0..3).for_each(|stage| {
                            commands[stage][i] = own[i] + smooth::at(logged, i, time(points[stage]));
                        });
                    }
                } else if is_late {
                    let wide = 1.0 / self.parts as f64;
                    let start = k as f64 + part as f64 * wide;
                    for i in (0..2).filter(|i| delay[*i] > 0.0) {
                        let late = delay[i] / track.step;
                        let sent = |k: Option<usize>| k.map_or(before, |k| response.inputs[k])[i];
                        let line = delayed(sent, k, [start - late, start - late + wide]).along();
                        (0..3).for_each(|stage| commands[stage][i] = line[stage]);
                    }
                }
                let motor = |i: usize| body.commanded(track.at(k, points[i])[0], commands[i]);
                let mut motors = [motor(0), motor(1), motor(2)];
                for (i, lag) in lag.iter().enumerate() {
                    if let Some(lag) = lag {
                        let line = lag.follow(&mut lagged[i], motors.map(|m| m[i])).along();
                        (0..3).for_each(|stage| motors[stage][i] = line[stage]);
                    }
                }
                self.runge_kutta(body, &mut x, (k, points), motors, self.to_load * own[0]);
            }
        }
        Some(response)
    }

    /// Where the record begins; where its first reading is meant, below what the sensor adds there.
    fn begin<const N: usize>(&self, body: &impl Body, x: &mut [f64; N]) {
        /// Corrections of a position by the error that its sensor has there.
        const ROUNDS: usize = 3;
        let (track, bodies) = (self.track, self.machine.states());
        let mut start = track.start;
        for _ in 0..=ROUNDS {
            body.begin(track.path[0][0], &start, &mut x[..bodies]);
            let at = self.moment(body, x, (0, 0), true);
            let truth = body.outputs(x, at.p);
            let mut told = truth;
            self.sense(&at, x, &mut told);
            let meant = track.start.position;
            let below = |i: usize| meant[i] - if track.is_read[i] { told[i] - truth[i] } else { 0.0 };
            let position = [0, 1].map(below);
            if position == start.position {
                break;
            }
            start.position = position;
        }
    }

    /// What the effects make of the outputs.
    fn sense<const N: usize>(&self, at: &Moment<'_>, x: &[f64; N], outputs: &mut Pair) {
        let mut from = self.machine.states();
        for (block, states) in self.blocks.iter().zip(&self.own) {
            block.sense(at, &x[from..from + states], outputs);
            from += states;
        }
    }

    /// One part of a sample.
    #[inline(always)]
    fn runge_kutta<const N: usize>(
        &self,
        body: &impl Body,
        x: &mut [f64; N],
        (k, points): (usize, [usize; 3]),
        motors: [Pair; 3],
        to_load: f64,
    ) {
        let h = self.part;
        let along = |rates: &[f64; N], h: f64| -> [f64; N] { std::array::from_fn(|i| x[i] + h * rates[i]) };
        let rates =
            |x: &[f64; N], stage: usize| self.rates(body, x, (k, points[stage]), motors[stage], to_load);
        let k1 = rates(x, 0);
        let k2 = rates(&along(&k1, 0.5 * h), 1);
        let k3 = rates(&along(&k2, 0.5 * h), 1);
        let k4 = rates(&along(&k3, h), 2);
        // States that there are not stay zero.
        *x = std::array::from_fn(|i| x[i] + h / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i])));
    }

    #[inline(always)]
    fn rates<const N: usize>(
        &self,
        body: &impl Body,
        x: &[f64; N],
        at: (usize, usize),
        motors: Pair,
        to_load: f64,
    ) -> [f64; N] {
        let mut out = [0.0; N];
        let at = self.moment(body, x, at, !self.blocks.is_empty());
        let mut forces = Forces {
            motors,
            ..Forces::default()
        };
        let mut from = self.machine.states();
        for (block, states) in self.blocks.iter().zip(&self.own) {
            let own = from..from + states;
            block.act(&at, &x[own.clone()], &mut out[own], &mut forces);
            from += states;
        }
        forces.motors[0] -= to_load;
        forces.load[0] += to_load;
        body.rates(x, at.p, &forces, &mut out);
        out
    }

    #[inline(always)]
    fn moment<const N: usize>(
        &self,
        body: &impl Body,
        x: &[f64; N],
        (k, point): (usize, usize),
        whole: bool,
    ) -> Moment<'_> {
        let part = point as f64 * self.track.half;
        let [p, rate] = self.track.at(k, point);
        Moment {
            time: (k as f64 + part) * self.track.step,
            p,
            rate,
            step: self.part,
            motion: if whole {
                body.motion(x, p)
            } else {
                Motion::default()
            },
            machine: self.machine,
            track: self.track,
            sample: k,
            part,
        }
    }
}

#[cfg(test)]
mod tests;
