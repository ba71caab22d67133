//! Settings of the identification, with defaults that need no tuning.

use crate::PipelineError;
use crate::settings_file::{place_of, read_settings};
use lpv_ident::Interpolation;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What `identify` does; every value that is left out is chosen from the data, and the choice is explained.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `structure` | `lpv` with several positions, else `lti` | what kind of model |
/// | `skip-periods` | from the decay between periods | periods dropped as transient |
/// | `order` | minimum description length | order of the common denominator, integrators included; states of a time-domain fit |
/// | `integrators` | slope at the lowest lines, and friction to ground there | poles held at z = 1 |
/// | `rigid-body` | what the lowest lines show | whether the axes are decoupled with constant gains, or the gain is full and depends on p |
/// | `functions` | truncation a tenth of the FRF noise | number of basis functions n_g |
/// | `fuzziness` | 35 | m of Fuzzy-Kolmogorov c-Max |
/// | `polish` | `minimax` | what follows FKcM |
/// | `weighting` | `covariance` | weights of the regression |
/// | `model-error` | n-width cost of the basis | relative error of the truncated basis, added to the covariance |
/// | `lfr` | `small`, and `exact` where it misses the noise | which LFR the model file holds |
/// | `interpolation` | leave-one-out, among those with an exact LFR | coefficient functions |
/// | `focus` | `simulation`; `prediction` with integrators, in closed loop and for unstable plants | what a fit in the time domain minimises |
/// | `direct` | `zero` in closed loop, else `estimated` | the direct term of a fit in the time domain |
/// | `hold-out` | 0 | last part of each transient estimation record that is not fitted but judged |
/// | `seed` | 0 | of every random choice |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct IdentifyConfig {
    /// What kind of model.
    pub structure: Option<Structure>,
    /// Periods dropped as transient.
    pub skip_periods: Option<usize>,
    /// Order of the common denominator, fixed integrators included; number of states of a fit in the time domain.
    pub order: Option<usize>,
    /// Poles held at z = 1.
    pub integrators: Option<usize>,
    /// The gain of the rigid body, where there are several positions and as many inputs as outputs.
    pub rigid_body: Option<RigidBody>,
    /// Number of basis functions.
    pub functions: Option<usize>,
    /// Fuzziness of FKcM.
    pub fuzziness: f64,
    /// What follows FKcM.
    pub polish: Polish,
    /// Weights of the regression.
    pub weighting: Weighting,
    /// What the truncated basis cannot represent, relative to the FRF.
    pub model_error: Option<f64>,
    /// Which LFR the model file holds.
    pub lfr: LfrKind,
    /// The coefficient functions.
    pub interpolation: Option<InterpolationKind>,
    /// What a fit in the time domain minimises.
    pub focus: Option<FitFocus>,
    /// The direct term of a fit in the time domain.
    pub direct: Option<Direct>,
    /// Last part of each transient estimation record that is held out of the fit and judged, 0 to below 1.
    pub hold_out: f64,
    /// Seed of every random choice.
    pub seed: u64,
}

/// What kind of model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Structure {
    /// LPV: orthonormal basis, coefficient functions of the position, LFR.
    Lpv,
    /// Time-invariant.
    Lti,
    /// Servo axes: mass or inertia, viscous friction and offset of each.
    RigidBody,
    /// Carriage and beam from first principles: masses, lever arm, stiffnesses and dampings, with the bundle's `[geometry]`.
    XyTable,
}

/// What the gain of the rigid body is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RigidBody {
    /// Two integrators on each axis, with a gain that no position changes and that moves no other axis: as in the paper.
    Decoupled,
    /// A gain in every channel, which may depend on p.
    Coupled,
}

/// What a fit in the time domain minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitFocus {
    /// The error of the simulated output.
    Simulation,
    /// The error of the one-step prediction.
    Prediction,
}

/// The direct term of a fit in the time domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direct {
    /// The output does not feel the input of the same sample: a sampled machine.
    Zero,
    /// It may, as with logged signals that are not sampled at once.
    Estimated,
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

/// Which LFR the model file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LfrKind {
    /// Few states and deltas, in continuous time, refined on the responses and on records along a moving position; where
    /// it does not reach their noise, the exact one.
    Small,
    /// The exact realisation of the series expansion.
    Exact,
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
            structure: None,
            skip_periods: None,
            order: None,
            integrators: None,
            rigid_body: None,
            functions: None,
            fuzziness: 35.0,
            polish: Polish::Minimax,
            weighting: Weighting::Covariance,
            model_error: None,
            lfr: LfrKind::Small,
            interpolation: None,
            focus: None,
            direct: None,
            hold_out: 0.0,
            seed: 0,
        }
    }
}

impl IdentifyConfig {
    /// Reads a TOML file; unknown keys are refused with their place and the nearest known one.
    ///
    /// # Errors
    /// [`PipelineError::Config`].
    pub fn read(file: &Path) -> Result<Self, PipelineError> {
        let config: Self = read_settings(file)?;
        config.check().map_err(|e| match e {
            PipelineError::Setting { name, value, allowed } => PipelineError::Value {
                place: place_of(file, &[name]),
                key: name.to_owned(),
                value,
                problem: format!("it must be {allowed}"),
            },
            other => other,
        })?;
        Ok(config)
    }

    /// Refuses what no data can make sense of.
    ///
    /// # Errors
    /// [`PipelineError::Setting`] names the setting, its value and what is allowed.
    pub fn check(&self) -> Result<(), PipelineError> {
        let count = |n: Option<usize>| n.map_or(1.0, |n| n as f64);
        for (name, value, low, high, allowed) in [
            ("hold-out", self.hold_out, 0.0, 0.95, "0 to 0.95"),
            (
                "fuzziness",
                self.fuzziness,
                1.0 + 1e-9,
                1e6,
                "above 1, at most 1e6",
            ),
            (
                "model-error",
                self.model_error.unwrap_or(0.0),
                0.0,
                1e3,
                "0 to 1000",
            ),
            ("functions", count(self.functions), 1.0, 1000.0, "1 to 1000"),
            ("order", count(self.order), 1.0, 200.0, "1 to 200"),
            (
                "integrators",
                self.integrators.unwrap_or(0) as f64,
                0.0,
                8.0,
                "0 to 8",
            ),
        ] {
            // NaN is in no range.
            if !(low..=high).contains(&value) {
                return Err(PipelineError::Setting { name, value, allowed });
            }
        }
        Ok(())
    }

    /// A file with every setting, what it means, and its default; where the data decides, the line is a comment with an
    /// example.
    pub fn template() -> &'static str {
        TEMPLATE
    }
}

/// Kept by a test against the fields and the defaults.
const TEMPLATE: &str = r#"# Settings of `lpv identify`. A line that is commented out is decided from the data, and the program says why.

# What kind of model: "lpv" (several positions), "lti", or "rigid-body" (mass or inertia, viscous friction, offset of each axis).
# structure = "lpv"

# Periods dropped at the start of each periodic record, until the transient is gone.
# skip-periods = 2

# Order of the common denominator, integrators included; for records without periods the number of states.
# order = 8

# Poles held at z = 1: 2 for a position that follows a force, 1 with friction to ground or for a speed, 0 for a spring to ground.
# integrators = 2

# Gain of the rigid body at several positions: "decoupled" (two integrators an axis, no axis moves another, the same at every position)
# or "coupled" (full, and a function of the position).
# rigid-body = "decoupled"

# Number of orthonormal basis functions n_g.
# functions = 16

# Fuzziness m of Fuzzy-Kolmogorov c-Max, above 1.
fuzziness = 35.0

# What follows it: "minimax" (descent of the n-width cost, also between the positions) or "none".
polish = "minimax"

# Weights of the regression: "covariance" (of the frequency response) or "relative" (its size).
weighting = "covariance"

# Relative error of the truncated basis, added to the covariance; 0 gives the pure covariance.
# model-error = 0.1

# Which LFR: "small" (few states and deltas, where the responses support it) or "exact" (of the series expansion).
lfr = "small"

# Coefficient functions: kind = "polynomial" or "chebyshev" with order, "spline", "linear", or "gaussian-process" with length-scale.
# interpolation = { kind = "polynomial", order = 4 }

# What a fit to records without periods minimises: "simulation" or "prediction" (needed for integrators and unstable plants).
# focus = "simulation"

# The direct term of such a fit: "zero" (needed to simulate in closed loop) or "estimated".
# direct = "zero"

# Last part of each such record, and of each record along a moving position, that is not fitted but judged.
hold-out = 0.0

# Seed of every random choice.
seed = 0
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_has_every_setting_and_the_defaults() {
        let plain: IdentifyConfig = toml::from_str(TEMPLATE).unwrap();
        assert_eq!(plain, IdentifyConfig::default());
        // With every suggestion taken, each field is set and none is unknown.
        let full = TEMPLATE
            .lines()
            .map(|l| {
                l.strip_prefix("# ")
                    .filter(|r| r.contains(" = ") && !r.contains(": "))
                    .unwrap_or(l)
            })
            .collect::<Vec<_>>()
            .join("\n");
        let full: IdentifyConfig = toml::from_str(&full).unwrap();
        let json = serde_json::to_value(&full).unwrap();
        for (key, value) in json.as_object().unwrap() {
            assert!(!value.is_null(), "{key} is not in the template");
        }
    }
}
