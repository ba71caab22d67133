//! Slow change in time.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Place, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at(Place::Output(0)), at(Place::Output(1))];

const fn at(place: Place) -> Effect {
    Effect {
        name: "sensor-drift",
        family: Family::Sensor,
        place,
        needs: Needs::of(place),
        meaning: "slow change of a sensor in time, from the start of a record",
        parameters: &[
            EffectParameter {
                name: "drift",
                unit: "y",
                scale: Scale::Linear,
            },
            EffectParameter {
                name: "time_constant",
                unit: "s",
                scale: Scale::Duration,
            },
        ],
        extends: None,
        starts: &|screen, _| {
            [0.05, 0.2, 1.0]
                .map(|part| vec![0.0, part * screen.duration()])
                .to_vec()
        },
        on_response: None,
        block: &|v, _, place| {
            Box::new(Drift {
                channel: place.first(),
                drift: v[0],
                rate: v[1].recip(),
            })
        },
    }
}

#[derive(Debug)]
struct Drift {
    channel: usize,
    drift: f64,
    rate: f64,
}

impl Block for Drift {
    fn sense(&self, at: &Moment<'_>, _own: &[f64], outputs: &mut Pair) {
        outputs[self.channel] -= self.drift * (-at.time * self.rate).exp_m1();
    }
}
