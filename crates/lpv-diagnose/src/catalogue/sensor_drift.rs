//! Slow change in time.

use crate::base::Pair;
use crate::effect::{Block, Effect, EffectParameter, Family, Moment, Needs, Scale};

pub(super) static EFFECTS: [Effect; 2] = [at::<0>(), at::<1>()];

const fn at<const CHANNEL: usize>() -> Effect {
    Effect {
        name: "sensor-drift",
        family: Family::Sensor,
        channel: CHANNEL,
        needs: Needs::sensor(CHANNEL),
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
        on_response: None,
        block: |v, _| {
            Box::new(Drift::<CHANNEL> {
                drift: v[0],
                rate: v[1].recip(),
            })
        },
    }
}

#[derive(Debug)]
struct Drift<const CHANNEL: usize> {
    drift: f64,
    rate: f64,
}

impl<const CHANNEL: usize> Block for Drift<CHANNEL> {
    fn sense(&self, at: &Moment<'_>, outputs: &mut Pair) {
        outputs[CHANNEL] -= self.drift * (-at.time * self.rate).exp_m1();
    }
}
