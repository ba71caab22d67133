//! Integrators of one position, by the states that stand out of the noise.

use super::search::{LARGER_ORDERS, Search, description_length, kind, parsimonious, stable, thinned};
use pole_fit::{Scan, scan_counted};

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
        let described = |(count, scan): (usize, Option<Scan>)| {
            let scan = scan?;
            let fit = &scan.entries[parsimonious(&scan, 1.0, 0.0)].fit;
            let length = description_length(fit);
            stable(std::slice::from_ref(fit)).then_some((length, count, scan))
        };
        let found = COUNTS
            .into_iter()
            .zip(scans.unwrap_or_default())
            .filter_map(described);
        let Some((_, count, scan)) = found.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return false;
        };
        self.integrate(count);
        self.counted = Some(scan);
        true
    }
}
