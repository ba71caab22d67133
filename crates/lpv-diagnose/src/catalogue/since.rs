//! What is there from a time of a record on, in one record or in all.

use crate::base::Motion;
use crate::effect::{EffectParameter, Moment, Scale};
use crate::screen::{Screen, Trial};
use crate::simulate::acceleration;
use crate::track::Track;

/// The number of a record in the parameters of an effect; zero stands for every record.
pub(super) const RECORD: EffectParameter = EffectParameter {
    name: "record",
    unit: "",
    scale: Scale::Chosen,
};

/// When it begins.
pub(super) const BEGINS: EffectParameter = EffectParameter {
    name: "begins",
    unit: "s",
    scale: Scale::Instant,
};

/// From when on, and in which record.
#[derive(Debug, Clone, Copy)]
pub(super) struct Since {
    pub(super) begins: f64,
    pub(super) record: usize,
}

impl Since {
    /// Begin and record of an effect's values.
    pub(super) fn new(begins: f64, record: f64) -> Self {
        Self {
            begins,
            // A number of a record, or zero.
            record: record as usize,
        }
    }

    pub(super) fn is_in(&self, track: &Track) -> bool {
        self.record == 0 || self.record == track.number
    }

    /// How much of it is there: none, all, or a part within the sample in which it begins, so that a fit sees which way to go.
    pub(super) fn part(&self, at: &Moment<'_>) -> f64 {
        match self.is_in(at.track) {
            true => ((at.time - self.begins) / at.track.step + 0.5).clamp(0.0, 1.0),
            false => 0.0,
        }
    }
}

/// Records in which something may be: each, where there are several.
pub(super) fn single(screen: &Screen<'_>) -> Vec<usize> {
    let numbers = screen.tracks.iter().map(|t| t.number);
    match screen.tracks.len() {
        0 | 1 => Vec::new(),
        _ => numbers.filter(|n| *n > 0).collect(),
    }
}

/// The likeliest begins with their amplitudes, in all records together and in each; `force` is what one unit does at a sample.
pub(super) fn begins(
    screen: &Screen<'_>,
    force: impl Fn(&[Motion], usize, f64) -> f64 + Sync,
) -> Vec<Vec<f64>> {
    /// Times that are tried in a record.
    const TIMES: usize = 48;
    let step = screen.step();
    let forces: Vec<Vec<f64>> = screen
        .motions
        .iter()
        .map(|m| (0..m.len()).map(|k| force(m, k, step)).collect())
        .collect();
    let mut found = Vec::new();
    for record in [0].into_iter().chain(single(screen)) {
        let is_in = |t: &Track| record == 0 || t.number == record;
        let records = screen.tracks.iter().filter(|t| is_in(t));
        let shortest = records.map(|t| t.samples).min().unwrap_or(0);
        // Neither at the start, where a force that is always there begins, nor at the end.
        let at = |i: usize| shortest * (i + 1) / (TIMES + 2);
        let trials = |i: usize| {
            let all = screen.tracks.iter().zip(&forces).map(|(track, forces)| {
                let is_there = |k: usize| is_in(track) && k >= at(i);
                let one = |(k, f): (usize, &f64)| [if is_there(k) { *f } else { 0.0 }, 0.0];
                forces.iter().enumerate().map(one).collect()
            });
            vec![Trial::Motors(all.collect())]
        };
        let best = screen.best(TIMES, trials).into_iter().filter(|(i, _)| at(*i) > 0);
        found.extend(best.map(|(i, v)| vec![v[0], at(i) as f64 * step, record as f64]));
    }
    found
}

/// What one unit of mass takes along a motion.
pub(super) fn inertia(motions: &[Motion], k: usize, step: f64) -> f64 {
    -acceleration(motions, k, step)
}
