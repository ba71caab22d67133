//! Few lines of one position: each number of integrators begins at the poles that another one has found.
//!
//! With few lines a scan from the data may miss the minimum of the machine's own structure, and the next best structure is then taken for
//! it. Integrators become slow poles of the lowest line, slow poles become integrators, and poles that the lines do not need are left out
//! one after the other, as long as the description becomes shorter.

use super::candidates::Candidate;
use super::search::{Search, Structure, alternates, at_noise, kind, stable, upper_half};
use lpv_core::num_complex::Complex;
use pole_fit::{NumeratorDegree, PoleFit, PoleFitSettings, fit_from};
use std::f64::consts::TAU;

type C64 = Complex<f64>;

/// Lines up to which the contest is held: with more the scans do not miss.
pub(super) const FEW_LINES: usize = 100;

/// The same of a response of continuous time: beside a direct term that is late by half a sample the scans find poles that are not there.
const FEW_HELD_LINES: usize = 1000;

/// Steps of the search without a pole, before the best one goes on.
const STEPS_OF_A_TRIAL: usize = 4;

/// Most poles of a candidate that starts others.
const MOST_POLES: usize = 16;

impl Search<'_> {
    /// The candidate that describes few lines most shortly, where that is another one than `taken`.
    pub(super) fn contest(&mut self, taken: &PoleFit) -> Option<PoleFit> {
        let [one] = self.estimates else { return None };
        let held = self.held().is_some();
        let most = if held { FEW_HELD_LINES } else { FEW_LINES };
        if one.frf().len() > most || self.order.is_some() {
            return None;
        }
        let own = self.structure();
        let lowest_hz = one.frf().frequencies_hz().iter().copied().find(|f| *f > 0.0)?;
        let slow = (-TAU * lowest_hz * self.clock.sample_time()).exp();
        for fit in self.leaders(taken) {
            for count in 0..=2 {
                for numerator in [NumeratorDegree::StrictlyProper, NumeratorDegree::Proper] {
                    if numerator != NumeratorDegree::Proper || own.1 == numerator || held {
                        for start in starts(&fit, count, slow) {
                            self.descend((count, numerator), start);
                        }
                    }
                }
            }
        }
        let best = self.shortest(taken)?;
        self.take(best.structure);
        Some(best.fit)
    }

    /// The best fit of each number of integrators, and the one that was taken.
    fn leaders(&self, taken: &PoleFit) -> Vec<PoleFit> {
        let mut leaders = vec![taken.clone()];
        for count in 0..=2 {
            let of_count = self.candidates.iter().map(|c| &c.fit);
            let of_count = of_count.filter(|f| f.fixed_integrators == count && self.told(f));
            let best = of_count.min_by(|a, b| self.length(a).total_cmp(&self.length(b)));
            leaders.extend(best.filter(|f| *f != taken).cloned());
        }
        leaders.retain(|f| f.poles.len() <= MOST_POLES);
        leaders
    }

    /// Fits from these poles, then without one or the other, as long as the description becomes shorter and no candidate is met.
    fn descend(&mut self, structure: Structure, start: Vec<C64>) {
        let mut next = self.fit_at(structure, &start, self.settings.max_iterations);
        let mut length = f64::INFINITY;
        while let Some(fit) = next.take() {
            let own = self.length(&fit);
            if own >= length || self.is_known(structure, &fit) {
                break;
            }
            length = own;
            let poles = upper_half(&fit);
            self.candidates.push(Candidate {
                structure,
                fit,
                is_descended: true,
            });
            let without = |i: usize| {
                let mut rest = poles.clone();
                rest.remove(i);
                rest
            };
            let tried = (0..poles.len()).filter_map(|i| {
                let fit = self.fit_at(structure, &without(i), STEPS_OF_A_TRIAL)?;
                Some((self.length(&fit), upper_half(&fit)))
            });
            let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
            next = best.and_then(|(_, poles)| self.fit_at(structure, &poles, self.settings.max_iterations));
        }
    }

    /// Whether a candidate is this fit.
    fn is_known(&self, structure: Structure, fit: &PoleFit) -> bool {
        /// Relative difference of the cost of two searches that end at one minimum.
        const SAME: f64 = 1e-3;
        self.candidates.iter().any(|c| {
            let (known, own) = (&c.fit.account, &fit.account);
            let alike = c.structure == structure && known.unknowns == own.unknowns;
            c.is_descended && alike && (known.cost - own.cost).abs() <= SAME * own.cost
        })
    }

    fn fit_at(&self, (count, numerator): Structure, poles: &[C64], steps: usize) -> Option<PoleFit> {
        let order = count
            + poles
                .iter()
                .map(|l| if l.im == 0.0 { 1 } else { 2 })
                .sum::<usize>();
        let settings = PoleFitSettings {
            order,
            integrators: kind(count),
            numerator,
            keep_stable: true,
            several_starts: false,
            max_iterations: steps,
            ..self.settings
        };
        let [one] = self.estimates else { return None };
        let fit = fit_from(one, self.clock, &settings, poles).ok()?;
        Some(match (self.held(), numerator) {
            (Some(one), NumeratorDegree::Proper) => self.agreed(one, &settings, fit),
            _ => fit,
        })
    }

    /// The stable candidate with the shortest description, at the noise where `taken` is, if it is shorter than that.
    fn shortest(&self, taken: &PoleFit) -> Option<Candidate> {
        let held = self.held().is_some();
        let class = |f: &PoleFit| {
            let one = std::slice::from_ref(f);
            (!stable(one) || held && alternates(f), !at_noise(one))
        };
        let key = |f: &PoleFit| (class(f), self.length(f));
        let before =
            |a: &((bool, bool), f64), b: &((bool, bool), f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
        let all = self.candidates.iter().filter(|c| self.told(&c.fit));
        let best = all.min_by(|a, b| before(&key(&a.fit), &key(&b.fit)))?;
        before(&key(&best.fit), &key(taken)).is_lt().then(|| best.clone())
    }
}

/// Poles, one of each pair, from which a fit with so many integrators begins: those of another fit, its integrators as slow real poles or
/// left out, or its slowest poles made integrators.
fn starts(fit: &PoleFit, count: usize, slow: f64) -> Vec<Vec<C64>> {
    let poles = upper_half(fit);
    if fit.fixed_integrators >= count {
        let more = fit.fixed_integrators - count;
        let with = |n: usize| {
            let extra = (0..n).map(|i| C64::from(slow.powf(0.5 + i as f64)));
            poles.iter().copied().chain(extra).collect()
        };
        return (0..=more).map(with).collect();
    }
    let mut rest = poles;
    rest.sort_by(|a, b| b.ln().norm().total_cmp(&a.ln().norm()));
    let mut missing = count - fit.fixed_integrators;
    while missing > 0 {
        let Some(slowest) = rest.pop() else { break };
        missing = missing.saturating_sub(if slowest.im == 0.0 { 1 } else { 2 });
    }
    vec![rest]
}
