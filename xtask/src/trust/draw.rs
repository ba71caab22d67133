//! Random numbers of a case: one seed, split by name.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws of one case.
pub(crate) struct Draw(ChaCha8Rng);

impl Draw {
    /// The draws of the case `index` of `name`.
    pub(crate) fn new(seed: u64, name: &str, index: u64) -> Self {
        // FNV-1a: the same on every machine and with every version of the library.
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for byte in name.bytes().chain(seed.to_le_bytes()).chain(index.to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Self(ChaCha8Rng::seed_from_u64(hash))
    }
    /// Uniform from `low` to `high`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }
    /// Uniform in the logarithm: decades are equally likely.
    pub(crate) fn decades(&mut self, low: f64, high: f64) -> f64 {
        (self.uniform(low.ln(), high.ln())).exp()
    }
    /// An integer from `low` to `high`, both included.
    pub(crate) fn integer(&mut self, low: usize, high: usize) -> usize {
        self.0.random_range(low..=high)
    }
    /// One of the choices; the first of none does not exist, so they are an array.
    pub(crate) fn pick<T: Copy, const N: usize>(&mut self, choices: [T; N]) -> T {
        choices[self.integer(0, N - 1)]
    }
    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }
    /// -1 or 1.
    pub(crate) fn sign(&mut self) -> f64 {
        self.pick([-1.0, 1.0])
    }
    /// Standard normal, by Box and Muller.
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.random::<f64>()).cos()
    }
    /// `count` normal numbers of this deviation.
    pub(crate) fn noise(&mut self, deviation: f64, count: usize) -> Vec<f64> {
        (0..count).map(|_| deviation * self.normal()).collect()
    }
}
