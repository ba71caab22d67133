//! Settings of the identification, with defaults that need no tuning.

use crate::PipelineError;
use lpv_ident::Interpolation;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `identify` does; every value that is left out is chosen from the data, and the choice is explained.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `skip-periods` | from the decay between periods | periods dropped as transient |
/// | `order` | minimum description length | order of the common denominator, integrators included |
/// | `integrators` | slope at the lowest lines | poles held at z = 1 |
/// | `functions` | 16 | number of basis functions n_g |
/// | `fuzziness` | 35 | m of Fuzzy-Kolmogorov c-Max |
/// | `polish` | `minimax` | what follows FKcM |
/// | `weighting` | `covariance` | weights of the regression |
/// | `model-error` | n-width cost of the basis | relative error of the truncated basis, added to the covariance |
/// | `interpolation` | leave-one-out, among those with an exact LFR | coefficient functions |
/// | `seed` | 0 | of every random choice |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct IdentifyConfig {
    /// Periods dropped as transient.
    pub skip_periods: Option<usize>,
    /// Order of the common denominator, fixed integrators included.
    pub order: Option<usize>,
    /// Poles held at z = 1.
    pub integrators: Option<usize>,
    /// Number of basis functions.
    pub functions: usize,
    /// Fuzziness of FKcM.
    pub fuzziness: f64,
    /// What follows FKcM.
    pub polish: Polish,
    /// Weights of the regression.
    pub weighting: Weighting,
    /// What the truncated basis cannot represent, relative to the FRF.
    pub model_error: Option<f64>,
    /// The coefficient functions.
    pub interpolation: Option<InterpolationKind>,
    /// Seed of every random choice.
    pub seed: u64,
}

/// What follows FKcM.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Polish {
    /// The poles as FKcM leaves them.
    None,
    /// Direct descent of the n-width cost over the poles interpolated between the positions.
    Minimax,
}

/// Weights of the regression.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// By the covariance of the FRF.
    Covariance,
    /// By the size of the FRF.
    Relative,
}

/// An interpolation that is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(
    rename_all = "kebab-case",
    rename_all_fields = "kebab-case",
    tag = "kind",
    deny_unknown_fields
)]
pub enum InterpolationKind {
    /// Least-squares polynomial.
    Polynomial {
        /// Highest power.
        order: usize,
    },
    /// Chebyshev interpolant of the spline.
    Chebyshev {
        /// Highest power.
        order: usize,
    },
    /// Cubic spline.
    Spline,
    /// Straight lines.
    Linear,
    /// Gaussian process.
    GaussianProcess {
        /// Correlation length in units of p.
        length_scale: f64,
    },
}

impl From<InterpolationKind> for Interpolation {
    fn from(kind: InterpolationKind) -> Self {
        match kind {
            InterpolationKind::Polynomial { order } => Self::Polynomial { order },
            InterpolationKind::Chebyshev { order } => Self::Chebyshev { order },
            InterpolationKind::Spline => Self::Spline,
            InterpolationKind::Linear => Self::Linear,
            InterpolationKind::GaussianProcess { length_scale } => Self::GaussianProcess { length_scale },
        }
    }
}

impl Default for IdentifyConfig {
    fn default() -> Self {
        Self {
            skip_periods: None,
            order: None,
            integrators: None,
            functions: 16,
            fuzziness: 35.0,
            polish: Polish::Minimax,
            weighting: Weighting::Covariance,
            model_error: None,
            interpolation: None,
            seed: 0,
        }
    }
}

impl IdentifyConfig {
    /// Reads a TOML file; unknown keys are refused with their place.
    ///
    /// # Errors
    /// [`PipelineError::Config`].
    pub fn read(file: &Path) -> Result<Self, PipelineError> {
        let refuse = |message: String| PipelineError::Config {
            file: file.to_owned(),
            message,
        };
        let text = std::fs::read_to_string(file).map_err(|e| refuse(e.to_string()))?;
        toml::from_str(&text).map_err(|e| refuse(e.to_string()))
    }
}
