//! How large the experiment is.

/// Numbers that set the size; everything else is the same code.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Size {
    /// Name in the results.
    pub(crate) name: &'static str,
    /// Equidistant positions.
    pub(crate) positions: usize,
    /// Samples a period.
    pub(crate) period: usize,
    /// Periods of an experiment.
    pub(crate) periods: usize,
    /// Periods dropped.
    pub(crate) skip: usize,
    /// Basis sizes of the table over n_g.
    pub(crate) functions: Vec<usize>,
    /// Order of the paper's polynomials.
    pub(crate) order: usize,
    /// Test positions between two neighbouring positions, plus one.
    pub(crate) refinement: usize,
    /// Positions of the pole locus that stands for the continuum.
    pub(crate) continuum: usize,
}

impl Size {
    /// The paper's: 21 positions, 25 periods of 2^15 samples, two experiments each: 34.4 million samples.
    pub(crate) fn full() -> Self {
        Self {
            name: "full",
            positions: 21,
            period: 1 << 15,
            periods: 25,
            skip: 10,
            functions: vec![8, 12, 16, 20, 24, 28, 32],
            order: 17,
            refinement: 4,
            continuum: 2001,
        }
    }

    /// For continuous integration.
    pub(crate) fn quick() -> Self {
        Self {
            name: "quick",
            period: 1 << 13,
            periods: 12,
            skip: 4,
            functions: vec![8, 16],
            refinement: 2,
            continuum: 401,
            ..Self::full()
        }
    }
}

/// Basis sizes of the paper's Table I.
pub(crate) const TABLE_FUNCTIONS: [usize; 4] = [4, 8, 12, 16];
/// The paper's Table I: cost on the estimated poles, in dB.
pub(crate) const PAPER_GRID_DB: [f64; 4] = [-61.061, -125.884, -197.604, -257.905];
/// The paper's Table I: cost on the true poles, in dB.
pub(crate) const PAPER_TRUE_DB: [f64; 4] = [-1.651, -7.084, -12.03, -16.845];
/// Basis size that the paper chooses.
pub(crate) const CHOSEN_FUNCTIONS: usize = 16;
/// Standard deviations of the measurement noise (11), m and rad.
pub(crate) const NOISE: [f64; 2] = [1e-7 / 3.0, 5e-6 / 3.0];
