//! Formulas, and what they do in a simulation.

use super::formula::{Formula, is_taken};
use super::{UserEffect, UserParameter};
use crate::base::{Base, Forces, Pair};
use crate::catalogue::motor_forces;
use crate::effect::{Block, Moment, Place};
use std::collections::BTreeSet;

/// What every formula may use, in the order of a frame: time, position and speed of the motor and of the load, scheduling and its rate,
/// the input, the reading.
const KNOWN: [&str; 9] = ["t", "x", "v", "x_load", "v_load", "p", "p_rate", "u", "y"];
const INPUT: usize = 7;
const READING: usize = 8;
/// Numbers of a frame: what is known, parameters, states and further signals.
pub(super) const ROOM: usize = 48;
/// Numbers that formulas are evaluated at.
pub(super) type Frame = [f64; ROOM];

/// The formulas of an effect.
#[derive(Debug)]
pub(super) struct Law {
    output: Placed,
    pub(super) rates: Vec<Placed>,
    pub(super) start: Vec<f64>,
    /// Starts of each parameter, one zero for an amplitude.
    pub(super) parameters: Vec<Vec<f64>>,
    pub(super) amplitudes: usize,
    /// How each of the others is moved.
    pub(super) ways: Vec<Way>,
    signals: Vec<usize>,
}

/// How a parameter is moved before a fit: in steps as long as half of what lies between its starts, or by their factor, and not farther than
/// the next start would be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way {
    pub(super) step: f64,
    low: f64,
    high: f64,
    is_factor: bool,
}

impl Way {
    fn of(parameter: &UserParameter) -> Self {
        let is_factor = parameter.positive;
        let places = parameter
            .starts
            .iter()
            .map(|s| if is_factor { s.ln() } else { *s });
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = places.fold(ends, |(low, high), s| (low.min(s), high.max(s)));
        let gaps = parameter.starts.len().saturating_sub(1).max(1) as f64;
        let step = match (high > low, is_factor) {
            (true, _) => 0.5 * (high - low) / gaps,
            (false, true) => 0.5,
            (false, false) => 0.5 * high.abs().max(f64::MIN_POSITIVE),
        };
        Self {
            step,
            low: low - 2.0 * step,
            high: high + 2.0 * step,
            is_factor,
        }
    }

    /// A value moved by a step to one side.
    pub(super) fn moved(&self, value: f64, by: f64) -> f64 {
        let place = if self.is_factor { value.ln() } else { value };
        let place = (place + by).clamp(self.low, self.high);
        if self.is_factor { place.exp() } else { place }
    }
}

/// One formula, and where in a frame its variables are.
#[derive(Debug)]
pub(super) struct Placed {
    formula: Formula,
    from: Vec<usize>,
}

impl Placed {
    fn of(
        text: &str,
        what: &str,
        names: &[String],
        is_known: impl Fn(usize) -> Result<(), String>,
    ) -> Result<Self, String> {
        let formula = Formula::parse(text).map_err(|e| format!("{what} `{text}` is no formula: {e}"))?;
        let mut from = Vec::new();
        for name in formula.names() {
            let index = names.iter().position(|n| n == name);
            let index = index.ok_or_else(|| {
                format!(
                    "{what} `{text}` has `{name}`, which is none of {}; a signal that was measured beside them is known where [channels.auxiliary] \
                     names it",
                    names.join(", ")
                )
            })?;
            is_known(index)?;
            from.push(index);
        }
        Ok(Self { formula, from })
    }

    /// Not a number, or infinite, where it has no value.
    pub(super) fn at(&self, frame: &Frame) -> f64 {
        self.formula.at(|i| frame[self.from[i]])
    }

    fn uses(&self, index: usize) -> bool {
        self.from.contains(&index)
    }
}

impl Law {
    pub(super) fn of(effect: &UserEffect, auxiliary: &[String]) -> Result<Self, String> {
        let own = effect
            .ordered()
            .map(|(name, _)| name)
            .chain(effect.states.keys().map(String::as_str));
        let mut names: Vec<String> = KNOWN.map(str::to_owned).to_vec();
        names.extend(own.map(str::to_owned));
        let given = names.len();
        let mut seen = BTreeSet::new();
        for name in &names {
            let is_name = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                && name.starts_with(|c: char| c.is_ascii_alphabetic());
            if !is_name {
                return Err(format!(
                    "`{name}` is no name in a formula: give it letters, digits and _, a letter first"
                ));
            }
            if is_taken(name) || !seen.insert(name) {
                return Err(format!(
                    "`{name}` means something else in a formula; choose another name"
                ));
            }
        }
        let mut signals = Vec::new();
        for (index, name) in auxiliary.iter().enumerate() {
            if !names.contains(name) && names.len() < ROOM {
                names.push(name.clone());
                signals.push(index);
            }
        }
        if given > ROOM {
            return Err(format!(
                "it has more than {} parameters and states",
                ROOM - KNOWN.len()
            ));
        }
        let of_sensor = effect.is_of_sensor();
        let fits = |index: usize| match (index, of_sensor) {
            (INPUT, true) => Err("`u`, the input, is not known to a reading; use the motion".to_owned()),
            (READING, false) => {
                Err("`y`, the reading, is not known to a force; use `x`, the position".to_owned())
            }
            _ => Ok(()),
        };
        let rate_fits = |index: usize| match index {
            READING => {
                Err("`y`, the reading, is not known to the rate of a state; use `x`, the position".to_owned())
            }
            _ => Ok(()),
        };
        let (text, what) = match (&effect.force, &effect.reading) {
            (Some(force), _) => (force, "the force"),
            (None, Some(reading)) => (reading, "the reading"),
            (None, None) => return Err("it has no formula".to_owned()),
        };
        let output = Placed::of(text, what, &names, fits)?;
        let rate = |(name, state): (&String, &super::UserState)| {
            Placed::of(&state.rate, &format!("the rate of `{name}`"), &names, rate_fits)
        };
        let rates = effect.states.iter().map(rate).collect::<Result<Vec<_>, _>>()?;
        for (i, (name, _)) in effect.ordered().enumerate() {
            let index = KNOWN.len() + i;
            if !output.uses(index) && !rates.iter().any(|r| r.uses(index)) {
                return Err(format!("no formula has its parameter `{name}`"));
            }
        }
        Ok(Self {
            output,
            rates,
            start: effect.states.values().map(|s| s.start).collect(),
            parameters: effect
                .ordered()
                .map(|(_, p)| {
                    if p.starts.is_empty() {
                        vec![0.0]
                    } else {
                        p.starts.clone()
                    }
                })
                .collect(),
            amplitudes: effect.parameters.values().filter(|p| p.starts.is_empty()).count(),
            ways: effect
                .ordered()
                .filter(|(_, p)| !p.starts.is_empty())
                .map(|(_, p)| Way::of(p))
                .collect(),
            signals,
        })
    }

    /// Where its states are in a frame.
    pub(super) fn first_state(&self) -> usize {
        KNOWN.len() + self.parameters.len()
    }

    /// What formulas see at a moment.
    pub(super) fn frame(
        &self,
        values: &[f64],
        channel: usize,
        at: &Moment<'_>,
        own: &[f64],
        input: f64,
        reading: f64,
    ) -> Frame {
        let mut frame = [0.0; ROOM];
        let motion = &at.motion;
        frame[..KNOWN.len()].copy_from_slice(&[
            at.time,
            motion.motor_position[channel],
            motion.motor_speed[channel],
            motion.load_position[channel],
            motion.load_speed[channel],
            at.p,
            at.rate,
            input,
            reading,
        ]);
        let signals = self.signals.iter().map(|signal| at.auxiliary(*signal));
        let rest = values.iter().chain(own).copied().chain(signals);
        frame[KNOWN.len()..]
            .iter_mut()
            .zip(rest)
            .for_each(|(f, v)| *f = v);
        frame
    }

    /// The force or the reading.
    pub(super) fn output(&self, frame: &Frame) -> f64 {
        self.output.at(frame)
    }

    fn needs_input(&self) -> bool {
        self.output.uses(INPUT) || self.rates.iter().any(|r| r.uses(INPUT))
    }
}

/// A law with values, at a channel of a machine.
#[derive(Debug)]
pub(super) struct Acting {
    law: &'static Law,
    values: Vec<f64>,
    place: Place,
    /// Forces of the motors for one unit of the input.
    unit: Pair,
}

impl Acting {
    pub(super) fn new(law: &'static Law, values: &[f64], machine: &Base, place: Place) -> Self {
        Self {
            law,
            values: values.to_vec(),
            place,
            unit: motor_forces(machine, place.first(), 1.0),
        }
    }
}

impl Block for Acting {
    fn states(&self) -> usize {
        self.law.rates.len()
    }

    fn start(&self, _at: &Moment<'_>, own: &mut [f64]) {
        own.copy_from_slice(&self.law.start);
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let is_force = matches!(self.place, Place::Motor(_));
        if !is_force && rates.is_empty() {
            return;
        }
        let channel = self.place.first();
        let input = match self.law.needs_input() {
            true => at.machine.as_input(at.p, forces.motors)[channel],
            false => 0.0,
        };
        let frame = self.law.frame(&self.values, channel, at, own, input, 0.0);
        for (rate, formula) in rates.iter_mut().zip(&self.law.rates) {
            *rate = formula.at(&frame);
        }
        if is_force {
            let force = self.law.output(&frame);
            (0..2).for_each(|i| forces.motors[i] += self.unit[i] * force);
        }
    }

    fn sense(&self, at: &Moment<'_>, own: &[f64], outputs: &mut Pair) {
        if let Place::Output(channel) = self.place {
            let frame = self
                .law
                .frame(&self.values, channel, at, own, 0.0, outputs[channel]);
            outputs[channel] += self.law.output(&frame);
        }
    }
}
