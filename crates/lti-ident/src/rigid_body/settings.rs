//! Settings of the inverse-dynamics fit.

use crate::LtiIdentError;

/// How the linear equations are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Estimator {
    /// Instruments from the references if there are any and they say as much as the measured motion, otherwise from the
    /// inputs. With a cut-off of the user or dry friction estimated beside, least squares takes the place of the latter.
    #[default]
    Automatic,
    /// Least squares. Forces that disturb a closed loop make the inertia too small, since the motion answers them.
    LeastSquares,
    /// Instruments from the reference of the same index as the axis, which no noise has reached.
    ReferenceInstruments,
    /// Instruments from the input: the motion that the force makes by the estimate itself, at the lines of the spectrum
    /// at which the force stands out. In open loop no noise has reached them; in a loop that feeds noise back the bias
    /// is of the second order at such lines.
    InputInstruments,
}

/// How to fit. What takes them checks every field against this table.
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
    /// give an inertia that no mass has. Lines of the spectrum show it by its harmonics: where it is there beyond doubt,
    /// the inertia is that beside it, and the viscous friction takes its place.
    pub dry_friction: bool,
}

impl RigidBodySettings {
    /// Checks every field. That a cut-off is below Nyquist is checked where the clock is known.
    ///
    /// # Errors
    /// [`LtiIdentError::Setting`] with the field and what is allowed.
    pub fn check(&self) -> Result<(), LtiIdentError> {
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
        Ok(())
    }
}
