//! The number of integrators where the slope of the lowest lines does not tell it.

use super::DISTORTED;
use super::search::{
    Fits, LARGER_ORDERS, Search, Structure, at_noise, doubtful, kind, missed, over_noise, stable, thinned,
};
use pole_fit::{NumeratorDegree, PoleFit, Scan, scan_counted};

impl Search<'_> {
    /// The number of integrators with which the states that stand out of the noise describe the response of one position most shortly, and
    /// leave noise alone with stable poles: what is found stays in the settings. The slope at the lowest lines need not show it: friction
    /// turns an integrator into a slow pole below them, a spring hides both, and sensors away from the actuators have a slope of their own.
    pub(super) fn count_states(&mut self) -> bool {
        let [one] = self.estimates else {
            return false;
        };
        if self.order.is_some() {
            return false;
        }
        const COUNTS: [usize; 3] = [2, 1, 0];
        let most = LARGER_ORDERS.iter().copied().max().unwrap_or(0);
        let scans = scan_counted(&thinned(one), self.clock, &self.settings, &COUNTS.map(kind), most);
        let scans = scans.unwrap_or_default();
        for (count, scan) in COUNTS.into_iter().zip(&scans) {
            scan.iter().for_each(|scan| self.keep(count, scan));
        }
        let described = |(count, scan): (usize, Option<Scan>)| {
            let scan = scan?;
            let fit = &scan.entries[self.parsimonious(&scan)].fit;
            let length = self.length(fit);
            stable(std::slice::from_ref(fit)).then_some((length, count, scan))
        };
        let found = COUNTS.into_iter().zip(scans).filter_map(described);
        let Some((_, count, scan)) = found.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return false;
        };
        self.integrate(count);
        self.counted = Some(scan);
        true
    }

    /// Another number of integrators, of these, that leaves noise alone and describes the response more shortly, where the compliance of
    /// the modes hides the slope of the rigid body at the lowest lines; with a direct term where only that keeps the poles stable. What
    /// is found stays in the settings.
    pub(super) fn other_integrators(
        &mut self,
        slope: f64,
        found: &[PoleFit],
        counts: &[usize],
        reasons: &mut Vec<String>,
    ) -> Option<Fits> {
        let (own, slow) = (self.structure(), self.slow_poles);
        let missed = missed(found);
        let one = self.estimates.len() == 1;
        // A slope of few lines at one position is no evidence: a spring or friction below them has the same.
        if !one && !doubtful(slope) && !missed {
            return None;
        }
        // Noise that is not reached, or reached with poles outside the unit circle, may want a direct term.
        let numerators: &[NumeratorDegree] = if missed && one {
            &[NumeratorDegree::StrictlyProper, NumeratorDegree::Proper]
        } else {
            &[NumeratorDegree::StrictlyProper]
        };
        let others = counts
            .iter()
            .flat_map(|count| numerators.iter().map(move |n| (*count, *n)))
            .filter(|other| *other != own);
        // Other integrators do not bring many modes: those of a machine with many stand out of the noise.
        self.small = one && over_noise(found) > DISTORTED;
        // Noise alone first, then stable poles, and of these what is described most shortly.
        let mut best: Option<(Structure, Fits, Vec<String>)> = None;
        let mut least = match (missed, one && stable(found)) {
            (false, _) => (0, self.length_of_all(found)),
            (true, true) => (1, self.length_of_all(found)),
            (true, false) => (2, f64::INFINITY),
        };
        for other in others {
            self.take(other);
            let mut why = Vec::new();
            let Ok(fits) = self.run(&mut why) else {
                continue;
            };
            let class = match (at_noise(&fits.0), stable(&fits.0)) {
                (true, true) => 0,
                (true, false) if !missed => 0,
                // What leaves more is distorted.
                (false, true) if one && over_noise(&fits.0) <= DISTORTED => 1,
                _ => continue,
            };
            let length = self.length_of_all(&fits.0);
            if class < least.0 || class == least.0 && length < least.1 {
                least = (class, length);
                best = Some((other, fits, why));
            }
        }
        self.small = false;
        let Some((structure, fits, why)) = best else {
            self.take(own);
            self.slow_poles = slow;
            return None;
        };
        self.take(structure);
        if structure.0 != own.0 {
            reasons.push(format!(
                "{} instead: they describe the response more shortly",
                lpv_core::counted(structure.0, "integrator")
            ));
        }
        if structure.1 == NumeratorDegree::Proper {
            reasons
                .push("with a direct term: without it the noise is not reached with stable poles".to_owned());
        }
        reasons.extend(why);
        Some(fits)
    }
}
