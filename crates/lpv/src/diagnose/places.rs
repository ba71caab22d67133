//! Where effects act, in words and in units.

use super::Value;
use experiment_data::Bundle;
use lpv_diagnose::effect::{Effect, Place};
use lpv_diagnose::{Base, BaseParameter};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where an effect acts, in format 2.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PlaceName {
    /// `motor`, `motors` or `output`.
    pub kind: String,
    /// Which of the channels of the bundle.
    pub index: usize,
    /// Its name.
    pub name: String,
}

/// Parameters of a base model by name, with their deviations in its order, in units of the bundle.
pub(super) fn base_parameters(base: &Base, deviations: &[f64], bundle: &Bundle) -> BTreeMap<String, Value> {
    let one = |(p, std): (BaseParameter, &f64)| {
        let value = Value::new(p.value, *std, units(p.unit, bundle, 0));
        (p.name.to_owned(), value)
    };
    base.parameters().into_iter().zip(deviations).map(one).collect()
}

/// Names of all records.
pub(super) fn record_names(bundle: &Bundle) -> Vec<String> {
    let records = 0..bundle.description().records.len();
    records
        .map(|i| bundle.record_name(i).unwrap_or_default().to_owned())
        .collect()
}

/// The channel at which an effect acts, or all of them.
pub(super) fn channel(effect: &Effect, bundle: &Bundle) -> String {
    let channels = &bundle.description().channels;
    let (names, index) = match effect.place {
        Place::Motor(i) => (&channels.input.columns, Some(i)),
        Place::AllMotors => (&channels.input.columns, None),
        Place::Output(i) => (&channels.output.columns, Some(i)),
    };
    let one = index.and_then(|i| names.get(i).cloned());
    one.unwrap_or_else(|| names.join(" and "))
}

/// The same as format 2 has it.
pub(super) fn place_name(effect: &Effect, bundle: &Bundle) -> PlaceName {
    let (kind, index) = match effect.place {
        Place::Motor(i) => ("motor", i),
        Place::AllMotors => ("motors", 0),
        Place::Output(i) => ("output", i),
    };
    PlaceName {
        kind: kind.to_owned(),
        index,
        name: channel(effect, bundle),
    }
}

/// An effect beside others at other channels, in words.
pub(crate) fn placed(effect: &Effect, bundle: &Bundle) -> String {
    format!("{} at {}", effect.name, channel(effect, bundle))
}

/// The unit of a parameter from a template in `u`, `y` and `y2`: the units of the input and of the output of a channel, and of the
/// second output.
pub(super) fn units(template: &str, bundle: &Bundle, channel: usize) -> String {
    let channels = &bundle.description().channels;
    let (inputs, outputs) = (&channels.input.units, &channels.output.units);
    let places = [inputs.get(channel), outputs.get(channel), outputs.get(1)];
    in_units(template, places.map(|unit| unit.map_or("", String::as_str)))
}

/// A template in `u`, `y` and `y2` with these units; an empty one leaves its letter.
pub(crate) fn in_units(template: &str, units: [&str; 3]) -> String {
    let word = |w: &str| {
        let letter = ["u", "y", "y2"].iter().position(|letter| *letter == w);
        match letter.map_or("", |k| units[k]) {
            "" => w.to_owned(),
            unit if unit.contains(['/', ' ']) => format!("({unit})"),
            unit => unit.to_owned(),
        }
    };
    let mut out = String::new();
    let mut rest = template;
    while let Some(end) = rest.find(['/', ' ', '^']) {
        out.push_str(&word(&rest[..end]));
        out.push_str(&rest[end..=end]);
        rest = &rest[end + 1..];
    }
    out.push_str(&word(rest));
    match out.as_str() {
        "N s^2/m" => return "kg".to_owned(),
        "(N m) s^2/rad" | "Nm s^2/rad" => return "kg m^2".to_owned(),
        _ => {}
    }
    match out.strip_prefix('(').and_then(|o| o.strip_suffix(')')) {
        Some(plain) if !plain.contains(['(', ')']) => plain.to_owned(),
        _ => out,
    }
}
