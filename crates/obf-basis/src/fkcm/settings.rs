//! Settings of the fuzzy search.

use crate::BasisError;
use crate::minimax::within;
use crate::poles::MAX_FUNCTIONS;

/// What follows the alternation of memberships and centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Refinement {
    /// Move all centres together on the same fuzzy cost, where the alternation can no longer improve one alone.
    #[default]
    Joint,
    /// Nothing: the alternation as published.
    None,
}

/// Settings of [`crate::fkcm`], which checks them.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `functions` | (given) | number of basis functions n_g; a pair counts two | 1..=1024 |
/// | `real_centres` | n_g mod 2 | real poles among them | n_g minus an even number |
/// | `fuzziness` | 35 | exponent m | above 1, at most 1e6 |
/// | `starts` | 8 | Leja starts | 1..=10000 |
/// | `max_iterations` | 100 | alternations of one start; its refinement may take ten times as many Newton steps | 1..=100000 |
/// | `tolerance` | 1e-6 | change of the logarithmic fuzzy cost that ends the alternation | 0..=1 |
/// | `refinement` | `Joint` | what follows the alternation | |
/// | `seed` | 1 | seed of the starts | any |
#[derive(Debug, Clone, PartialEq)]
pub struct FkcmSettings {
    /// Number of basis functions n_g; a pair counts two.
    pub functions: usize,
    /// Real poles among them.
    pub real_centres: Option<usize>,
    /// Exponent m.
    pub fuzziness: f64,
    /// Leja starts.
    pub starts: usize,
    /// Alternations of one start.
    pub max_iterations: usize,
    /// Change of the logarithmic fuzzy cost that ends the alternation.
    pub tolerance: f64,
    /// What follows the alternation.
    pub refinement: Refinement,
    /// Seed of the starts.
    pub seed: u64,
}

impl FkcmSettings {
    /// Number of real poles.
    pub(crate) fn reals(&self) -> usize {
        self.real_centres.unwrap_or(self.functions % 2)
    }

    /// Number of conjugate pairs.
    pub(crate) fn pairs(&self) -> usize {
        (self.functions - self.reals()) / 2
    }

    /// Defaults for `functions` basis functions.
    pub fn new(functions: usize) -> Self {
        Self {
            functions,
            real_centres: None,
            fuzziness: 35.0,
            starts: 8,
            max_iterations: 100,
            tolerance: 1e-6,
            refinement: Refinement::Joint,
            seed: 1,
        }
    }

    /// Settings that the search accepts.
    ///
    /// # Errors
    /// [`BasisError::Setting`], [`BasisError::Functions`].
    pub fn check(&self) -> Result<(), BasisError> {
        if self.functions == 0 || self.functions > MAX_FUNCTIONS {
            return Err(BasisError::Functions {
                functions: self.functions,
                limit: MAX_FUNCTIONS,
            });
        }
        let reals = self.reals();
        if reals > self.functions || !(self.functions - reals).is_multiple_of(2) {
            return Err(BasisError::Setting {
                name: "real_centres",
                value: reals as f64,
                range: "`functions` minus an even number",
            });
        }
        let m = self.fuzziness;
        if !(m > 1.0 && m <= 1e6) {
            return Err(BasisError::Setting {
                name: "fuzziness",
                value: m,
                range: "above 1, at most 1e6",
            });
        }
        if !(0.0..=1.0).contains(&self.tolerance) {
            return Err(BasisError::Setting {
                name: "tolerance",
                value: self.tolerance,
                range: "0..=1",
            });
        }
        within("starts", self.starts, 1, 10_000, "1..=10000")?;
        within("max_iterations", self.max_iterations, 1, 100_000, "1..=100000")?;
        Ok(())
    }
}
