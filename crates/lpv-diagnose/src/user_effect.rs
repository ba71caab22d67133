//! Effects that a user writes down as formulas.
//!
//! A law adds a force at an input or an error at a sensor, as a formula of the motion, of time, of the scheduling, of further measured
//! signals and of states with formulas for their rates. It competes with the effects of the catalogue under the same rules.

mod formula;
mod law;
mod short;
mod starts;

use crate::TraceError;
use crate::base::Base;
use crate::catalogue;
use crate::effect::{Block, Effect, EffectParameter, Family, Needs, Place, Scale};
use crate::screen::Screen;
use formula::Formula;
use law::{Acting, Law};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

/// An effect of a user.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct UserEffect {
    /// Its name, one that the catalogue does not have.
    pub name: String,
    /// What it is, in a sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub meaning: String,
    /// Its family; `disturbance` for a force and `sensor` for an error of a reading if none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub family: Option<Family>,
    /// The input or output at which it acts, by name; without one it is tried at each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// What it adds to the force of the input, in the unit of the input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<String>,
    /// What it adds to the reading of the output, in the unit of the output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<String>,
    /// States of its own, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub states: BTreeMap<String, UserState>,
    /// What a fit finds, by name.
    pub parameters: BTreeMap<String, UserParameter>,
}

/// A state of a user's effect; read from its rate alone too, where it starts at zero.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields)]
pub struct UserState {
    /// Its derivative in time, a formula.
    pub rate: String,
    /// Its value at the start of a record.
    #[serde(default)]
    pub start: f64,
}

/// A parameter of a user's effect; read from its unit alone too, where it is an amplitude.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields)]
pub struct UserParameter {
    /// Its unit, in which `u` and `y` stand for those of the input and the output.
    #[serde(default)]
    pub unit: String,
    /// Values to start from. A parameter without any is an amplitude: at zero of all of them there is no effect.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub starts: Vec<f64>,
    /// Whether it is above zero. With starts its logarithm is fitted.
    #[serde(default)]
    pub positive: bool,
}

impl UserParameter {
    fn scale(&self) -> Scale {
        match (self.starts.is_empty(), self.positive) {
            (true, false) => Scale::Linear,
            (true, true) => Scale::Positive,
            (false, false) => Scale::Free,
            (false, true) => Scale::Logarithmic,
        }
    }
}

/// An effect that was made, and from what.
struct Kept {
    definition: UserEffect,
    channel: usize,
    auxiliary: Vec<String>,
    effect: &'static Effect,
}

static KEPT: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// Starts that an effect may have, over all its parameters together.
const MOST_STARTS: usize = 256;

impl UserEffect {
    /// Whether it acts at the sensors.
    #[must_use]
    pub fn is_of_sensor(&self) -> bool {
        self.reading.is_some()
    }

    /// Whether a formula of it has this variable.
    #[must_use]
    pub fn uses(&self, variable: &str) -> bool {
        self.variables().contains(variable)
    }

    /// Whether it may be an effect of some bundle: with a name, parameters and formulas that can be read. A name in a formula that it does
    /// not tell may be that of a further signal.
    ///
    /// # Errors
    /// [`TraceError::UserEffect`] with what is wrong.
    pub fn checked(&self) -> Result<(), TraceError> {
        self.check()?;
        let own = |name: &String| self.parameters.contains_key(name) || self.states.contains_key(name);
        let signals: Vec<String> = self.variables().into_iter().filter(|n| !own(n)).collect();
        Law::of(self, &signals).map(|_| ()).map_err(|p| self.wrong(p))
    }

    /// What its formulas name.
    fn variables(&self) -> BTreeSet<String> {
        let rates = self.states.values().map(|s| &s.rate);
        let all = self.force.iter().chain(&self.reading).chain(rates);
        let read = all.filter_map(|text| Formula::parse(text).ok());
        read.flat_map(|f| f.names().to_vec()).collect()
    }

    /// The same for a competition, where it acts on this channel: the effect of an input that drives a motor, or of an output.
    ///
    /// `auxiliary` are the names of the further signals, which formulas may use. An effect is kept as long as the program runs, one for
    /// each definition.
    ///
    /// # Errors
    /// [`TraceError::UserEffect`] with what is wrong with the name, a formula or a parameter.
    pub fn at(&self, channel: usize, auxiliary: &[String]) -> Result<&'static Effect, TraceError> {
        let is_it = |k: &&Kept| k.definition == *self && k.channel == channel && k.auxiliary == auxiliary;
        let mut all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.iter().find(is_it) {
            return Ok(known.effect);
        }
        let effect: &'static Effect = Box::leak(Box::new(self.made(channel, auxiliary)?));
        all.push(Kept {
            definition: self.clone(),
            channel,
            auxiliary: auxiliary.to_vec(),
            effect,
        });
        Ok(effect)
    }

    /// What an effect was made from; none for those of the catalogue.
    #[must_use]
    pub fn behind(effect: &'static Effect) -> Option<Self> {
        let all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        let found = all.iter().find(|k| std::ptr::eq(k.effect, effect));
        found.map(|k| k.definition.clone())
    }

    fn made(&self, channel: usize, auxiliary: &[String]) -> Result<Effect, TraceError> {
        self.check()?;
        let law: &'static Law = Box::leak(Box::new(Law::of(self, auxiliary).map_err(|p| self.wrong(p))?));
        let place = match self.is_of_sensor() {
            true => Place::Output(channel),
            false => Place::Motor(channel),
        };
        let parameter = |(name, p): (&str, &UserParameter)| EffectParameter {
            name: kept(name),
            unit: kept(&p.unit),
            scale: p.scale(),
        };
        let parameters: Vec<EffectParameter> = self.ordered().map(parameter).collect();
        Ok(Effect {
            name: kept(&self.name),
            family: self.family.unwrap_or(match self.is_of_sensor() {
                true => Family::Sensor,
                false => Family::Disturbance,
            }),
            place,
            needs: Needs::of(place),
            meaning: kept(&self.meaning),
            parameters: Vec::leak(parameters),
            extends: None,
            starts: Box::leak(Box::new(move |screen: &Screen<'_>, place| {
                starts::starts(law, screen, place)
            })),
            on_response: None,
            block: Box::leak(Box::new(
                move |values: &[f64], machine: &Base, place| -> Box<dyn Block> {
                    Box::new(Acting::new(law, values, machine, place))
                },
            )),
        })
    }

    /// Its parameters, amplitudes first.
    fn ordered(&self) -> impl Iterator<Item = (&str, &UserParameter)> {
        let of = |amplitudes: bool| {
            let all = self.parameters.iter().map(|(name, p)| (name.as_str(), p));
            all.filter(move |(_, p)| p.starts.is_empty() == amplitudes)
        };
        of(true).chain(of(false))
    }

    /// The refusal of this effect with what is wrong.
    #[must_use]
    pub fn wrong(&self, problem: String) -> TraceError {
        TraceError::UserEffect {
            name: self.name.clone(),
            problem,
        }
    }

    /// What can be told without a formula.
    fn check(&self) -> Result<(), TraceError> {
        let is_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let problem = if self.name.is_empty() || !self.name.chars().all(is_word) {
            Some("a name has small letters, digits and hyphens".to_owned())
        } else if catalogue::all().any(|e| e.name == self.name) {
            Some("the catalogue has an effect of this name; choose another".to_owned())
        } else if self.force.is_some() == self.reading.is_some() {
            Some("give either `force`, a formula of what acts at an input, or `reading`, of what a sensor adds".to_owned())
        } else if self.parameters.is_empty() {
            Some("it has no parameter that a fit could find".to_owned())
        } else if self.parameters.values().all(|p| !p.starts.is_empty()) {
            Some(
                "it has no amplitude: leave `starts` out where zero means that the effect is not there"
                    .to_owned(),
            )
        } else {
            self.wrong_parameter()
        };
        problem.map_or(Ok(()), |problem| Err(self.wrong(problem)))
    }

    fn wrong_parameter(&self) -> Option<String> {
        for (name, p) in &self.parameters {
            if let Some(bad) = p
                .starts
                .iter()
                .find(|s| !s.is_finite() || (p.positive && **s <= 0.0))
            {
                let what = if p.positive { "above zero" } else { "finite" };
                return Some(format!("parameter `{name}` starts from {bad}; it must be {what}"));
            }
        }
        let all = self.parameters.values().map(|p| p.starts.len().max(1));
        let count = all.fold(1_usize, usize::saturating_mul);
        let too_many = format!("its parameters have {count} starts together; {MOST_STARTS} are the most");
        (count > MOST_STARTS).then_some(too_many)
    }
}

/// A text for as long as the program runs.
fn kept(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

#[cfg(test)]
mod tests;
