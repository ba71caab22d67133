//! Slow change in time.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};

pub(super) static EFFECT: Effect = Effect {
    name: "sensor-drift",
    family: Family::Sensor,
    channel: 0,
    needs: Needs::Nothing,
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
    starts: |screen| {
        [0.05, 0.2, 1.0]
            .map(|part| vec![0.0, part * screen.duration()])
            .to_vec()
    },
    block: |v, _| {
        Box::new(Drift {
            drift: v[0],
            rate: v[1].recip(),
        })
    },
};

#[derive(Debug)]
struct Drift {
    drift: f64,
    rate: f64,
}

impl Block for Drift {
    fn sense(&self, at: &Moment<'_>, outputs: &mut Pair) {
        outputs[0] -= self.drift * (-at.time * self.rate).exp_m1();
    }
}
