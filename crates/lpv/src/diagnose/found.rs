//! An effect that was found, as `diagnosis.json` and the first line tell it.

use super::places::{channel, place_name, units};
use super::value::Value;
use super::{PlaceName, caveat, doubt};
use crate::verdict::number;
use experiment_data::Bundle;
use lpv_diagnose::effect::EffectParameter;
use lpv_diagnose::{Added, Trace, Track, UserEffect};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters that are the size of an effect.
const SIZES: [&str; 18] = [
    "gain",
    "force_per_degree",
    "coefficient_of_the_load",
    "viscous_per_degree",
    "level_per_degree",
    "gain_per_degree",
    "stiffness_per_degree",
    "reading_per_degree",
    "level",
    "force",
    "limit",
    "mass",
    "time",
    "time_constant",
    "coefficient",
    "viscous_forward_more",
    "drift",
    "stiffness",
];
/// What readings on a grid are called.
pub(super) const ROUNDING: &str = "quantization";

/// An effect that was added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FoundEffect {
    /// Name in the catalogue.
    pub effect: String,
    /// Its family.
    pub family: String,
    /// Channel at which it acts.
    pub channel: String,
    /// The further signal that it depends on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signal: Option<String>,
    /// Its parameters.
    pub parameters: BTreeMap<String, Value>,
    /// Parameters of the base model when it was added, before further effects.
    pub base_parameters_then: BTreeMap<String, f64>,
    /// Why it was added.
    pub evidence: Evidence,
    /// Where it acts, in format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<PlaceName>,
    /// All effects that the held-out records cannot tell from this one, itself first; in format 2, and empty where there is no other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub class: Vec<String>,
    /// What the records do not show well; in format 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub caveats: Vec<String>,
    /// What would tell the effects of the class apart; in format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub would_tell: Option<String>,
    /// What it is, where a user wrote it down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<serde_json::Value>")]
    pub definition: Option<UserEffect>,
}

impl FoundEffect {
    pub(super) fn new(a: &Added, found: &Trace, judged: &[Track], bundle: &Bundle) -> Self {
        let value = |(p, (value, std)): (&EffectParameter, &(f64, f64))| {
            let value = Value::new(*value, *std, units(p.unit, bundle, a.effect.place.first()));
            (p.name.to_owned(), value)
        };
        // What concerns a second output, where there is one.
        let is_there = |(p, _): &(&EffectParameter, &(f64, f64))| {
            bundle.description().channels.output.len() > 1 || !p.unit.contains("y2")
        };
        let parameters = a.effect.parameters.iter().zip(&a.values).filter(is_there);
        let class = match a.effect.name {
            // Rounding moves no error that a look could compare.
            ROUNDING => Vec::new(),
            _ => doubt::class(a, found),
        };
        let known = a.then.base.parameters();
        Self {
            effect: a.effect.name.to_owned(),
            family: a.effect.family.name().to_owned(),
            channel: channel(a.effect, bundle),
            signal: signal(a, bundle),
            parameters: parameters.map(value).collect(),
            base_parameters_then: known.iter().map(|p| (p.name.to_owned(), p.value)).collect(),
            evidence: Evidence {
                held_out_gain_db: a.gain_db,
                p_value: a.p_value,
                runner_up: a.runner_up.map(|(e, _)| e.name.to_owned()),
                runner_up_channel: a.runner_up.map(|(e, _)| channel(e, bundle)),
                runner_up_margin_db: a.runner_up.map(|(_, margin)| margin),
            },
            place: Some(place_name(a.effect, bundle)),
            would_tell: (!class.is_empty()).then(|| doubt::experiment(a.effect).to_owned()),
            class,
            caveats: caveat::caveats(a, judged),
            definition: UserEffect::behind(a.effect),
        }
    }

    /// What the records do not show well of it, a sentence each.
    pub(super) fn doubts(&self) -> Vec<String> {
        let at = format!("{} at {}", self.effect, self.channel);
        let caveats = self.caveats.iter().map(|name| caveat::sentence(name));
        let others = self.class.get(1..).filter(|others| !others.is_empty());
        let class = others.map(|others| {
            let would = self.would_tell.as_deref().unwrap_or("other records");
            format!(
                "these records do not tell it from {}; {would} would",
                others.join(" or ")
            )
        });
        let all = caveats.map(str::to_owned).chain(class);
        all.map(|sentence| format!("{at}: {sentence}")).collect()
    }

    /// Without what format 1 does not have.
    pub(super) fn as_first_format(&mut self) {
        self.place = None;
        self.would_tell = None;
        self.class.clear();
        self.caveats.clear();
    }

    /// Its name, its place and its size, as the first line tells them.
    fn in_short(&self, records: &[String]) -> String {
        let value = |name: &str| self.parameters.get(name);
        let own = |value: &BTreeMap<String, Value>| {
            let one = |(name, v): (&String, &Value)| format!("{name} {}", v.in_short());
            value.iter().map(one).collect::<Vec<_>>().join(", ")
        };
        let size = match (value("sine"), value("cosine"), self.parameters.len()) {
            _ if self.definition.is_some() => Some(own(&self.parameters)),
            (Some(sine), Some(cosine), _) => Some(format!(
                "{} {}",
                number(sine.value.hypot(cosine.value)),
                sine.unit
            )),
            _ => SIZES.iter().find_map(|name| value(name)).map(Value::in_short),
        };
        let record = value("record").and_then(|r| records.get((r.value as usize).checked_sub(1)?));
        let record = record.map(|name| format!("in {name}"));
        let signal = self.signal.as_ref().map(|name| format!("with `{name}`"));
        let others = self.class.get(1..).filter(|others| !others.is_empty());
        let others = others.map(|o| format!("or {}, which these records do not tell apart", o.join(" or ")));
        let told: Vec<String> = [size, signal, record, others].into_iter().flatten().collect();
        match told.is_empty() {
            true => format!("{} at {}", self.effect, self.channel),
            false => format!("{} at {} ({})", self.effect, self.channel, told.join(", ")),
        }
    }

    /// The next best effect, with its channel where that is another one, and by how many dB it is worse.
    pub(super) fn rival(&self) -> Option<(String, f64)> {
        let Evidence {
            runner_up,
            runner_up_channel,
            runner_up_margin_db,
            ..
        } = &self.evidence;
        let name = match runner_up_channel {
            Some(channel) if *channel != self.channel => format!("{} at {channel}", runner_up.as_ref()?),
            _ => runner_up.clone()?,
        };
        Some((name, (*runner_up_margin_db)?))
    }
}

/// Why an effect was added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Evidence {
    /// Fall of the squared error on the judged records when it was added.
    pub held_out_gain_db: f64,
    /// Probability of such a fall on the fitted records by chance.
    pub p_value: f64,
    /// The next best effect.
    pub runner_up: Option<String>,
    /// Where that one acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub runner_up_channel: Option<String>,
    /// By how much that one is worse on the judged records.
    pub runner_up_margin_db: Option<f64>,
}

/// The further signal that an effect names by its number.
fn signal(a: &Added, bundle: &Bundle) -> Option<String> {
    let at = a.effect.parameters.iter().position(|p| p.name == "signal")?;
    let auxiliary = &bundle.description().channels.auxiliary.columns;
    auxiliary.get((a.values[at].0 as usize).checked_sub(1)?).cloned()
}

/// Effects with their places and sizes, empty without any; and what is said last of readings on a grid. `records` are the names of all
/// records.
pub(super) fn names(effects: &[FoundEffect], records: &[String]) -> (String, String) {
    let (rounding, others): (Vec<_>, Vec<_>) = effects.iter().partition(|e| e.effect == ROUNDING);
    let step = |e: &&FoundEffect| {
        let steps = ["step", "other_step"]
            .into_iter()
            .filter_map(|name| e.parameters.get(name));
        let told = steps
            .filter(|s| s.value > 0.0)
            .map(|s| format!("{} {}", number(s.value), s.unit));
        told.collect::<Vec<_>>().join(" and ")
    };
    let named: Vec<String> = others.iter().map(|e| e.in_short(records)).collect();
    let steps: Vec<String> = rounding.iter().map(step).collect();
    let grid = match steps.is_empty() {
        true => String::new(),
        false => format!("; readings lie on steps of {}", steps.join(", ")),
    };
    (named.join(", "), grid)
}
