//! A machine with effects, as numbers and as blocks.

use crate::base::Base;
use crate::effect::{Block, Effect, EffectParameter, Family, Scale};

/// A machine and the effects that were added to it, with their values.
#[derive(Debug, Clone)]
pub struct Explained {
    /// The machine.
    pub base: Base,
    /// Effects and their values, in the order in which they were added.
    pub effects: Vec<(&'static Effect, Vec<f64>)>,
}

impl Explained {
    /// What the effects do, in the order in which forces meet them: the drive first.
    pub(crate) fn blocks(&self) -> Vec<Box<dyn Block>> {
        let block = |(e, v): &(&'static Effect, Vec<f64>)| {
            let block = (e.block)(v, &self.base, e.place);
            (e.family != Family::Actuator, block)
        };
        let mut all: Vec<_> = self.effects.iter().map(block).collect();
        all.sort_by_key(|(order, _)| *order);
        all.into_iter().map(|(_, block)| block).collect()
    }

    /// The base with what effects mount on it: a payload is part of its masses.
    #[must_use]
    pub fn mounted_base(&self) -> Base {
        let mut base = self.base.clone();
        self.blocks().iter().for_each(|b| b.mount(&mut base));
        base
    }

    /// The machine's coordinates, then those of the effects.
    pub(crate) fn coordinates(&self) -> Vec<f64> {
        let mut all = self.base.coordinates();
        for (effect, values) in &self.effects {
            let coordinate = |(v, p): (&f64, &EffectParameter)| match p.scale.is_logarithm() {
                true => v.ln(),
                false => *v,
            };
            all.extend(fitted(effect, values).map(coordinate));
        }
        all
    }

    /// Which coordinates are logarithms.
    pub(crate) fn bounded(&self) -> Vec<bool> {
        let machine = self.base.fitted().map(|p| p.positive);
        let effects = self.effects.iter().flat_map(|(e, values)| fitted(e, values));
        machine
            .chain(effects.map(|(_, p)| p.scale.is_logarithm()))
            .collect()
    }

    /// Derivatives of the values by their coordinates: of the machine's that are fitted, then of the effects'.
    pub(crate) fn scales(&self) -> Vec<f64> {
        let machine = self.base.fitted().map(|p| if p.positive { p.value } else { 1.0 });
        let effects = self.effects.iter().flat_map(|(e, values)| fitted(e, values));
        let effect = |(v, p): (&f64, &EffectParameter)| match p.scale.is_logarithm() {
            true => v.abs(),
            false => 1.0,
        };
        machine.chain(effects.map(effect)).collect()
    }

    pub(crate) fn with(&self, coordinates: &[f64]) -> Self {
        let own = self.base.coordinates().len();
        let mut rest = coordinates[own..].iter();
        Self {
            base: self.base.with_coordinates(&coordinates[..own]),
            effects: self
                .effects
                .iter()
                .map(|(effect, before)| {
                    let value = |(before, p): (&f64, &EffectParameter)| {
                        let next = if p.scale.is_fitted() { rest.next() } else { None };
                        match (p.scale, next) {
                            (_, None) => *before,
                            (Scale::NotNegative, Some(c)) => c.max(0.0),
                            (scale, Some(c)) if scale.is_logarithm() => c.exp(),
                            (_, Some(c)) => *c,
                        }
                    };
                    (*effect, before.iter().zip(effect.parameters).map(value).collect())
                })
                .collect(),
        }
    }
}

/// Values of an effect that a fit moves.
fn fitted<'a>(
    effect: &'static Effect,
    values: &'a [f64],
) -> impl Iterator<Item = (&'a f64, &'static EffectParameter)> {
    values
        .iter()
        .zip(effect.parameters)
        .filter(|(_, p)| p.scale.is_fitted())
}
