//! Friction to ground at several positions: one integral an axis, and a slow pole for the other.

use super::search::{Fits, MORE_THAN_NOISE, Search, description_length, missed, over_noise, stable};
use crate::PipelineError;
use crate::rigid::RigidEvidence;
use crate::small::MOST_DAMPING;
use lpv_core::{Clock, Discrete, FrfEstimate};
use pole_fit::{NumeratorDegree, PoleFit};

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

/// Description length of the fits at all positions.
fn length(fits: &[PoleFit]) -> f64 {
    fits.iter().map(description_length).sum()
}

impl Search<'_> {
    /// One integrator and slow poles, where the lowest lines do not tell the rigid body, or tell it wrong: if that reaches the noise with
    /// stable poles and describes the responses more shortly than `found`. What is taken stays in the settings.
    pub(super) fn one_integrator(&mut self, found: &[PoleFit]) -> Option<(Fits, Vec<String>)> {
        let own = (self.integrators, self.slow_poles, self.settings.numerator);
        if own.0 == 1 {
            return None;
        }
        self.integrate(1);
        self.slow_poles = true;
        self.settings.numerator = NumeratorDegree::StrictlyProper;
        let mut reasons = Vec::new();
        let fits = self.run(&mut reasons).ok();
        let better = fits.filter(|f| !missed(&f.0) && length(&f.0) < length(found));
        if better.is_none() {
            self.integrate(own.0);
            (self.slow_poles, self.settings.numerator) = (own.1, own.2);
        }
        better.map(|fits| (fits, reasons))
    }

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
            let at_noise = over_noise(&fits.0) <= MORE_THAN_NOISE && stable(&fits.0);
            let better = length(&fits.0) < length(before) || missed(before) && at_noise;
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
