//! Settings of the minimax descent.

use crate::BasisError;

/// Settings of [`crate::polish_minimax`], which checks them.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `extra_starts` | 3 | Leja starts tried beside the start given | 0..=10000 |
/// | `max_iterations` | 600 | Newton steps of one descent | 1..=1000000 |
/// | `seed` | 1 | seed of the extra starts | any |
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MinimaxSettings {
    /// Leja starts tried beside the start given.
    pub extra_starts: usize,
    /// Newton steps of one descent.
    pub max_iterations: usize,
    /// Seed of the extra starts.
    pub seed: u64,
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
    /// Settings that the search accepts.
    ///
    /// # Errors
    /// [`BasisError::Setting`].
    pub fn check(&self) -> Result<(), BasisError> {
        within("extra_starts", self.extra_starts, 0, 10_000, "0..=10000")?;
        within("max_iterations", self.max_iterations, 1, 1_000_000, "1..=1000000")?;
        Ok(())
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
