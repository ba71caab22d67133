//! Settings of a growth.

use crate::{FitError, RefineSettings, ResidualUnit};

/// What the long fit does with the gain of the rigid body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GainFit {
    /// It stays as given, exactly: right where it is known.
    #[default]
    Fixed,
    /// Its entries that are not zero are fitted too, to all positions: right where it comes from the noisy data of one.
    Free,
}

/// What the deltas may reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DeltaReach {
    /// The states only: C does not depend on p, and no response has a direct term.
    #[default]
    States,
    /// The outputs too, see [`crate::Candidate::with_free_outputs`]: fewer deltas may do.
    Outputs,
}

/// When the search for a start ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StartSearch {
    /// With the first model that reaches the target, or when three starts have ended at the same residual, the least of
    /// all.
    #[default]
    UntilReached,
    /// After all starts, each with its long fit: to compare them.
    All,
}

/// How to grow. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `seed` | 0 | of the first random start; the next ones count on | |
/// | `size` | 1e-3 | size of the random channels, see [`crate::RandomChannels`] | above 0 |
/// | `restarts` | 8 | random starts, if the first one does not reach the target | 0 to 1000 |
/// | `search` | `UntilReached` | whether starts that are not needed are made too | |
/// | `lines` | 40 | lines a position before the long fit | 1 or more |
/// | `start_iterations` | 100 | most iterations of a stage before the long fit | 1 to 100000 |
/// | `reach` | `States` | whether D21 is free | |
/// | `gain` | `Fixed` | whether the long fit moves the gain of the rigid body | |
/// | `target` | `None` | rms residual at which no further start is needed; `None`: 3e-5 relative, 1.1 standard deviations | above 0 |
/// | `refine` | those of [`RefineSettings`] | the long fit | |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrowSettings {
    /// Seed of the first random start.
    pub seed: u64,
    /// Size of the random channels.
    pub size: f64,
    /// Random starts, if the first one does not reach the target.
    pub restarts: usize,
    /// Whether starts that are not needed are made too.
    pub search: StartSearch,
    /// Lines a position before the long fit.
    pub lines: usize,
    /// Most iterations of a stage before the long fit.
    pub start_iterations: usize,
    /// Whether D21 is free.
    pub reach: DeltaReach,
    /// Whether the long fit moves the gain of the rigid body.
    pub gain: GainFit,
    /// Rms residual at which no further start is needed.
    pub target: Option<f64>,
    /// The long fit.
    pub refine: RefineSettings,
}

impl Default for GrowSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            size: 1e-3,
            restarts: 8,
            search: StartSearch::default(),
            lines: 40,
            start_iterations: 100,
            reach: DeltaReach::default(),
            gain: GainFit::default(),
            target: None,
            refine: RefineSettings::default(),
        }
    }
}

impl GrowSettings {
    /// The target in the unit of the data.
    pub(crate) fn target(&self, unit: ResidualUnit) -> f64 {
        self.target.unwrap_or(match unit {
            ResidualUnit::Relative => 3e-5,
            ResidualUnit::StandardDeviation => 1.1,
        })
    }

    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn check(&self) -> Result<(), FitError> {
        let size = self.size;
        FitError::unless(
            size.is_finite() && size > 0.0,
            "size",
            size,
            "give a finite number above 0",
        )?;
        let restarts = self.restarts;
        FitError::unless(restarts <= 1000, "restarts", restarts as f64, "give 0 to 1000")?;
        FitError::unless(self.lines > 0, "lines", self.lines as f64, "give 1 or more")?;
        let most = self.start_iterations;
        let good = (1..=100_000).contains(&most);
        FitError::unless(good, "start_iterations", most as f64, "give 1 to 100000")?;
        if let Some(target) = self.target {
            let good = target.is_finite() && target > 0.0;
            FitError::unless(good, "target", target, "give a finite number above 0")?;
        }
        self.refine.check()
    }
}
