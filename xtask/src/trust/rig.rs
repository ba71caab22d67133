//! The usual experiments: one axis in a loop or without one, its truth, and its records.

use super::bundle::Table;
use super::draw::Draw;
use super::judge::{Line, Truth};
use super::loops::{Controller, Run, Signals, loop_radius, multisine, repeated, setpoint_of, simulate};
use super::machine::{Axis, C64, Linear};
use std::f64::consts::TAU;

/// One axis with its clock, excitation and sensor.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    pub(crate) rate: f64,
    pub(crate) axis: Axis,
    pub(crate) machine: Linear,
    /// None of a machine that is measured in open loop.
    pub(crate) controller: Option<Controller>,
    pub(crate) period: usize,
    pub(crate) lines: Vec<usize>,
    /// Rms of the excitation, in the units of the input.
    pub(crate) force: f64,
    /// Deviation of the noise of the sensor.
    pub(crate) noise: f64,
}

impl Rig {
    /// A free mass with a mode, in the loop of a lead filter, that multisines excite; all sizes over decades.
    pub(crate) fn closed(draw: &mut Draw) -> Self {
        loop {
            let rate = draw.decades(100.0, 1e5);
            let axis = Axis::free(draw, rate);
            let bandwidth = axis.modes[0][0] / draw.uniform(6.0, 12.0);
            let controller = Controller::lead(axis.mass, bandwidth, 1.0 / rate);
            let machine = axis.linear().sampled(1.0 / rate);
            if loop_radius(&machine, std::slice::from_ref(&controller)) < 0.995 {
                return Self::excited(draw, rate, axis, Some(controller));
            }
        }
    }
    /// Modes alone, in open loop.
    pub(crate) fn open(draw: &mut Draw, modes: usize) -> Self {
        let rate = draw.decades(100.0, 1e5);
        let axis = Axis::flexible(draw, rate, modes);
        Self::excited(draw, rate, axis, None)
    }
    /// The rig of an axis: a period, its lines, the force, and a sensor that sees its weakest mode.
    pub(crate) fn excited(draw: &mut Draw, rate: f64, axis: Axis, controller: Option<Controller>) -> Self {
        let period = draw.pick([800, 1000, 1024]);
        let lines: Vec<usize> = (1..period * 2 / 5).collect();
        let force = draw.decades(1e-2, 1e2);
        let machine = axis.linear().sampled(1.0 / rate);
        // The noise stays below the output at nine lines of ten, by this much in one period.
        let mut sizes: Vec<f64> = lines
            .iter()
            .filter_map(|k| {
                let cycles = *k as f64 / period as f64;
                let plant = machine.response(cycles)?[(0, 0)];
                let loops = controller
                    .as_ref()
                    .map_or(C64::new(0.0, 0.0), |c| c.response(cycles));
                Some((plant / (C64::new(1.0, 0.0) + plant * loops)).norm())
            })
            .collect();
        sizes.sort_by(f64::total_cmp);
        let small = sizes.get(sizes.len() / 10).copied().unwrap_or(0.0);
        let line = force * (2.0 / lines.len() as f64).sqrt();
        let decibels = draw.uniform(15.0, 40.0);
        let noise = small * line * 10_f64.powf(-decibels / 20.0) * (period as f64).sqrt() / 2.0;
        Self {
            machine,
            rate,
            axis,
            controller,
            period,
            lines,
            force,
            noise,
        }
    }
    /// A period of the excitation force.
    pub(crate) fn excitation(&self, draw: &mut Draw) -> Vec<f64> {
        multisine(draw, self.period, &self.lines)
            .into_iter()
            .map(|v| v * self.force)
            .collect()
    }
    /// So many periods of one excitation, the first of them with the transient of a start at rest.
    pub(crate) fn periodic(&self, draw: &mut Draw, periods: usize) -> Signals {
        let force = self.excitation(draw);
        let reference = match &self.controller {
            Some(c) => setpoint_of(&force, c, &self.lines),
            None => force,
        };
        self.follow(draw, &repeated(&reference, periods))
    }
    /// Along a setpoint, or of an open loop under an input.
    pub(crate) fn follow(&self, draw: &mut Draw, reference: &[f64]) -> Signals {
        let run = Run {
            reference: vec![reference.to_vec()],
            noise: vec![self.noise],
            ..Run::default()
        };
        simulate(&self.machine, self.controller.as_slice(), &run, draw)
    }
    /// White excitation of the force's size that ends at its band, for a record without periods.
    pub(crate) fn random(&self, draw: &mut Draw, samples: usize) -> Vec<f64> {
        let mut last = 0.0;
        draw.noise(self.force, samples)
            .into_iter()
            .map(|v| {
                last = 0.3 * last + v;
                last
            })
            .collect()
    }
    /// The truth, its lines weighted by what the input held.
    pub(crate) fn truth(&self, signals: &Signals) -> Truth {
        let lines = self
            .lines
            .iter()
            .map(|k| *k as f64 / self.period as f64)
            .collect::<Vec<_>>();
        // Whole periods, so that no line leaks into another.
        let last = signals.u[0].len().saturating_sub(4 * self.period);
        self.weighted(signals, &lines, last)
    }
    /// The truth on lines in cycles a sample.
    pub(crate) fn truth_on(&self, signals: &Signals, cycles: &[f64]) -> Truth {
        self.weighted(signals, cycles, 0)
    }
    fn weighted(&self, signals: &Signals, cycles: &[f64], from: usize) -> Truth {
        let window = signals.u[0].len() - from;
        let line = |cycles: &f64| Line {
            cycles: *cycles,
            input: size(&signals.u[0][from..], *cycles),
            noise: self.noise * (window as f64).sqrt(),
        };
        let parameters = 2 * self.machine.a.nrows() + 2;
        // Of whole periods the lines alone hold something; without periods every sample does. Other periods add to both.
        let numbers = if from > 0 { 2 * cycles.len() } else { window };
        let periods = signals.u[0].len() as f64 / window as f64;
        Truth {
            places: vec![(0.0, self.machine.clone())],
            h: 1.0 / self.rate,
            lines: cycles.iter().map(line).collect(),
            share: parameters as f64 / (numbers as f64 * periods),
        }
    }
    /// The table of a record of one channel: `y, u, r`.
    pub(crate) fn table(signals: &Signals) -> Table {
        Table::of(signals)
    }
}

/// Size of a signal at a line, in cycles a sample.
pub(crate) fn size(signal: &[f64], cycles: f64) -> f64 {
    let step = C64::from_polar(1.0, -TAU * cycles);
    let (mut turn, mut sum) = (C64::new(1.0, 0.0), C64::new(0.0, 0.0));
    for v in signal {
        sum += turn * *v;
        turn *= step;
    }
    sum.norm()
}
