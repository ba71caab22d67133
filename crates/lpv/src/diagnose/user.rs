//! Effects of a user's own file.

use super::places::channel;
use crate::ModelFile;
use crate::PipelineError;
use crate::settings_file::{nearest_name, read_settings};
use experiment_data::Bundle;
use lpv_diagnose::effect::Effect;
use lpv_diagnose::{Trace, UserEffect};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::path::Path;

/// What a diagnosis is given beside the data.
#[derive(Debug, Clone, Copy, Default)]
pub struct Given<'a> {
    /// The model that effects are added to; one of the bundle if none.
    pub model: Option<&'a ModelFile>,
    /// Effects of the user, beside those of the catalogue.
    pub effects: &'a [UserEffect],
}

/// What a file of effects holds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Effects {
    #[serde(deserialize_with = "one_or_more")]
    effect: Vec<UserEffect>,
}

/// Tables `[[effect]]`, or `[effect]` of a single one.
fn one_or_more<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<UserEffect>, D::Error> {
    struct Both;
    impl<'de> Visitor<'de> for Both {
        type Value = Vec<UserEffect>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("tables `[[effect]]`")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            UserEffect::deserialize(MapAccessDeserializer::new(map)).map(|one| vec![one])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, all: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(all))
        }
    }
    deserializer.deserialize_any(Both)
}

/// Reads a TOML file with one table `[[effect]]` for each effect.
///
/// # Errors
/// [`PipelineError::Config`] with file, line and column; with the file and the effect where a name, a parameter or a formula is wrong.
pub fn read_effects(file: &Path) -> Result<Vec<UserEffect>, PipelineError> {
    let all = read_settings::<Effects>(file)?.effect;
    let wrong = |message: String| PipelineError::Config {
        file: file.to_owned(),
        message,
    };
    if all.is_empty() {
        return Err(wrong(
            "it has no effect: write a table [[effect]] for each".to_owned(),
        ));
    }
    for effect in &all {
        effect.checked().map_err(|e| wrong(e.to_string()))?;
    }
    Ok(all)
}

/// The given effects, and those that the model has the definitions of.
pub(super) fn of_model(given: Given<'_>) -> Vec<UserEffect> {
    let mut all = given.effects.to_vec();
    let explanation = given.model.and_then(|m| m.explanation.as_ref());
    let known = explanation.into_iter().flat_map(|e| &e.effects);
    for own in known.filter_map(|e| e.definition.as_ref()) {
        if !all.iter().any(|e| e.name == own.name) {
            all.push(own.clone());
        }
    }
    all
}

/// What is said of given effects where a bundle has no moves.
///
/// # Errors
/// [`PipelineError::Structure`] if there are any.
pub(super) fn need_moves(given: Given<'_>) -> Result<(), PipelineError> {
    match given.effects {
        [] => Ok(()),
        _ => Err(PipelineError::Structure {
            problem: "effects of your own act along moves, and this bundle has frequency responses alone: record moves, or leave out the \
                      effects",
        }),
    }
}

/// Whether a bundle can have these effects.
///
/// # Errors
/// Two of one name, a channel that is not there, a wrong formula or parameter.
pub(super) fn check(effects: &[UserEffect], bundle: &Bundle) -> Result<(), PipelineError> {
    for (i, effect) in effects.iter().enumerate() {
        if effects[..i].iter().any(|e| e.name == effect.name) {
            return Err(effect.wrong("there are two of this name".to_owned()).into());
        }
        let (what, columns) = channels(effect, bundle);
        if let Some(name) = &effect.channel
            && !columns.contains(name)
        {
            let nearest = nearest_name(name, columns.iter().map(String::as_str));
            let nearest = nearest.map_or(String::new(), |n| format!("; nearest: `{n}`"));
            let known = columns.join(", ");
            let problem = format!("the bundle has no {what} `{name}`; it has {known}{nearest}");
            return Err(effect.wrong(problem).into());
        }
        if bundle.description().channels.scheduling.is_empty()
            && let Some(name) = ["p", "p_rate"].into_iter().find(|n| effect.uses(n))
        {
            let problem = format!(
                "a formula has `{name}`, and the bundle has no scheduling: name its columns in [channels.scheduling]"
            );
            return Err(effect.wrong(problem).into());
        }
        at(effect, 0, bundle)?;
    }
    Ok(())
}

/// What is said of effects that no competition could look at, one line each.
pub(super) fn untried(own: &[&'static Effect], found: &Trace, bundle: &Bundle) -> Vec<String> {
    // Without a look at the catalogue, none of its effects was tried either.
    if found.candidates.is_empty() {
        return Vec::new();
    }
    let is_tried = |e: &&&Effect| found.candidates.iter().any(|t| t.effect.is(e));
    let could = own.iter().filter(|e| e.suits(&found.model.base) && !is_tried(e));
    let line = |effect: &&'static Effect| {
        format!(
            "`{}` at {} was not tried: from each of its starts it has no finite number along the moves, or changes nothing there; look \
             for a division by zero, and for a root or a logarithm of what may be negative",
            effect.name,
            channel(effect, bundle)
        )
    };
    could.map(line).collect()
}

/// The effects at the channels of a bundle; those that act at a channel that it does not have are left out.
pub(super) fn placed(effects: &[UserEffect], bundle: &Bundle) -> Result<Vec<&'static Effect>, PipelineError> {
    let mut all = Vec::new();
    for effect in effects {
        let (_, columns) = channels(effect, bundle);
        for (i, name) in columns.iter().enumerate() {
            if effect.channel.as_ref().is_none_or(|c| c == name) {
                all.push(at(effect, i, bundle)?);
            }
        }
    }
    Ok(all)
}

/// The channels that an effect may act at, and what they are.
fn channels<'a>(effect: &UserEffect, bundle: &'a Bundle) -> (&'static str, &'a [String]) {
    let channels = &bundle.description().channels;
    match effect.is_of_sensor() {
        true => ("output", &channels.output.columns),
        false => ("input", &channels.input.columns),
    }
}

fn at(effect: &UserEffect, channel: usize, bundle: &Bundle) -> Result<&'static Effect, PipelineError> {
    let auxiliary = &bundle.description().channels.auxiliary.columns;
    Ok(effect.at(channel, auxiliary)?)
}
