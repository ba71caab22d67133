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

/// Unchecked settings of [`crate::fkcm`].
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
    pub(crate) functions: usize,
    pub(crate) real_centres: Option<usize>,
    pub(crate) fuzziness: f64,
    pub(crate) starts: usize,
    pub(crate) max_iterations: usize,
    pub(crate) tolerance: f64,
    pub(crate) refinement: Refinement,
    pub(crate) seed: u64,
}

impl FkcmSettings {
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

    /// Number of basis functions.
    #[must_use]
    pub fn functions(mut self, functions: usize) -> Self {
        self.functions = functions;
        self
    }

    /// Real poles among the functions.
    #[must_use]
    pub fn real_centres(mut self, real_centres: usize) -> Self {
        self.real_centres = Some(real_centres);
        self
    }

    /// Exponent m.
    #[must_use]
    pub fn fuzziness(mut self, fuzziness: f64) -> Self {
        self.fuzziness = fuzziness;
        self
    }

    /// Number of starts.
    #[must_use]
    pub fn starts(mut self, starts: usize) -> Self {
        self.starts = starts;
        self
    }

    /// Alternations of one start.
    #[must_use]
    pub fn max_iterations(mut self, max_iterations: usize) -> Self {
        self.max_iterations = max_iterations;
        self
    }

    /// Change of the logarithmic fuzzy cost that ends the alternation.
    #[must_use]
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// What follows the alternation.
    #[must_use]
    pub fn refinement(mut self, refinement: Refinement) -> Self {
        self.refinement = refinement;
        self
    }

    /// Seed of the starts.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Settings that the search accepts.
    ///
    /// # Errors
    /// [`BasisError::Setting`], [`BasisError::Functions`].
    pub fn check(self) -> Result<CheckedFkcm, BasisError> {
        if self.functions == 0 || self.functions > MAX_FUNCTIONS {
            return Err(BasisError::Functions {
                functions: self.functions,
                limit: MAX_FUNCTIONS,
            });
        }
        let reals = self.real_centres.unwrap_or(self.functions % 2);
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
        Ok(CheckedFkcm {
            reals,
            settings: self,
        })
    }
}

/// Settings within their ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedFkcm {
    settings: FkcmSettings,
    reals: usize,
}

impl CheckedFkcm {
    /// The settings.
    pub fn settings(&self) -> &FkcmSettings {
        &self.settings
    }

    /// Number of real poles.
    pub fn real_centres(&self) -> usize {
        self.reals
    }

    /// Number of conjugate pairs.
    pub fn pairs(&self) -> usize {
        (self.settings.functions - self.reals) / 2
    }
}
