//! Settings.

use crate::FitError;

/// How to refine. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `max_iterations` | 200 | most iterations | 0 to 100000 |
/// | `tolerance` | 1e-4 | the search ends when eight iterations lower the cost by less than this part | 0 to 0.1, 0 excluded |
/// | `target` | 0 | the search ends when the rms residual is at most this; see [`crate::ResidualUnit`] | 0 or more |
/// | `to_the_end` | false | go on where noise hides what is left to win, until `tolerance` ends it: two computations then agree | |
/// | `minimax_passes` | 0 | reweighted fits after the search that lower the largest residual of a line | 0 to 1000 |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineSettings {
    /// Most iterations.
    pub max_iterations: usize,
    /// Relative decrease of the cost that counts as none.
    pub tolerance: f64,
    /// Rms residual that is low enough.
    pub target: f64,
    /// Whether to go on where noise hides what is left to win.
    pub to_the_end: bool,
    /// Reweighted fits that lower the largest residual.
    pub minimax_passes: usize,
}

impl Default for RefineSettings {
    fn default() -> Self {
        Self {
            max_iterations: 200,
            tolerance: 1e-4,
            target: 0.0,
            to_the_end: false,
            minimax_passes: 0,
        }
    }
}

impl RefineSettings {
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn check(&self) -> Result<(), FitError> {
        let most = self.max_iterations;
        FitError::unless(most <= 100_000, "max_iterations", most as f64, "give 0 to 100000")?;
        let tolerance = self.tolerance;
        let good = tolerance > 0.0 && tolerance <= 0.1;
        FitError::unless(good, "tolerance", tolerance, "give above 0, at most 0.1")?;
        let good = self.target.is_finite() && self.target >= 0.0;
        FitError::unless(good, "target", self.target, "give a finite number, not negative")?;
        let passes = self.minimax_passes;
        FitError::unless(passes <= 1000, "minimax_passes", passes as f64, "give 0 to 1000")?;
        Ok(())
    }
}
