//! Measurement noise (11), in streams that depend on what is measured and never on who computes it.

use crate::PlantError;
use crate::error::not_negative;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Noise of the two position sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// None: for validation copies.
    Off,
    /// Independent normal samples with these standard deviations.
    Normal {
        /// Of y'_1.
        y1_std_m: f64,
        /// Of y'_2.
        y2_std_rad: f64,
    },
}

impl Default for Noise {
    /// The paper's: three standard deviations are 0.1 um and 5 urad.
    fn default() -> Self {
        Self::Normal {
            y1_std_m: 1e-7 / 3.0,
            y2_std_rad: 5e-6 / 3.0,
        }
    }
}

impl Noise {
    /// Standard deviations of the two outputs.
    pub fn deviations(&self) -> [f64; 2] {
        match *self {
            Self::Off => [0.0; 2],
            Self::Normal { y1_std_m, y2_std_rad } => [y1_std_m, y2_std_rad],
        }
    }
    pub(crate) fn check(&self) -> Result<(), PlantError> {
        let [y1, y2] = self.deviations();
        not_negative("y1_std_m", y1)?;
        not_negative("y2_std_rad", y2)
    }
}

/// One stream of noise for both outputs.
pub(crate) struct NoiseStream {
    rng: ChaCha8Rng,
    deviations: [f64; 2],
    off: bool,
}

impl NoiseStream {
    /// The stream of records with moving p, apart from those of experiments at the same position.
    pub(crate) const MOVING: u64 = u64::MAX;

    /// The stream of one experiment: the seed and the position choose the key, the experiment the stream.
    pub(crate) fn new(noise: Noise, seed: u64, position: f64, experiment: u64) -> Self {
        // Adding zero maps -0 to +0, which is the same place.
        let key = mix(seed ^ mix((position + 0.0).to_bits()));
        let mut rng = ChaCha8Rng::seed_from_u64(key);
        rng.set_stream(experiment);
        Self {
            rng,
            deviations: noise.deviations(),
            off: noise == Noise::Off,
        }
    }

    /// Fills both channels with the next samples.
    pub(crate) fn fill(&mut self, first: &mut [f64], second: &mut [f64]) {
        if self.off {
            first.fill(0.0);
            second.fill(0.0);
            return;
        }
        for (a, b) in first.iter_mut().zip(second) {
            *a = self.sample() * self.deviations[0];
            *b = self.sample() * self.deviations[1];
        }
    }

    /// The next pair.
    pub(crate) fn pair(&mut self) -> [f64; 2] {
        let (mut a, mut b) = ([0.0], [0.0]);
        self.fill(&mut a, &mut b);
        [a[0], b[0]]
    }

    fn sample(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }
}

/// The seed of one part of an experiment: one seed enters at the top and is split by name.
pub fn split_seed(seed: u64, name: &str) -> u64 {
    name.bytes()
        .fold(mix(seed), |key, byte| mix(key ^ u64::from(byte)))
}

/// SplitMix64's finaliser: a bijection that spreads every bit.
fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
