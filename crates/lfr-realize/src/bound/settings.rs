//! Settings of a bound.

use lfr_fit::FitError;

/// How to bound. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `tolerance` | 0.25 | how far the bound may lie above the largest difference met, relative | above 0, at most 10 |
/// | `floor` | 1e-6 | a relative difference that is small enough in any case | 0 or more |
/// | `max_cells` | 2000 | most halvings a line | 1 to 1000000 |
/// | `lines` | 40 | lines of a position that [`crate::bound_between`] looks at | 1 or more |
/// | `iterations` | 10 | most iterations of each of its two fits | 1 to 1000 |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundSettings {
    /// How far the bound may lie above the largest difference met.
    pub tolerance: f64,
    /// A difference that is small enough.
    pub floor: f64,
    /// Most halvings a line.
    pub max_cells: usize,
    /// Lines of a position.
    pub lines: usize,
    /// Most iterations of a fit to a part of the positions.
    pub iterations: usize,
}

impl Default for BoundSettings {
    fn default() -> Self {
        Self {
            tolerance: 0.25,
            floor: 1e-6,
            max_cells: 2000,
            lines: 40,
            iterations: 10,
        }
    }
}

impl BoundSettings {
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`].
    pub fn check(&self) -> Result<(), FitError> {
        let tolerance = self.tolerance;
        let good = tolerance > 0.0 && tolerance <= 10.0;
        FitError::unless(good, "tolerance", tolerance, "give above 0, at most 10")?;
        let good = self.floor.is_finite() && self.floor >= 0.0;
        FitError::unless(good, "floor", self.floor, "give a finite number, not negative")?;
        let cells = self.max_cells;
        let good = (1..=1_000_000).contains(&cells);
        FitError::unless(good, "max_cells", cells as f64, "give 1 to 1000000")?;
        FitError::unless(self.lines > 0, "lines", self.lines as f64, "give 1 or more")?;
        let iterations = self.iterations;
        let good = (1..=1000).contains(&iterations);
        FitError::unless(good, "iterations", iterations as f64, "give 1 to 1000")?;
        Ok(())
    }
}
