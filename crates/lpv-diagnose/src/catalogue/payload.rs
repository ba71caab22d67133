//! A mass or inertia that differs from the one identified.

use super::since::{self, Since};
use crate::base::Base;
use crate::effect::{Block, Effect, EffectParameter, Family, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [OF_A_TABLE, OF_A_RECORD];

const OF_A_TABLE: Effect = Effect {
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
    starts: &|_, _| vec![vec![0.0; 2]],
    on_response: None,
    block: &|v, _, _| {
        Box::new(Payload {
            mass: v[0],
            inertia: v[1],
        })
    },
};

/// The mass of an axis is fitted: what one record has more than the others.
const OF_A_RECORD: Effect = Effect {
    needs: Needs::Axis,
    meaning: "mass that one record has more than the others",
    parameters: &[
        EffectParameter {
            name: "mass",
            unit: "u s^2/y",
            scale: Scale::Linear,
        },
        since::RECORD,
    ],
    starts: &|screen, _| {
        let single = since::single(screen).into_iter();
        single.map(|record| vec![0.0, record as f64]).collect()
    },
    block: &|v, _, _| super::mass_jump::more(v[0], Since::new(f64::NEG_INFINITY, v[1])),
    ..OF_A_TABLE
};

/// The form that one record has.
pub(super) fn of_a_record() -> &'static Effect {
    &EFFECTS[1]
}

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
