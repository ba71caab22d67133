//! The estimate of an axis, from the lines of the spectrum or from filtered derivatives.

use super::lines::ALIKE;
use super::regression::Solution;
use super::spectral::Estimate;
use super::{AxisAccount, Estimator, Filter, RigidBodySettings, SPEED_DOUBTED};
use crate::LtiIdentError;
use lpv_core::{Clock, Discrete};

/// What an axis is taken to be.
pub(super) struct Found {
    /// `J`, `F_v`, `o`.
    pub(super) theta: [f64; 3],
    pub(super) deviations: [f64; 3],
    pub(super) relative_error_percent: f64,
    estimator: Estimator,
    condition_number: f64,
    /// Of the filtered derivatives.
    effective_rows: f64,
    /// None where filtered derivatives gave the estimate.
    lines: Option<Estimate>,
}

impl Found {
    /// Lines go first. References in filtered derivatives stay where the lines say the same and not much more.
    ///
    /// # Errors
    /// Those of the filtered derivatives where there are no lines; [`LtiIdentError::Singular`] where only lines were
    /// asked for.
    pub(super) fn new(
        lines: Option<Estimate>,
        plain: Result<(Estimator, Solution), LtiIdentError>,
        settings: &RigidBodySettings,
    ) -> Result<Self, LtiIdentError> {
        let Some(lines) = lines else {
            let only_lines = settings.estimator == Estimator::InputInstruments;
            let what = "inverse dynamics";
            let (estimator, plain) = plain?;
            return match only_lines {
                true => Err(LtiIdentError::Singular { what }),
                false => Ok(Self::of(estimator, &plain)),
            };
        };
        if let Ok((Estimator::ReferenceInstruments, plain)) = &plain
            && (lines.theta[0] <= 0.0 || says_as_much(plain, &lines))
        {
            let mut found = Self::of(Estimator::ReferenceInstruments, plain);
            // The parts of the data agree on an error that repeats with the motion: steps of an encoder, dry friction.
            for i in 0..3 {
                found.deviations[i] = found.deviations[i].max(lines.deviations[i]);
            }
            return Ok(found);
        }
        Ok(Self {
            theta: lines.theta,
            deviations: lines.deviations,
            relative_error_percent: lines.relative_error_percent,
            estimator: lines.estimator,
            condition_number: lines.condition_number,
            effective_rows: 0.0,
            lines: Some(lines),
        })
    }

    fn of(estimator: Estimator, plain: &Solution) -> Self {
        Self {
            theta: [plain.theta[0], plain.theta[1], plain.theta[2]],
            deviations: [plain.deviations[0], plain.deviations[1], plain.deviations[2]],
            relative_error_percent: plain.relative_error_percent,
            estimator,
            condition_number: plain.condition_number,
            effective_rows: plain.effective_rows,
            lines: None,
        }
    }

    /// Whether least squares took noise for motion: no line stands out, and the equations go far above the force.
    pub(super) fn is_doubtful(
        &self,
        regression_cutoff_hz: f64,
        force_band_hz: f64,
        settings: &RigidBodySettings,
    ) -> bool {
        const FAR_ABOVE: f64 = 4.0;
        asked(settings)
            && self.lines.is_none()
            && self.estimator == Estimator::LeastSquares
            && self.theta[0] > 0.0
            && regression_cutoff_hz > FAR_ABOVE * force_band_hz
    }

    /// What it says about itself; `filter` and `rows` are those of the filtered derivatives.
    pub(super) fn account(&self, filter: Filter, rows: usize, force_band_hz: f64) -> AxisAccount {
        let of_derivatives = (filter, rows, self.effective_rows);
        let (filter, rows, effective_rows) = self.lines.as_ref().map_or(of_derivatives, |lines| {
            let filter = Filter {
                position_cutoff_hz: lines.smooth_hz,
                regression_cutoff_hz: lines.highest_hz,
                decimation: 1,
            };
            let rows = 2 * lines.lines;
            (filter, rows, rows as f64 / ALIKE)
        });
        AxisAccount {
            position_cutoff_hz: filter.position_cutoff_hz,
            regression_cutoff_hz: filter.regression_cutoff_hz,
            decimation: filter.decimation,
            rows,
            condition_number: self.condition_number,
            relative_force_error_percent: self.relative_error_percent,
            estimator: self.estimator,
            force_band_hz,
            effective_rows,
        }
    }
}

/// Whether inertia and viscous friction are those of the lines within twice the deviations of both, and not much less
/// certain.
fn says_as_much(plain: &Solution, lines: &Estimate) -> bool {
    const LARGEST_LOSS: f64 = 5.0;
    plain.relative_error_percent <= SPEED_DOUBTED
        && plain.deviations[0] <= LARGEST_LOSS * lines.deviations[0]
        && (0..2).all(|i| {
            let apart = (lines.theta[i] - plain.theta[i]).abs();
            apart <= 2.0 * lines.deviations[i].hypot(plain.deviations[i])
        })
}

/// Whether the settings ask for lines: least squares, references and cut-offs that the user gave are those of filtered
/// derivatives.
pub(super) fn asked(settings: &RigidBodySettings) -> bool {
    let is_free = settings.position_cutoff_hz.is_none()
        && settings.regression_cutoff_hz.is_none()
        && !settings.dry_friction;
    match settings.estimator {
        Estimator::InputInstruments => true,
        Estimator::Automatic => is_free,
        Estimator::LeastSquares | Estimator::ReferenceInstruments => false,
    }
}

/// The highest line that may be used.
pub(super) fn limit_hz(settings: &RigidBodySettings, clock: Discrete) -> f64 {
    let cutoffs = [settings.position_cutoff_hz, settings.regression_cutoff_hz];
    cutoffs.into_iter().flatten().fold(clock.nyquist_hz(), f64::min)
}
