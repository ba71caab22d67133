//! Friction to ground at several positions: one integral an axis, and a slow pole for the other.

use super::search::{Fits, Search, missed};
use crate::PipelineError;
use crate::rigid::RigidEvidence;
use crate::small::MOST_DAMPING;
use lpv_core::{Clock, Discrete, FrfEstimate};
use pole_fit::PoleFit;

/// Fits with slow poles.
pub(super) struct WithFriction {
    pub(super) fits: Fits,
    pub(super) rigid: RigidEvidence,
    pub(super) reasons: Vec<String>,
}

/// What the lowest lines show of the rigid body, below the modes that were found.
pub(super) fn evidence(
    estimates: &[FrfEstimate],
    clock: Discrete,
    fits: &[PoleFit],
) -> Option<RigidEvidence> {
    let modes = fits.iter().flat_map(PoleFit::modes);
    // An unstable pole is no mode.
    let light = modes.filter(|m| (0.0..=MOST_DAMPING).contains(&m.damping));
    let first = light.map(|m| m.frequency_hz).fold(clock.nyquist_hz(), f64::min);
    RigidEvidence::of(estimates, clock, first)
}

impl Search<'_> {
    /// One integrator, or two where an axis without friction keeps both, with slow poles beside them: where the lowest lines show friction
    /// and it describes the responses shorter, or reaches the noise with stable poles and `found` does not. What is taken stays in the
    /// settings.
    pub(super) fn with_friction(&mut self, found: &[PoleFit]) -> Result<Option<WithFriction>, PipelineError> {
        let own = self.integrators;
        self.slow_poles = true;
        let mut best: Option<(usize, WithFriction)> = None;
        for count in [1, 2] {
            self.integrate(count);
            let mut reasons = Vec::new();
            let fits = self.run(&mut reasons)?;
            let before = best.as_ref().map_or(found, |(_, b)| &b.fits.0);
            let shorter = self.length_of_all(&fits.0) < self.length_of_all(before);
            let better = shorter || missed(before) && !missed(&fits.0);
            let seen = evidence(self.estimates, self.clock, &fits.0).filter(RigidEvidence::has_friction);
            if let Some(rigid) = seen.filter(|_| better) {
                let found = WithFriction { fits, rigid, reasons };
                best = Some((count, found));
            }
            if !missed(best.as_ref().map_or(found, |(_, b)| &b.fits.0)) {
                break;
            }
        }
        self.slow_poles = best.is_some();
        self.integrate(best.as_ref().map_or(own, |(count, _)| *count));
        Ok(best.map(|(_, found)| found))
    }
}
