//! Frequency responses: functions of type 4, one for each pair of a place that answers and a place that is excited.

use super::header::{Function, Spacing};
use super::sets::{Set, sets};
use super::source::Source;
use crate::contents::ResponseInfo;
use crate::error::ResponseFault;
use crate::memory::Allowance;
use crate::response::raw::{Asked, Raw, Spread};
use crate::{RecordError, ResponseQuantity};
use lpv_core::num_complex::Complex;
use std::fs::File;

/// The response of all channels: places are named `12+Z`, as in the file, or as the channel is called.
pub(crate) fn read(asked: &Asked<'_>) -> Result<Raw, RecordError> {
    let mut source = Source::open(asked.path)?;
    let sets = sets(&mut source)?;
    let all: Vec<&Set> = sets.functions.iter().filter(|s| s.is_response()).collect();
    let (outputs, inputs) = asked.names();
    // The only function of a file is that of the only channel.
    let only = outputs.len() == 1 && inputs.len() == 1 && all.len() == 1;
    let mut allowance = Allowance::new(source.bytes());
    let mut columns: Vec<(Vec<f64>, Vec<Complex<f64>>)> = Vec::new();
    let mut quantities = Vec::new();
    let mut first = String::new();
    for input in inputs {
        for output in outputs {
            let (y, u) = (asked.entry.source_of(output), asked.entry.source_of(input));
            let is = |s: &&&Set| {
                let answers = [s.header.response.name(), s.header.name()];
                answers.iter().any(|name| name == y) && s.header.reference.name() == u
            };
            let mut fitting: Vec<&Set> = all.iter().filter(is).copied().collect();
            if fitting.is_empty() && only {
                fitting.push(all[0]);
            }
            let [set] = fitting.as_slice() else {
                return Err(ResponseFault::Functions {
                    found: fitting.len(),
                    output: y.to_owned(),
                    input: u.to_owned(),
                    present: all.iter().map(|s| s.between()).collect(),
                }
                .into());
            };
            let name = set.between();
            set.check_claim(&name)?;
            allowance.take(&name, set.numbers())?;
            if set.is_in_gravities() && asked.channels.output.scale.is_empty() {
                return Err(ResponseFault::InGravities { what: name }.into());
            }
            let lines = set.lines(&name, &mut source)?;
            match columns.first() {
                None => first.clone_from(&name),
                Some((other, _)) if *other != lines.0 => {
                    return Err(ResponseFault::Lines { what: name, first }.into());
                }
                Some(_) => {}
            }
            columns.push(lines);
            quantities.push(set.quantity());
        }
    }
    let frequencies_hz = columns[0].0.clone();
    let count = frequencies_hz.len();
    let same = quantities.iter().all(|q| *q == quantities[0]);
    if !same {
        return Err(ResponseFault::Mixed.into());
    }
    Ok(Raw {
        values: (0..count)
            .flat_map(|k| columns.iter().map(move |c| c.1[k]))
            .collect(),
        frequencies_hz,
        spread: Spread::Unknown,
        averages: None,
        quantity: quantities[0],
    })
}

impl Set {
    pub(super) fn is_response(&self) -> bool {
        self.header.function == Function::FrequencyResponse && self.header.is_complex
    }

    /// What it is, for who knows nothing of it.
    pub(super) fn told(&self, source: &mut Source<File>) -> Result<ResponseInfo, RecordError> {
        let name = self.between();
        self.check_claim(&name)?;
        let highest = match self.header.spacing {
            Spacing::Even => {
                self.header.start + self.header.points.saturating_sub(1) as f64 * self.header.step
            }
            Spacing::Uneven => self.lines(&name, source)?.0.last().copied().unwrap_or(f64::NAN),
        };
        Ok(ResponseInfo {
            output: self.header.response.name(),
            input: self.header.reference.name(),
            quantity: self.quantity(),
            highest_hz: highest,
        })
    }

    /// Where it was measured, and excited.
    fn between(&self) -> String {
        format!("{} over {}", self.header.name(), self.header.reference.name())
    }

    /// Frequencies and values.
    fn lines(
        &self,
        name: &str,
        source: &mut Source<File>,
    ) -> Result<(Vec<f64>, Vec<Complex<f64>>), RecordError> {
        let numbers = self.values(name, source)?;
        let header = &self.header;
        Ok(match header.spacing {
            Spacing::Even => {
                let values: Vec<_> = numbers
                    .chunks_exact(2)
                    .map(|c| Complex::new(c[0], c[1]))
                    .collect();
                let start = if header.start.is_finite() {
                    header.start
                } else {
                    0.0
                };
                let frequency = |k: usize| start + k as f64 * header.step;
                ((0..values.len()).map(frequency).collect(), values)
            }
            Spacing::Uneven => numbers
                .chunks_exact(3)
                .map(|c| (c[0], Complex::new(c[1], c[2])))
                .unzip(),
        })
    }

    /// Whether it is an acceleration in multiples of that of gravity.
    fn is_in_gravities(&self) -> bool {
        let unit = self.header.ordinate.unit.split('/').next().unwrap_or("").trim();
        self.header.ordinate.kind == 12 && matches!(unit, "g" | "G" | "gn" | "g_n")
    }

    /// What the kinds of its axes say.
    fn quantity(&self) -> Option<ResponseQuantity> {
        let over_force = matches!(self.header.over, 9 | 13);
        Some(match (self.header.ordinate.kind, over_force) {
            (8, true) => ResponseQuantity::DisplacementForce,
            (11, true) => ResponseQuantity::VelocityForce,
            (12, true) => ResponseQuantity::AccelerationForce,
            (8, false) => ResponseQuantity::DisplacementInput,
            (11, false) => ResponseQuantity::VelocityInput,
            (12, false) => ResponseQuantity::AccelerationInput,
            _ => return None,
        })
    }
}
