//! Which lines of a period are excited.

use crate::PlantError;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Excited lines; line k makes k cycles a period, and line `period / 2` is the Nyquist frequency.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lines {
    /// Every line from 1 to the Nyquist frequency, inclusive.
    #[default]
    Full,
    /// Every odd line: even nonlinear distortion stays off the excited lines.
    Odd,
    /// Odd lines, of which one in each group of `group` neighbours is left out at random, to detect odd distortion.
    OddRandom {
        /// Lines in a group, at least two.
        group: usize,
    },
    /// Every line from `first` to `last`, inclusive.
    Band {
        /// Lowest line, at least 1.
        first: usize,
        /// Highest line.
        last: usize,
    },
    /// These lines, strictly increasing.
    List(Vec<usize>),
}

/// The excited lines and the ones left out on purpose among the odd ones.
pub(crate) struct Selection {
    pub(crate) excited: Vec<usize>,
    pub(crate) detection: Vec<usize>,
}

impl Lines {
    pub(crate) fn select(&self, period: usize, seed: u64) -> Result<Selection, PlantError> {
        let highest = period / 2;
        let mut detection = Vec::new();
        let excited: Vec<usize> = match self {
            Self::Full => (1..=highest).collect(),
            Self::Odd => (1..=highest).step_by(2).collect(),
            Self::OddRandom { group } => {
                if *group < 2 {
                    return Err(PlantError::Setting {
                        field: "lines.odd-random.group",
                        value: *group as f64,
                        problem: "give at least 2, so that a group keeps a line",
                    });
                }
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let odd: Vec<usize> = (1..=highest).step_by(2).collect();
                let mut excited = Vec::with_capacity(odd.len());
                for lines in odd.chunks(*group) {
                    // A last group that is not full keeps all its lines.
                    let left_out = (lines.len() == *group).then(|| rng.random_range(0..*group));
                    for (i, &line) in lines.iter().enumerate() {
                        if Some(i) == left_out {
                            &mut detection
                        } else {
                            &mut excited
                        }
                        .push(line);
                    }
                }
                excited
            }
            Self::Band { first, last } => {
                for (index, line) in [*first, *last].into_iter().enumerate() {
                    if line == 0 || line > highest || first > last {
                        return Err(PlantError::Line { index, line, highest });
                    }
                }
                (*first..=*last).collect()
            }
            Self::List(lines) => {
                for (index, &line) in lines.iter().enumerate() {
                    if line == 0 || line > highest || (index > 0 && lines[index - 1] >= line) {
                        return Err(PlantError::Line { index, line, highest });
                    }
                }
                lines.clone()
            }
        };
        if excited.is_empty() {
            return Err(PlantError::NoLines { period });
        }
        Ok(Selection { excited, detection })
    }
}
