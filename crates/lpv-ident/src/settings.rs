//! What is fitted and how it is weighted.

use crate::IdentError;
use std::ops::Range;

/// A rigid-body term `c phi_R(q)` in one channel, `phi_R(z) = (z + 1) / (z - 1)^2`, equation (12); `c` is shared by all
/// positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RigidTerm {
    /// Output, from 0.
    pub output: usize,
    /// Input, from 0.
    pub input: usize,
}

impl RigidTerm {
    /// A term in each of the first `channels` diagonal channels, as in (13).
    pub fn diagonal(channels: usize) -> Vec<Self> {
        (0..channels).map(|i| Self { output: i, input: i }).collect()
    }
}

/// How a line is weighted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weighting {
    /// By the covariance of the FRF: maximum likelihood.
    #[default]
    Covariance,
    /// By `1 / ||F||_F` of the line: the relative error.
    Relative,
    /// All lines and channels alike.
    Uniform,
}

/// Settings of the regression; [`RegressionSettings::check`] makes them usable, which checks them.
///
/// | setting | default | meaning | range |
/// |---|---|---|---|
/// | `rigid_body` | none | channels with a term `c phi_R` | existing channels, no doubles |
/// | `weighting` | covariance | weight of a line | |
/// | `model_error` | 0 | what the basis cannot represent, relative to the FRF; added to the covariance | 0 or more |
/// | `band_hz` | all lines | lines that are fitted | lower < upper, both finite |
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RegressionSettings {
    /// Channels with a term `c phi_R`.
    pub rigid_body: Vec<RigidTerm>,
    /// Weight of a line.
    pub weighting: Weighting,
    /// Relative size of what a truncated basis cannot represent. With covariance weights, each row of the FRF gets the
    /// additional variance `(model_error * its size)^2`: lines with a very good signal to noise ratio then no longer buy
    /// their fit with large errors elsewhere.
    pub model_error: f64,
    /// Lines that are fitted, lowest and highest frequency.
    pub band_hz: Option<(f64, f64)>,
}

impl RegressionSettings {
    /// The lines of the band, of frequencies that rise.
    pub(crate) fn kept(&self, frequencies_hz: &[f64]) -> Range<usize> {
        let (lower, upper) = self.band_hz.unwrap_or((0.0, f64::INFINITY));
        let first = frequencies_hz.partition_point(|f| *f < lower);
        first..frequencies_hz.partition_point(|f| *f <= upper)
    }

    /// The settings that the regression accepts.
    ///
    /// # Errors
    /// [`IdentError::Setting`].
    pub fn check(&self) -> Result<(), IdentError> {
        if let Some((lower, upper)) = self.band_hz
            && !(lower.is_finite() && upper.is_finite() && lower < upper)
        {
            let problem = "the band must be finite with its lower end below its upper end";
            return Err(IdentError::Setting {
                name: "band_hz",
                value: lower,
                problem,
            });
        }
        if !(self.model_error.is_finite() && self.model_error >= 0.0) {
            let problem = "give a finite number, not negative";
            return Err(IdentError::Setting {
                name: "model_error",
                value: self.model_error,
                problem,
            });
        }
        for (i, term) in self.rigid_body.iter().enumerate() {
            if self.rigid_body[..i].contains(term) {
                let problem = "this rigid-body term is listed twice";
                return Err(IdentError::Setting {
                    name: "rigid_body",
                    value: i as f64,
                    problem,
                });
            }
        }
        Ok(())
    }
}
