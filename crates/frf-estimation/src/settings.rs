//! Settings of the periodic estimator.

use crate::FrfError;

/// How many periods to drop from the start of each experiment, because the transient still shows in them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SkipRule {
    /// Judge by the decay between periods; needs whole records ([`crate::estimate_records`] tells the rule).
    Auto,
    /// Drop this many.
    Fixed(usize),
}

/// Which frequency lines to estimate; line `k` is `k` cycles a period. Zero and the Nyquist line are never among them:
/// their spectra are real, so the circular covariance does not hold there.
#[derive(Debug, Clone, PartialEq)]
pub enum LineSelection {
    /// Every line; each must be excited.
    All,
    /// These lines, strictly increasing.
    List(Vec<usize>),
    /// Lines that carry excitation: the instrument (reference or input) reaches `relative_threshold` times its
    /// strongest value within 32 lines on either side and a millionth of its strongest value anywhere, and the
    /// averaged input stands 10 dB above its own noise.
    Excited {
        /// Amplitude ratio, above 0 and below 1.
        relative_threshold: f64,
    },
}

/// The signal that is correlated with inputs and outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instrument {
    /// References where they number the inputs and are not constant zero, else inputs.
    Auto,
    /// References: equation (15) of the paper, unbiased in closed loop.
    References,
    /// Inputs: equation (14) of the paper, least squares where there are more experiments than inputs.
    Inputs,
}

/// Where the covariance of the estimate comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CovarianceSource {
    /// Total variance over realisations where there are at least `2 n_u` experiments, else the noise.
    Auto,
    /// The noise alone, as it varies from period to period.
    Noise,
}

/// Settings of the periodic estimator. What takes them checks them.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `skip` | `Auto` | periods dropped at the start | any; at least 2 must remain |
/// | `lines` | `Excited { 0.01 }` | lines to estimate | see [`LineSelection`] |
/// | `instrument` | `Auto` | (15) or (14) | see [`Instrument`] |
/// | `covariance` | `Auto` | noise or total variance | see [`CovarianceSource`] |
/// | `max_condition` | `1e8` | largest condition number of `U R^H` | above 1, finite |
/// | `smoothing_half_width` | 10 | excited lines on either side over which the nonlinear variance is averaged | 0 to 10000 |
///
/// ```
/// use frf_estimation::{PeriodicSettings, SkipRule};
/// let settings = PeriodicSettings { skip: SkipRule::Fixed(10), ..PeriodicSettings::default() };
/// assert_eq!(settings.max_condition, 1e8);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicSettings {
    /// Periods dropped at the start.
    pub skip: SkipRule,
    /// Lines to estimate.
    pub lines: LineSelection,
    /// Signal that is correlated with inputs and outputs.
    pub instrument: Instrument,
    /// Where the covariance comes from.
    pub covariance: CovarianceSource,
    /// Largest condition number of `U R^H`, rows and columns scaled, that is accepted.
    pub max_condition: f64,
    /// Excited lines on either side over which the nonlinear variance is averaged.
    pub smoothing_half_width: usize,
}

impl Default for PeriodicSettings {
    fn default() -> Self {
        Self {
            skip: SkipRule::Auto,
            lines: LineSelection::Excited {
                relative_threshold: 1e-2,
            },
            instrument: Instrument::Auto,
            covariance: CovarianceSource::Auto,
            max_condition: 1e8,
            smoothing_half_width: 10,
        }
    }
}

impl PeriodicSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`FrfError::Setting`] names the setting; [`FrfError::Line`] names the entry of the list.
    pub fn check(&self) -> Result<(), FrfError> {
        let setting = |setting, value, expected| FrfError::Setting {
            setting,
            value,
            expected,
        };
        if !(self.max_condition.is_finite() && self.max_condition > 1.0) {
            let expected = "a finite number above 1";
            return Err(setting("max_condition", self.max_condition, expected));
        }
        if self.smoothing_half_width > 10_000 {
            let value = self.smoothing_half_width as f64;
            return Err(setting("smoothing_half_width", value, "0 to 10000"));
        }
        match &self.lines {
            LineSelection::Excited {
                relative_threshold: t,
            } if !(*t > 0.0 && *t < 1.0) => {
                return Err(setting("relative_threshold", *t, "above 0 and below 1"));
            }
            LineSelection::List(lines) => {
                if lines.is_empty() {
                    return Err(setting("lines", 0.0, "a list of at least one line"));
                }
                check_lines(lines, usize::MAX)?;
            }
            _ => {}
        }
        Ok(())
    }
}

/// Lines must increase strictly within `1..=last`.
pub(crate) fn check_lines(lines: &[usize], last: usize) -> Result<(), FrfError> {
    let wrong = |i: usize| lines[i] == 0 || lines[i] > last || (i > 0 && lines[i] <= lines[i - 1]);
    match (0..lines.len()).find(|&i| wrong(i)) {
        None => Ok(()),
        Some(entry) => Err(FrfError::Line {
            entry,
            line: lines[entry],
            last,
        }),
    }
}
