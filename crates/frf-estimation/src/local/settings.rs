//! Settings of the local methods.

use crate::FrfError;

/// Lines on either side of the one that is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HalfWidth {
    /// The narrowest window that leaves `2 n + 4` degrees of freedom for the covariance of `n` outputs.
    Auto,
    /// This many.
    Lines(usize),
}

/// Which lines to estimate; line `k` is `k` cycles a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LocalLines {
    /// Every line but zero and Nyquist.
    All,
    /// These, strictly increasing.
    List(Vec<usize>),
}

/// The signal from which the outputs are explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Regressor {
    /// The inputs. In closed loop the estimate is biased by the noise that the loop feeds back.
    Inputs,
    /// The references, as many as inputs: outputs and inputs are both explained from them, and `F = G_y G_u^-1`.
    References,
}

/// Settings of [`crate::local_polynomial`] and [`crate::local_rational`]. What takes them checks them.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `degree` | 2 | degree of response (or numerator) and transient in the window | 0 to 8 |
/// | `denominator_degree` | 2 | degree of the common denominator, rational method only | 0 to 8 |
/// | `iterations` | 3 | repetitions with the last denominator as weight, rational method only | 0 to 100 |
/// | `half_width` | `Auto` | lines on either side | 1 to 10000; at least one degree of freedom must remain |
/// | `lines` | `All` | lines to estimate | see [`LocalLines`] |
/// | `regressor` | `Inputs` | signal that explains the outputs | see [`Regressor`] |
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LocalSettings {
    /// Degree of response (or numerator) and transient.
    pub degree: usize,
    /// Degree of the common denominator.
    pub denominator_degree: usize,
    /// Repetitions with the last denominator as weight.
    pub iterations: usize,
    /// Lines on either side.
    pub half_width: HalfWidth,
    /// Lines to estimate.
    pub lines: LocalLines,
    /// Signal that explains the outputs.
    pub regressor: Regressor,
}

impl Default for LocalSettings {
    fn default() -> Self {
        Self {
            degree: 2,
            denominator_degree: 2,
            iterations: 3,
            half_width: HalfWidth::Auto,
            lines: LocalLines::All,
            regressor: Regressor::Inputs,
        }
    }
}

impl LocalSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`FrfError::Setting`] names the setting; [`FrfError::Line`] names the entry of the list.
    pub fn check(&self) -> Result<(), FrfError> {
        let half_width = match self.half_width {
            HalfWidth::Auto => 1,
            HalfWidth::Lines(n) => n,
        };
        let counts = [
            ("degree", self.degree, 0, 8, "0 to 8"),
            ("denominator_degree", self.denominator_degree, 0, 8, "0 to 8"),
            ("iterations", self.iterations, 0, 100, "0 to 100"),
            ("half_width", half_width, 1, 10_000, "1 to 10000"),
        ];
        for (setting, count, low, high, expected) in counts {
            if !(low..=high).contains(&count) {
                let value = count as f64;
                return Err(FrfError::Setting {
                    setting,
                    value,
                    expected,
                });
            }
        }
        if let LocalLines::List(list) = &self.lines {
            if list.is_empty() {
                return Err(FrfError::Setting {
                    setting: "lines",
                    value: 0.0,
                    expected: "a list of at least one line",
                });
            }
            crate::settings::check_lines(list, usize::MAX)?;
        }
        Ok(())
    }
}
