//! What the periods of all experiments at one position leave.

use crate::moments::{Means, Order, Scatter};
use crate::{FrfError, PeriodicSettings};
use lpv_core::Position;

/// Shape of the experiments at one scheduling position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Samples a period, 3 to 2^28.
    pub period: usize,
    /// Plant outputs `n_y`, 1 to 64.
    pub outputs: usize,
    /// Plant inputs `n_u`, 1 to 64.
    pub inputs: usize,
    /// References `n_r`, 0 to 64; 0 where none is recorded.
    pub references: usize,
    /// Experiments `n_e`, `n_u` to 4096; from `2 n_u` on, the groups of `n_u` are taken as realisations.
    pub experiments: usize,
    /// Samples per unit of time, above 0.
    pub sample_rate_hz: f64,
}

impl Layout {
    pub(crate) fn check(&self) -> Result<(), FrfError> {
        let counts = [
            ("period", self.period, 3, 1 << 28, "3 to 268435456"),
            ("outputs", self.outputs, 1, 64, "1 to 64"),
            ("inputs", self.inputs, 1, 64, "1 to 64"),
            ("references", self.references, 0, 64, "0 to 64"),
            ("experiments", self.experiments, 1, 4096, "1 to 4096"),
        ];
        for (field, count, low, high, expected) in counts {
            if !(low..=high).contains(&count) {
                let value = count as f64;
                return Err(FrfError::Layout {
                    field,
                    value,
                    expected,
                });
            }
        }
        // Frequencies are k f_s / N and must neither overflow nor run together.
        if !(self.sample_rate_hz >= 1e-200 && self.sample_rate_hz <= 1e200) {
            return Err(FrfError::Layout {
                field: "sample_rate_hz",
                value: self.sample_rate_hz,
                expected: "1e-200 to 1e200",
            });
        }
        if self.experiments < self.inputs {
            return Err(FrfError::TooFewExperiments {
                experiments: self.experiments,
                inputs: self.inputs,
            });
        }
        Ok(())
    }

    /// Frequency of line `k`.
    pub(crate) fn frequency_hz(&self, k: usize) -> f64 {
        k as f64 * self.sample_rate_hz / self.period as f64
    }
}

/// What is kept of one experiment.
pub(crate) struct Experiment {
    pub(crate) next_period: usize,
    /// Outputs, then inputs.
    pub(crate) signals: Means,
    /// First period of the references, to see whether the others repeat it.
    pub(crate) first_reference: Vec<Vec<f64>>,
    pub(crate) reference: Means,
    pub(crate) reference_repeats: bool,
    pub(crate) reference_moves: bool,
}

/// Averages of all experiments at one position.
pub(crate) struct Averages<'a> {
    pub(crate) layout: Layout,
    pub(crate) settings: &'a PeriodicSettings,
    pub(crate) position: Option<Position>,
    pub(crate) skipped: usize,
    /// Lines 1 to this are kept.
    pub(crate) lines: usize,
    pub(crate) transforms: usize,
    /// Where the lines are kept.
    pub(crate) order: Order,
    /// Of outputs and inputs, over all experiments.
    pub(crate) scatter: &'a Scatter,
    pub(crate) experiments: &'a [Experiment],
}
