//! A model with the effects that were added to it, as a model file keeps it.

use super::base::{axis_of, lpv};
use super::places::{base_parameters, channel};
use super::{FoundEffect, Value, user};
use crate::PipelineError;
use experiment_data::Bundle;
use lpv_core::Model;
use lpv_diagnose::catalogue;
use lpv_diagnose::effect::Effect;
use lpv_diagnose::{Axis, Base, Explained, Load, table_from_geometry};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a file says of the machine behind its model: which base it is, with which parameters, and the effects.
///
/// A simulation takes the machine from here. The model of the file is its linear part: of an identified base as it was given, and
/// of others with these parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// Kind of the base.
    pub base: BaseKind,
    /// Parameters of the base model, fitted together with the effects.
    pub base_parameters: BTreeMap<String, Value>,
    /// The effects, in the order in which they were added.
    pub effects: Vec<FoundEffect>,
}

/// Kinds of base models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BaseKind {
    /// Carriage and beam from first principles.
    XyTable,
    /// One servo axis.
    ServoAxis,
    /// One axis on a spring to ground.
    SpringAxis,
    /// Motor and load on a spring, with the encoder on the motor.
    MotorAndLoad,
    /// The same with the encoder on the load.
    MotorAndMeasuredLoad,
    /// The model of the file.
    Identified,
}

impl BaseKind {
    /// Whether an axis is of one body.
    pub(super) fn is_rigid(self) -> bool {
        !matches!(self, Self::MotorAndLoad | Self::MotorAndMeasuredLoad)
    }

    pub(super) fn of(base: &Base) -> Self {
        match base {
            Base::XyTable(_) => Self::XyTable,
            Base::Axis(axis) => match axis.load() {
                Some(load) if load.is_measured => Self::MotorAndMeasuredLoad,
                Some(_) => Self::MotorAndLoad,
                None if axis.stiffness().is_some() => Self::SpringAxis,
                None => Self::ServoAxis,
            },
            Base::Lpv(_) => Self::Identified,
        }
    }
}

impl Explanation {
    /// A base without effects, with standard deviations of its parameters.
    pub(crate) fn of_base(base: &Base, deviations: &[f64], bundle: &Bundle) -> Self {
        Self {
            base: BaseKind::of(base),
            base_parameters: base_parameters(base, deviations, bundle),
            effects: Vec::new(),
        }
    }

    /// The machine on a bundle, whose geometry says where its motors are.
    ///
    /// # Errors
    /// [`PipelineError::Structure`] for a bundle without the geometry of the base, an effect that the catalogue does not know, one
    /// that the base cannot have, or one with a parameter out of its range;
    /// [`PipelineError::Channels`].
    pub fn machine(&self, model: &Model, bundle: &Bundle) -> Result<Explained, PipelineError> {
        let base = match self.base {
            BaseKind::XyTable => {
                let geometry = bundle
                    .description()
                    .geometry
                    .as_ref()
                    .ok_or(PipelineError::Structure {
                        problem: "the model is an xy-table from first principles: give the bundle its [geometry]",
                    })?;
                // Modes and damping are among the parameters.
                Base::XyTable(table_from_geometry(geometry, [1.0, 1.0], 0.02)?)
            }
            BaseKind::ServoAxis => axis_of(model)?,
            // All that it has is among its parameters.
            BaseKind::SpringAxis => Base::Axis(Axis::new(1.0, 0.0, 0.0).on_spring(1.0)),
            BaseKind::MotorAndLoad | BaseKind::MotorAndMeasuredLoad => {
                Base::Axis(Axis::new(1.0, 0.0, 0.0).with_load(Load {
                    part: 0.5,
                    hz: 1.0,
                    ratio: 0.05,
                    is_measured: self.base == BaseKind::MotorAndMeasuredLoad,
                }))
            }
            BaseKind::Identified => Base::Lpv(lpv(model, bundle)?),
        };
        let base = base.with_values(|name| self.base_parameters.get(name).map(|v| v.value));
        let effects = self
            .effects
            .iter()
            .map(|found| {
                let own = found.definition.iter().map(|own| user::placed(std::slice::from_ref(own), bundle));
                let own = own.collect::<Result<Vec<_>, _>>()?.concat();
                let known = catalogue::all().filter(|e| is_of(e, found));
                let mut places = own.into_iter().chain(known).peekable();
                places.peek().ok_or(PipelineError::Structure {
                    problem: "the model has an effect that the catalogue of this version does not know; diagnose the bundle again",
                })?;
                let mut places = places.filter(|e| e.suits(&base)).peekable();
                places.peek().ok_or(PipelineError::Structure {
                    problem: "an effect of the model acts on what its base does not have (masses and couplings of an xy-table, or a second \
                              motor); take it out of the file or diagnose the bundle again",
                })?;
                let is_there = |e: &&Effect| channel(e, bundle) == found.channel;
                let effect = places.find(is_there).ok_or(PipelineError::Structure {
                    problem: "an effect of the model acts at a channel at which this bundle has none of its kind; name the channels of the \
                              bundle as those of the model, or diagnose the bundle again",
                })?;
                let value = |name: &str| {
                    found
                        .parameters
                        .get(name)
                        .map(|v| v.value)
                        .ok_or(PipelineError::Structure {
                            problem: "an effect of the model lacks a parameter; diagnose the bundle again",
                        })
                };
                let values = effect.parameters.iter().map(|p| value(p.name));
                let values = values.collect::<Result<Vec<f64>, _>>()?;
                if !effect.allows(&values) {
                    return Err(PipelineError::Structure {
                        problem: "a parameter of an effect of the model is out of its range: times, speeds, lengths and frequencies are above \
                                  zero, levels not below; correct the file or diagnose the bundle again",
                    });
                }
                Ok((effect, values))
            })
            .collect::<Result<Vec<_>, PipelineError>>()?;
        Ok(Explained { base, effects })
    }

    /// In words, one line an entry.
    pub fn lines(&self) -> Vec<String> {
        let value = |(name, v): (&String, &Value)| {
            let std = v.std.map_or(String::new(), |s| format!(" ({s:.1e})"));
            format!("{name} {:.5e}{std} {}", v.value, v.unit)
                .trim_end()
                .to_owned()
        };
        let effect = |e: &FoundEffect| {
            let values: Vec<String> = e.parameters.iter().map(value).collect();
            format!("{} at {}: {}", e.effect, e.channel, values.join(", "))
        };
        self.base_parameters
            .iter()
            .map(value)
            .chain(self.effects.iter().map(effect))
            .collect()
    }
}

/// Whether the catalogue means this by the name: some effects have two forms, with parameters of their own.
fn is_of(effect: &Effect, found: &FoundEffect) -> bool {
    let forms = catalogue::all().filter(|e| e.name == found.effect && e.place == effect.place);
    let has = |e: &Effect| {
        let is_there = e.parameters.iter().all(|p| found.parameters.contains_key(p.name));
        is_there && e.parameters.len() == found.parameters.len()
    };
    effect.name == found.effect && (has(effect) || !forms.into_iter().any(has))
}
