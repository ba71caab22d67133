//! Settings of a reduction.

use lfr_fit::{FitError, RefineSettings};

/// How to reduce. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `positions` | `None` | grid points a parameter of the fit; `None`: 21 for one parameter, 7 for two, 5 for three, 3 beyond | 2 to 1001 |
/// | `lines` | 160 | equidistant lines up to Nyquist; more are set around the poles of each position | 1 or more |
/// | `refine` | those of [`RefineSettings`] | the last fit, on all lines | |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReduceSettings {
    /// Grid points a parameter.
    pub positions: Option<usize>,
    /// Equidistant lines.
    pub lines: usize,
    /// The last fit.
    pub refine: RefineSettings,
}

impl Default for ReduceSettings {
    fn default() -> Self {
        Self {
            positions: None,
            lines: 160,
            refine: RefineSettings::default(),
        }
    }
}

impl ReduceSettings {
    pub(super) fn positions(&self, parameters: usize) -> usize {
        self.positions.unwrap_or(match parameters {
            0 | 1 => 21,
            2 => 7,
            3 => 5,
            _ => 3,
        })
    }

    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn check(&self) -> Result<(), FitError> {
        if let Some(positions) = self.positions {
            let good = (2..=1001).contains(&positions);
            FitError::unless(good, "positions", positions as f64, "give 2 to 1001")?;
        }
        FitError::unless(self.lines > 0, "lines", self.lines as f64, "give 1 or more")?;
        self.refine.check()?;
        Ok(())
    }
}
