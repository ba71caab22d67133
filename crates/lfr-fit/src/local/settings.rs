//! Settings of a local model.

use crate::{FitError, RefineSettings};

/// What is known about the gain of the rigid body, `gamma` (`n_y x n_u`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RigidGain {
    /// There is no rigid body.
    Absent,
    /// Only its diagonal is estimated: the axes are decoupled.
    Diagonal,
    /// All of it is estimated.
    Full,
    /// All of it, and again only its diagonal if the rest lies within three standard deviations of zero, or below 1e-6
    /// of the diagonal.
    #[default]
    Decide,
}

/// How to make a local model. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `rigid` | `Decide` | the gain of double integrators | |
/// | `states` | all poles given | flexible states to keep: the modes that contribute most | 1 or more |
/// | `refine` | those of [`RefineSettings`] | the fit that follows the linear one | |
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LocalSettings {
    /// What is known about the gain of the rigid body.
    pub rigid: RigidGain,
    /// Flexible states to keep; none: all.
    pub states: Option<usize>,
    /// The fit that follows the linear one.
    pub refine: RefineSettings,
}

impl LocalSettings {
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn check(&self) -> Result<(), FitError> {
        if let Some(states) = self.states {
            FitError::unless(states > 0, "states", states as f64, "give 1 or more")?;
        }
        self.refine.check()
    }
}
