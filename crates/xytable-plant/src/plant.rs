//! The bodies between commands and readings, with whatever is hidden in them.

use crate::effects::{Effect, Forces, Moment};
use crate::mechanics::{Mechanics, State};
use crate::{HiddenEffect, Machine, MachineParameters};
use std::collections::VecDeque;
use std::ops::Range;

/// Whether sensors that round do so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rounding {
    /// As the sensors do.
    Sensor,
    /// Not, to judge the integration.
    Off,
}

/// One effect and the place of its states among those of all effects.
struct Hidden {
    effect: Box<dyn Effect>,
    states: Range<usize>,
}

/// Memory of a step, one place for each state of the effects: every effect writes all its rates at every stage.
#[derive(Default)]
struct Buffers {
    stage: Vec<f64>,
    rates: Vec<f64>,
    sum: Vec<f64>,
}

/// The moving machine: by Taylor series where nothing is hidden in it, by Runge-Kutta steps else.
pub(crate) struct Plant {
    mechanics: Mechanics,
    machine: MachineParameters,
    hidden: Vec<Hidden>,
    x: State,
    own: Vec<f64>,
    buffers: Buffers,
    sample_time: f64,
    sample: usize,
    /// Delay in whole samples and the rest as a part of one, and the commands on their way, oldest first.
    late: f64,
    commands: VecDeque<[f64; 2]>,
}

impl Plant {
    /// At rest at `[x1, y'_1, y'_2]`.
    pub(crate) fn new(
        machine: &Machine,
        effects: &[HiddenEffect],
        sample_time: f64,
        start: [f64; 3],
    ) -> Self {
        let effects: Vec<Box<dyn Effect>> = effects.iter().map(|e| e.make(machine.parameters())).collect();
        let nominal = Mechanics::new(machine);
        let mut parameters = *machine.parameters();
        effects.iter().for_each(|e| e.mount(&mut parameters));
        let mechanics = Mechanics::new(&Machine { parameters }).decoupled_as(&nominal);
        let x = Mechanics::at_rest(start[0], [start[1], start[2]]);
        let delay: f64 = effects.iter().map(|e| e.delay()).sum::<f64>() / sample_time;
        let mut own = Vec::new();
        let hidden = effects
            .into_iter()
            .map(|effect| {
                let first = own.len();
                own.extend(effect.start(&x));
                Hidden {
                    effect,
                    states: first..own.len(),
                }
            })
            .collect();
        let zeros = || vec![0.0; own.len()];
        Self {
            mechanics,
            machine: parameters,
            hidden,
            x,
            buffers: Buffers {
                stage: zeros(),
                rates: zeros(),
                sum: zeros(),
            },
            own,
            sample_time,
            sample: 0,
            late: delay.fract(),
            // Before the record nothing was commanded.
            commands: VecDeque::from(vec![[0.0; 2]; delay.floor() as usize + 1]),
        }
    }

    pub(crate) fn position(&self) -> f64 {
        self.x[0]
    }
    pub(crate) fn is_finite(&self) -> bool {
        self.x.iter().chain(&self.own).all(|v| v.is_finite())
    }
    pub(crate) fn rounds(&self) -> bool {
        self.hidden.iter().any(|h| h.effect.resolution().is_some())
    }

    /// What the sensors read at the sample instant.
    pub(crate) fn measure(&self, noise: [f64; 2], rounding: Rounding) -> [f64; 2] {
        let mut y = Mechanics::outputs(&self.x);
        let at = self.moment(self.sample as f64 * self.sample_time, &self.x);
        self.hidden.iter().for_each(|h| h.effect.sense(&at, &mut y));
        let mut read = [y[0] + noise[0], y[1] + noise[1]];
        if rounding == Rounding::Sensor {
            for step in self.hidden.iter().filter_map(|h| h.effect.resolution()) {
                read = [0, 1].map(|i: usize| step[i] * (read[i] / step[i]).round());
            }
        }
        read
    }

    /// Whether nothing is hidden in it: steps are then exact up to rounding.
    pub(crate) fn is_plain(&self) -> bool {
        self.hidden.is_empty()
    }

    /// On to the next sample with held `F_x` and u', in `substeps` steps, or in as many times 2 as series need; with effects, in
    /// that many before and after the moment when a delayed command arrives. The number of steps; none where 1024 times as many
    /// are too few for the resonances.
    pub(crate) fn advance(&mut self, f_x: f64, u: [f64; 2], substeps: usize) -> Option<usize> {
        let t = self.sample_time;
        if self.is_plain() {
            let mut steps = substeps;
            while steps <= 1024 * substeps {
                let h = t / steps as f64;
                let end = (0..steps).try_fold(self.x, |x, _| self.mechanics.step(&x, f_x, u, h));
                if let Some(end) = end {
                    self.x = end;
                    return Some(steps);
                }
                steps *= 2;
            }
            return None;
        }
        self.commands.push_back(u);
        let start = self.sample as f64 * t;
        let old = self.commands.pop_front().unwrap_or(u);
        let new = self.commands.front().copied().unwrap_or(u);
        for (from, to, command) in [(0.0, self.late, old), (self.late, 1.0, new)] {
            let h = (to - from) * t / substeps as f64;
            if h > 0.0 {
                for i in 0..substeps {
                    self.step(start + from * t + i as f64 * h, f_x, command, h);
                }
            }
        }
        self.sample += 1;
        Some(substeps)
    }

    fn moment<'a>(&'a self, time: f64, state: &'a State) -> Moment<'a> {
        Moment {
            time,
            state,
            machine: &self.machine,
        }
    }

    /// One classical Runge-Kutta step over the bodies and the states of the effects.
    fn step(&mut self, time: f64, f_x: f64, u: [f64; 2], h: f64) {
        // Taken out for the time of the step, so that the rates can borrow the rest.
        let mut buffers = std::mem::take(&mut self.buffers);
        let Buffers { stage, rates, sum } = &mut buffers;
        let x = self.x;
        let (mut stage_x, mut sum_x) = (x, [0.0; 10]);
        stage.copy_from_slice(&self.own);
        sum.fill(0.0);
        for (ahead, next, weight) in [(0.0, 0.5, 1.0), (0.5, 0.5, 2.0), (0.5, 1.0, 2.0), (1.0, 0.0, 1.0)] {
            let rates_x = self.rates(time + ahead * h, (&stage_x, stage), f_x, u, rates);
            for i in 0..x.len() {
                sum_x[i] += weight * rates_x[i];
                stage_x[i] = x[i] + next * h * rates_x[i];
            }
            for i in 0..sum.len() {
                sum[i] += weight * rates[i];
                stage[i] = self.own[i] + next * h * rates[i];
            }
        }
        self.x = std::array::from_fn(|i| x[i] + h / 6.0 * sum_x[i]);
        for (own, sum) in self.own.iter_mut().zip(sum) {
            *own += h / 6.0 * *sum;
        }
        self.buffers = buffers;
    }

    /// Rates of the bodies, and of the states of the effects in `own_rates`.
    fn rates(
        &self,
        time: f64,
        (x, own): (&State, &[f64]),
        f_x: f64,
        u: [f64; 2],
        own_rates: &mut [f64],
    ) -> State {
        let at = self.moment(time, x);
        let mut forces = Forces {
            motors: self.mechanics.beam_forces(x[0], u),
            bodies: [0.0; 5],
        };
        for Hidden { effect, states } in &self.hidden {
            let rates = &mut own_rates[states.clone()];
            effect.act(&at, &own[states.clone()], rates, &mut forces);
        }
        let [left, right] = forces.motors;
        let mut rates = self.mechanics.rates(x, [f_x, left, right]);
        for i in 0..5 {
            rates[5 + i] += forces.bodies[i] * self.mechanics.inverse_masses[i];
        }
        rates
    }
}

#[cfg(test)]
impl Plant {
    pub(crate) fn machine(&self) -> &MachineParameters {
        &self.machine
    }
    pub(crate) fn state(&self) -> &State {
        &self.x
    }
    pub(crate) fn state_mut(&mut self) -> &mut State {
        &mut self.x
    }
    pub(crate) fn own_mut(&mut self) -> &mut [f64] {
        &mut self.own
    }
}
