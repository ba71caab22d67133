//! A mass or inertia that differs from the one identified.

use crate::base::Base;
use crate::effect::{Block, Effect, EffectParameter, Family, Needs, Place, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "payload",
    family: Family::Structure,
    place: Place::Motor(0),
    needs: Needs::Table,
    meaning: "mass and inertia of the load that differ from those identified",
    parameters: &[
        EffectParameter {
            name: "mass",
            unit: "kg",
            scale: Scale::Linear,
        },
        EffectParameter {
            name: "inertia",
            unit: "kg m^2",
            scale: Scale::Linear,
        },
    ],
    extends: None,
    starts: |_, _| vec![vec![0.0; 2]],
    on_response: None,
    block: |v, _, _| {
        Box::new(Payload {
            mass: v[0],
            inertia: v[1],
        })
    },
};

#[derive(Debug)]
struct Payload {
    mass: f64,
    inertia: f64,
}

impl Block for Payload {
    fn mount(&self, machine: &mut Base) {
        machine.load_more(self.mass, self.inertia);
    }
}
