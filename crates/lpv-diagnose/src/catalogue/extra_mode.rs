//! A resonance that the model does not have.

use super::parameter;
use crate::base::Forces;
use crate::effect::{
    Block, Effect, EffectParameter, Extends, Family, Lines, Moment, Needs, Path, Place, Scale,
};
use crate::screen::Screen;
use num_complex::Complex64 as C64;
use std::f64::consts::TAU;

/// Of coupled motors the load is a body of the machine, else what the input of the channel drives.
pub(super) static EFFECTS: [Effect; 3] = [
    Effect {
        needs: Needs::CoupledMotors,
        parameters: &[parameter("mass", "kg", Scale::NotNegative), FREQUENCY, DAMPING],
        ..at(Place::Motor(0))
    },
    at(Place::Motor(0)),
    at(Place::Motor(1)),
];

const FREQUENCY: EffectParameter = parameter("frequency", "Hz", Scale::Frequency);
const DAMPING: EffectParameter = parameter("damping", "", Scale::Logarithmic);

const fn at(place: Place) -> Effect {
    Effect {
        name: "extra-mode",
        family: Family::Structure,
        place,
        needs: Needs::OwnMotor(place.first()),
        meaning: "mass on the load that swings on a spring",
        parameters: const {
            &[
                parameter("mass", "u s^2/y", Scale::NotNegative),
                FREQUENCY,
                DAMPING,
            ]
        },
        extends: Some(Extends {
            name: "payload",
            // Far below its resonance a mass on a spring is a mass.
            starts: |v, screen, _| match v[0] {
                mass if mass > 0.0 => frequencies(screen, 30.0)
                    .into_iter()
                    .map(|f| vec![mass, f, 0.02])
                    .collect(),
                _ => Vec::new(),
            },
        }),
        starts: &|screen, _| {
            frequencies(screen, 2.0)
                .into_iter()
                .map(|f| vec![0.0, f, 0.02])
                .collect()
        },
        on_response: Some(swinging_halves),
        block: &|v, _, place| {
            Box::new(Swing {
                channel: place.first(),
                mass: v[0],
                rate: TAU * v[1],
                damping: v[2],
            })
        },
    }
}

/// Half of the mass swings, at one of some frequencies over the band.
fn swinging_halves(on: &Lines) -> Vec<Vec<f64>> {
    const TRIED: usize = 12;
    let [low, high] = on.band_hz;
    (0..TRIED)
        .map(|i| low * (high / low).powf((i as f64 + 0.5) / TRIED as f64))
        .map(|f| vec![0.5 * on.mass, f, 0.02])
        .collect()
}

/// From what a record shows a few times to near Nyquist, so many to a factor of e.
fn frequencies(screen: &Screen<'_>, density: f64) -> Vec<f64> {
    let high = 0.45 / screen.step();
    let low = (4.0 / screen.duration()).max(high / 60.0);
    let count = (density * (high / low).ln()).ceil() as usize;
    (0..=count)
        .map(|i| low * (high / low).powf(i as f64 / count as f64))
        .collect()
}

#[derive(Debug)]
struct Swing {
    channel: usize,
    mass: f64,
    rate: f64,
    damping: f64,
}

impl Block for Swing {
    fn states(&self) -> usize {
        2
    }

    fn start(&self, at: &Moment<'_>, own: &mut [f64]) {
        own.copy_from_slice(&[
            at.motion.load_position[self.channel],
            at.motion.load_speed[self.channel],
        ]);
    }

    fn act(&self, at: &Moment<'_>, own: &[f64], rates: &mut [f64], forces: &mut Forces) {
        let stretch = own[0] - at.motion.load_position[self.channel];
        let speed = own[1] - at.motion.load_speed[self.channel];
        let pull = self.rate * (self.rate * stretch + 2.0 * self.damping * speed);
        rates.copy_from_slice(&[own[1], -pull]);
        forces.load[self.channel] += self.mass * pull;
    }

    fn respond(&self, s: C64, path: &mut Path) {
        let spring = (s * (2.0 * self.damping) + self.rate) * self.rate;
        let follow = spring / (s * s + spring);
        path.dynamic += s * s * follow * self.mass;
        path.follow *= follow;
    }
}
