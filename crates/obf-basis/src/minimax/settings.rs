//! Settings of the minimax descent.

use crate::BasisError;

/// Unchecked settings of [`crate::polish_minimax`].
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `extra_starts` | 3 | Leja starts tried beside the start given | 0..=10000 |
/// | `max_iterations` | 600 | Newton steps of one descent | 1..=1000000 |
/// | `seed` | 1 | seed of the extra starts | any |
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MinimaxSettings {
    pub(crate) extra_starts: usize,
    pub(crate) max_iterations: usize,
    pub(crate) seed: u64,
}

impl Default for MinimaxSettings {
    fn default() -> Self {
        Self {
            extra_starts: 3,
            max_iterations: 600,
            seed: 1,
        }
    }
}

impl MinimaxSettings {
    /// Leja starts beside the start given.
    #[must_use]
    pub fn extra_starts(mut self, extra_starts: usize) -> Self {
        self.extra_starts = extra_starts;
        self
    }

    /// Newton steps of one descent.
    #[must_use]
    pub fn max_iterations(mut self, max_iterations: usize) -> Self {
        self.max_iterations = max_iterations;
        self
    }

    /// Seed of the extra starts.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Settings that the search accepts.
    ///
    /// # Errors
    /// [`BasisError::Setting`].
    pub fn check(self) -> Result<CheckedMinimax, BasisError> {
        within("extra_starts", self.extra_starts, 0, 10_000, "0..=10000")?;
        within("max_iterations", self.max_iterations, 1, 1_000_000, "1..=1000000")?;
        Ok(CheckedMinimax(self))
    }
}

/// Settings within their ranges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckedMinimax(MinimaxSettings);

impl CheckedMinimax {
    /// The settings.
    pub fn settings(&self) -> &MinimaxSettings {
        &self.0
    }
}

pub(crate) fn within(
    name: &'static str,
    value: usize,
    low: usize,
    high: usize,
    range: &'static str,
) -> Result<(), BasisError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(BasisError::Setting {
            name,
            value: value as f64,
            range,
        })
    }
}
