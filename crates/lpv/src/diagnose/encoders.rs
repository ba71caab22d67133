//! Two encoders of one axis, one as the other tells it.

use super::value::Value;
use super::{Evidence, FoundEffect, PlaceName};
use crate::verdict::number;
use experiment_data::Bundle;
use lpv_diagnose::Compared;
use lpv_numerics::statistics::chi_squared_p_value;
use std::collections::BTreeMap;

/// Deviations from one that a gain is at least to be another.
const SURE: f64 = 5.0;
/// Part of the difference that it may leave: a spring between them also looks like a gain.
const LEFT: f64 = 0.5;
/// Largest error of a scale.
const MOST: f64 = 0.1;
/// Least part of the readings that a difference is, and how many times their noise.
const LEAST: f64 = 1e-4;
const OVER_NOISE: f64 = 3.0;

/// The encoder of an axis and a further one, with what they tell of each other.
pub(super) struct Encoders<'a> {
    bundle: &'a Bundle,
    own: usize,
    other: usize,
    found: Compared,
}

impl<'a> Encoders<'a> {
    pub(super) fn new(bundle: &'a Bundle, (own, other): (usize, usize), found: Compared) -> Self {
        Self {
            bundle,
            own,
            other,
            found,
        }
    }

    /// A skew as an effect of the sensor that is late.
    pub(super) fn skew(&self) -> Option<FoundEffect> {
        let skew = self.found.skew?;
        let late = if skew.time > 0.0 { self.other } else { self.own };
        let time = Value::new(skew.time.abs(), skew.deviation, "s".to_owned());
        let sure = skew.time / skew.deviation;
        Some(self.effect(late, ("sensor-skew", "time", time), skew.left, sure))
    }

    /// Another scale of the further sensor, where both are in one unit.
    pub(super) fn gain(&self) -> Option<FoundEffect> {
        let [gain, deviation] = self.found.gain;
        let sure = (gain - 1.0) / deviation;
        // A gear between them is no error.
        let is_most = self.found.left < LEFT * self.found.difference && (gain - 1.0).abs() < MOST;
        let is_other = self.in_one_unit() && is_most && (gain - 1.0).abs() > LEAST && sure.abs() > SURE;
        is_other.then(|| {
            let value = Value::new(gain - 1.0, deviation, String::new());
            let left = [self.found.difference, self.found.left];
            self.effect(self.other, ("sensor-gain", "gain", value), left, sure)
        })
    }

    /// What is left of the difference, in words, where that is more than noise.
    pub(super) fn difference(&self) -> Option<String> {
        let Compared {
            left, noise, size, ..
        } = self.found;
        let channels = &self.bundle.description().channels.output;
        let unit = channels.units.get(self.other).map_or("", String::as_str);
        (left > OVER_NOISE * noise && left > LEAST * size).then(|| {
            format!(
                "{} and {} differ by {} {unit} rms, {:.0} times their noise: a spring or a gear between them, or an error of one",
                channels.columns[self.own],
                channels.columns[self.other],
                number(left),
                left / noise
            )
        })
    }

    fn in_one_unit(&self) -> bool {
        let units = &self.bundle.description().channels.output.units;
        let own = units.get(self.own).filter(|u| !u.is_empty());
        own.is_some() && own == units.get(self.other)
    }

    fn effect(
        &self,
        output: usize,
        (effect, parameter, value): (&str, &str, Value),
        left: [f64; 2],
        sure: f64,
    ) -> FoundEffect {
        let name = self.bundle.description().channels.output.columns[output].clone();
        FoundEffect {
            effect: effect.to_owned(),
            family: "sensor".to_owned(),
            channel: name.clone(),
            signal: None,
            parameters: BTreeMap::from([(parameter.to_owned(), value)]),
            base_parameters_then: BTreeMap::new(),
            evidence: Evidence {
                held_out_gain_db: 20.0 * (left[0] / left[1]).log10(),
                p_value: chi_squared_p_value(sure * sure, 1),
                runner_up: None,
                runner_up_channel: None,
                runner_up_margin_db: None,
            },
            class: Vec::new(),
            caveats: Vec::new(),
            would_tell: None,
            definition: None,
            place: Some(PlaceName {
                kind: "output".to_owned(),
                index: output,
                name,
            }),
        }
    }
}
