//! One simulation on its way, stage by stage.

use super::exponential::{self, is_stiff};
use super::late::{Lag, delayed};
use super::{Response, Run};
use crate::base::{Body, Forces, Pair, Stiff};
use crate::effect::Moment;
use crate::track::smooth;
use lpv_core::ControllerState;

/// A simulation on its way.
pub(super) struct Lane<'a, B, const N: usize> {
    pub(super) run: &'a Run<'a>,
    body: &'a B,
    x: [f64; N],
    controller: Option<ControllerState>,
    /// Times by which the commands come late.
    delay: Pair,
    is_late: bool,
    lag: [Option<Lag>; 2],
    /// Input before the first sample.
    before: Pair,
    /// Forces of the motors behind the lag.
    lagged: Pair,
    pub(super) response: Response,
    /// Inputs of the sample, and the controller's part of them.
    u: Pair,
    own: Pair,
    /// Start, middle and end of the part, and forces of the motors there.
    points: [usize; 3],
    motors: [Pair; 3],
    /// At the four stages.
    rates: [[f64; N]; 4],
    /// Dry friction where it is stiff in the part.
    stiff: Option<Stiff>,
    /// Steps that such parts may still take.
    budget: usize,
}

impl<'a, B: Body, const N: usize> Lane<'a, B, N> {
    pub(super) fn new(run: &'a Run<'a>, body: &'a B) -> Self {
        let (track, blocks) = (run.track, run.blocks);
        let sum =
            |pairs: &mut dyn Iterator<Item = Pair>| pairs.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let delay = sum(&mut blocks.iter().map(|b| b.delay()));
        // Before the first sample there was no command, or the first one where the machine moves already or was held at rest by it.
        let before = if track.moving.is_some() || track.follows {
            track.inputs[0]
        } else {
            [0.0; 2]
        };
        let mut lane = Self {
            run,
            body,
            x: [0.0; N],
            controller: run
                .controller
                .map(|at_rest| track.moving.as_ref().unwrap_or(at_rest).clone()),
            delay,
            is_late: delay.iter().any(|d| *d > 0.0),
            lag: sum(&mut blocks.iter().map(|b| b.lag())).map(|lag| Lag::new(lag, run.part)),
            before,
            lagged: body.commanded(track.path[0][0], before),
            response: Response {
                outputs: Vec::with_capacity(track.samples),
                inputs: Vec::with_capacity(track.samples),
                motions: Vec::with_capacity(if run.is_watched { track.samples } else { 0 }),
            },
            u: [0.0; 2],
            own: [0.0; 2],
            points: [0; 3],
            motors: [[0.0; 2]; 3],
            rates: [[0.0; N]; 4],
            stiff: None,
            budget: exponential::budget(run.track.samples * run.parts),
        };
        lane.begin();
        let first = run.moment(body, &lane.x, (0, 0), true);
        let mut from = run.machine.states();
        for (block, states) in blocks.iter().zip(&run.own) {
            block.start(&first, &mut lane.x[from..from + states]);
            from += states;
        }
        lane
    }

    /// Where the record begins; where its first reading is meant, below what the sensor adds there.
    fn begin(&mut self) {
        /// Corrections of a position by the error that its sensor has there.
        const ROUNDS: usize = 3;
        let (run, body) = (self.run, self.body);
        let (track, bodies) = (run.track, run.machine.states());
        let mut start = track.start;
        for _ in 0..=ROUNDS {
            body.begin(track.path[0][0], &start, &mut self.x[..bodies]);
            let at = run.moment(body, &self.x, (0, 0), true);
            let truth = body.outputs(&self.x, at.p);
            let mut told = truth;
            self.sense(&at, &mut told);
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
    fn sense(&self, at: &Moment<'_>, outputs: &mut Pair) {
        let mut from = self.run.machine.states();
        for (block, states) in self.run.blocks.iter().zip(&self.run.own) {
            block.sense(at, &self.x[from..from + states], outputs);
            from += states;
        }
    }

    /// Outputs and inputs of a sample; whether the outputs are within their bounds.
    pub(super) fn read(&mut self, k: usize) -> bool {
        let (run, body, track) = (self.run, self.body, self.run.track);
        let now = run.moment(body, &self.x, (k, 0), true);
        if run.is_watched {
            self.response.motions.push(now.motion);
        }
        let mut y = body.outputs(&self.x, now.p);
        self.sense(&now, &mut y);
        if let Some(noise) = run.noise {
            (0..2).for_each(|i| y[i] += noise[k][i]);
        }
        self.own = [0.0; 2];
        if let Some(controller) = &mut self.controller {
            controller.step(&track.references[k], &y, &mut self.own);
        }
        self.u = [0, 1].map(|i: usize| self.logged()[k][i] + self.own[i]);
        self.response.outputs.push(y);
        self.response.inputs.push(self.u);
        // Also where an output is not a number.
        (0..2).all(|i| y[i].abs() <= track.bound[i])
    }

    /// Inputs that are added to those of the controller, or all.
    fn logged(&self) -> &'a [Pair] {
        match self.run.controller {
            Some(_) => &self.run.track.injections,
            None => &self.run.track.inputs,
        }
    }

    /// Forces of the motors over a part of a sample.
    #[inline(always)]
    pub(super) fn drive(&mut self, k: usize, part: usize) {
        let (run, track) = (self.run, self.run.track);
        let from = 2 * part * run.stride;
        self.points = [from, from + run.stride, from + 2 * run.stride];
        let mut commands = [self.u; 3];
        if track.runs_on {
            let first = 2 * track.substeps * k;
            for i in 0..run.machine.channels() {
                let late = self.delay[i] / track.step;
                let is_told = late == 0.0 && run.controller.is_some();
                for (command, point) in commands.iter_mut().zip(self.points) {
                    command[i] = self.own[i]
                        + match is_told {
                            true => track.between[first + point][i],
                            false => {
                                let time = k as f64 + point as f64 * track.half - late;
                                smooth::at(self.logged(), i, time)
                            }
                        };
                }
            }
        } else if self.is_late {
            let wide = 1.0 / run.parts as f64;
            let start = k as f64 + part as f64 * wide;
            for i in (0..2).filter(|i| self.delay[*i] > 0.0) {
                let late = self.delay[i] / track.step;
                let sent = |k: Option<usize>| k.map_or(self.before, |k| self.response.inputs[k])[i];
                let line = delayed(sent, k, [start - late, start - late + wide]).along();
                (0..3).for_each(|stage| commands[stage][i] = line[stage]);
            }
        }
        let motor = |i: usize| self.body.commanded(track.at(k, self.points[i])[0], commands[i]);
        self.motors = [motor(0), motor(1), motor(2)];
        for (i, lag) in self.lag.iter().enumerate() {
            if let Some(lag) = lag {
                let line = lag.follow(&mut self.lagged[i], self.motors.map(|m| m[i])).along();
                (0..3).for_each(|stage| self.motors[stage][i] = line[stage]);
            }
        }
    }

    /// Rates at one of the four stages of a part.
    #[inline(always)]
    pub(super) fn stage<const STAGE: usize>(&mut self, k: usize) {
        if STAGE > 0 && self.stiff.is_some() {
            return;
        }
        let h = self.run.part;
        let along =
            |rates: &[f64; N], h: f64| -> [f64; N] { std::array::from_fn(|i| self.x[i] + h * rates[i]) };
        let (x, point) = match STAGE {
            0 => (self.x, 0),
            1 => (along(&self.rates[0], 0.5 * h), 1),
            2 => (along(&self.rates[1], 0.5 * h), 1),
            _ => (along(&self.rates[2], h), 2),
        };
        let (rates, forces) = self.rates_at(&x, (k, self.points[point]), self.motors[point]);
        self.rates[STAGE] = rates;
        if STAGE == 0 {
            let here = self.body.stiff(&forces);
            self.stiff = here.filter(|here| is_stiff(here, &self.x, &rates, h));
        }
    }

    /// The end of a part in which dry friction is stiff, in steps of their own.
    #[inline(never)]
    fn rubbed(&mut self, k: usize, first: Stiff) -> [f64; N] {
        let h = self.run.part;
        let none = Stiff {
            rate: 0.0,
            rate_at_rest: 0.0,
            ..first
        };
        // What acts changes little in a part beside the speed.
        let told = |x: &[f64; N], time: f64| {
            let [start, middle, end] = self.motors;
            let motors = [0, 1].map(|i| {
                let (slope, bend) = (
                    4.0 * middle[i] - 3.0 * start[i] - end[i],
                    2.0 * (start[i] - 2.0 * middle[i] + end[i]),
                );
                start[i] + time * (slope + time * bend)
            });
            let point = self.points[(2.0 * time).round() as usize];
            let (rates, forces) = self.rates_at(x, (k, point), motors);
            (rates, self.body.stiff(&forces).unwrap_or(none))
        };
        let mut budget = self.budget;
        let end = exponential::part(self.x, (self.rates[0], first), h, &mut budget, told);
        self.budget = budget;
        end
    }

    #[inline(always)]
    fn rates_at(&self, x: &[f64; N], at: (usize, usize), motors: Pair) -> ([f64; N], Forces) {
        let (run, bodies) = (self.run, self.run.machine.states());
        let at = run.moment(self.body, x, at, !run.blocks.is_empty());
        let mut forces = Forces {
            motors,
            ..Forces::default()
        };
        // Apart from those of the machine, which then need not go through the memory.
        let mut own_rates = [0.0; N];
        let mut from = bodies;
        for (block, states) in run.blocks.iter().zip(&run.own) {
            let own = from..from + states;
            block.act(&at, &x[own.clone()], &mut own_rates[own], &mut forces);
            from += states;
        }
        let to_load = run.to_load * self.own[0];
        forces.motors[0] -= to_load;
        forces.load[0] += to_load;
        let mut rates = [0.0; N];
        self.body.rates(x, at.p, &forces, &mut rates);
        (
            std::array::from_fn(|i| if i < bodies { rates[i] } else { own_rates[i] }),
            forces,
        )
    }

    /// To the end of the part.
    #[inline(always)]
    pub(super) fn advance(&mut self, k: usize) {
        if let Some(stiff) = self.stiff {
            self.x = self.rubbed(k, stiff);
            return;
        }
        let h = self.run.part;
        let [k1, k2, k3, k4] = &self.rates;
        // States that there are not stay zero.
        self.x = std::array::from_fn(|i| self.x[i] + h / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i])));
    }
}
