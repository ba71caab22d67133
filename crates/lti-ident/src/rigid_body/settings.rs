//! Settings of the inverse-dynamics fit: unchecked as written, checked once.

use crate::LtiIdentError;

/// How the linear equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Estimator {
    /// Instruments if there are references and they say as much as the measured motion, otherwise least squares.
    #[default]
    Automatic,
    /// Least squares. Forces that disturb a closed loop make the inertia too small, since the motion answers them.
    LeastSquares,
    /// Instruments from the reference of the same index as the axis, which no noise has reached.
    ReferenceInstruments,
}

/// How to fit. Fields are unchecked; [`RigidBodySettings::check`] gives what [`crate::rigid_body::identify`] accepts.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `position_cutoff_hz` | `None` | cut-off of the filter on the position; `None`: where the spectrum meets its noise | above 0, below Nyquist |
/// | `regression_cutoff_hz` | `None` | cut-off of the filter on the equations; `None`: from the spectrum too | above 0, below Nyquist |
/// | `estimator` | `Automatic` | how the equations are solved | |
/// | `dry_friction` | `false` | estimate a constant force against the motion beside, which the model does not keep | |
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigidBodySettings {
    /// Cut-off of the filter on the position, Hz.
    pub position_cutoff_hz: Option<f64>,
    /// Cut-off of the filter on the equations, Hz.
    pub regression_cutoff_hz: Option<f64>,
    /// How the equations are solved.
    pub estimator: Estimator,
    /// Whether a constant force against the motion is estimated beside. Where it is larger than the inertial force, equations without it
    /// give an inertia that no mass has.
    pub dry_friction: bool,
}

impl RigidBodySettings {
    /// The defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
    /// Sets the cut-off of the filter on the position.
    #[must_use]
    pub fn position_cutoff_hz(mut self, cutoff_hz: f64) -> Self {
        self.position_cutoff_hz = Some(cutoff_hz);
        self
    }
    /// Sets the cut-off of the filter on the equations.
    #[must_use]
    pub fn regression_cutoff_hz(mut self, cutoff_hz: f64) -> Self {
        self.regression_cutoff_hz = Some(cutoff_hz);
        self
    }
    /// Sets how the equations are solved.
    #[must_use]
    pub fn estimator(mut self, estimator: Estimator) -> Self {
        self.estimator = estimator;
        self
    }
    /// Sets whether a constant force against the motion is estimated beside.
    #[must_use]
    pub fn dry_friction(mut self, is_estimated: bool) -> Self {
        self.dry_friction = is_estimated;
        self
    }

    /// Checks every field. That a cut-off is below Nyquist is checked where the clock is known.
    ///
    /// # Errors
    /// [`LtiIdentError::Setting`] with the field and what is allowed.
    pub fn check(self) -> Result<CheckedRigidBodySettings, LtiIdentError> {
        let cutoffs = [
            ("position_cutoff_hz", self.position_cutoff_hz),
            ("regression_cutoff_hz", self.regression_cutoff_hz),
        ];
        for (name, cutoff) in cutoffs {
            if let Some(value) = cutoff.filter(|c| !(c.is_finite() && *c > 0.0)) {
                let allowed = "a finite number above zero";
                return Err(LtiIdentError::Setting { name, value, allowed });
            }
        }
        Ok(CheckedRigidBodySettings(self))
    }
}

/// Settings whose values are in range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedRigidBodySettings(RigidBodySettings);

impl CheckedRigidBodySettings {
    /// The values.
    #[must_use]
    pub fn get(&self) -> &RigidBodySettings {
        &self.0
    }
}
