//! From where a fit of a user's effect begins.

use super::law::{Frame, Law};
use crate::base::Pair;
use crate::catalogue::motor_forces;
use crate::effect::{Moment, Place};
use crate::screen::{Screen, Trial};
use rayon::prelude::*;

/// Starts that are handed on.
const MOST: usize = 8;
/// How many of them are moved, and how often each parameter is.
const MOVED: usize = 3;
const ROUNDS: usize = 12;
/// Steps from sample to sample with which states of its own are followed.
const PARTS: usize = 4;

/// The starts of the user, each with the amplitudes that explain the most there; those that explain the most of all lead, moved to
/// where they explain the most: a fit that begins a width away from a narrow force does not find it.
pub(super) fn starts(law: &Law, screen: &Screen<'_>, place: Place) -> Vec<Vec<f64>> {
    let combined = combinations(&law.parameters);
    if law.amplitudes == 0 {
        return combined;
    }
    let look = |values: Vec<f64>| look(law, screen, place, values);
    let mut found: Vec<Look> = combined.into_par_iter().map(look).collect();
    found.sort_by(|a, b| b.part.total_cmp(&a.part));
    found.truncate(MOST);
    let (lead, rest) = found.split_at(found.len().min(MOVED));
    let mut all: Vec<Look> = lead
        .par_iter()
        .map(|start| moved(law, start, &look))
        .chain(rest.par_iter().cloned())
        .collect();
    all.sort_by(|a, b| b.part.total_cmp(&a.part));
    all.into_iter().map(|l| l.values).collect()
}

/// A start, and the part of the residual's squares that it explains.
#[derive(Clone)]
struct Look {
    part: f64,
    values: Vec<f64>,
}

fn look(law: &Law, screen: &Screen<'_>, place: Place, values: Vec<f64>) -> Look {
    let trials = trials(law, screen, place, &values);
    match trials.and_then(|trials| screen.explain(&trials)) {
        Some((part, amplitudes)) if amplitudes.iter().all(|a| a.is_finite()) => Look {
            part,
            values: amplitudes
                .iter()
                .chain(&values[law.amplitudes..])
                .copied()
                .collect(),
        },
        _ => Look {
            part: f64::NEG_INFINITY,
            values,
        },
    }
}

/// The best place that steps along one parameter after the other lead to, each half as long as the ones before that led nowhere.
fn moved(law: &Law, start: &Look, look: &impl Fn(Vec<f64>) -> Look) -> Look {
    let mut best = start.clone();
    let mut steps: Vec<f64> = law.ways.iter().map(|way| way.step).collect();
    for _ in 0..ROUNDS {
        for ((i, step), way) in steps.iter_mut().enumerate().zip(&law.ways) {
            let one = |side: f64| {
                let mut values = best.values.clone();
                values[..law.amplitudes].fill(0.0);
                let value = &mut values[law.amplitudes + i];
                *value = way.moved(*value, side * *step);
                look(values)
            };
            let next = [one(1.0), one(-1.0)]
                .into_iter()
                .max_by(|a, b| a.part.total_cmp(&b.part));
            match next {
                Some(next) if next.part > best.part => best = next,
                _ => *step *= 0.5,
            }
        }
    }
    best
}

fn combinations(parameters: &[Vec<f64>]) -> Vec<Vec<f64>> {
    parameters.iter().fold(vec![Vec::new()], |all, starts| {
        let longer = |values: &Vec<f64>| {
            let values = values.clone();
            starts
                .iter()
                .map(move |s| values.iter().copied().chain([*s]).collect())
        };
        all.iter().flat_map(longer).collect()
    })
}

/// What one of each amplitude does along the motions of a screen; none where a formula has no number there.
fn trials(law: &Law, screen: &Screen<'_>, place: Place, values: &[f64]) -> Option<Vec<Trial>> {
    let without = along(law, screen, place, values)?;
    let one = |i: usize| {
        let mut values = values.to_vec();
        values[i] = 1.0;
        let mut with = along(law, screen, place, &values)?;
        for (with, without) in with.iter_mut().flatten().zip(without.iter().flatten()) {
            (0..2).for_each(|i| with[i] -= without[i]);
        }
        Some(match place {
            Place::Output(_) => Trial::Outputs(with),
            Place::Motor(_) | Place::AllMotors => Trial::Motors(with),
        })
    };
    (0..law.amplitudes).map(one).collect()
}

/// Forces of the motors, or what is added to the outputs, by record and sample.
fn along(law: &Law, screen: &Screen<'_>, place: Place, values: &[f64]) -> Option<Vec<Vec<Pair>>> {
    let channel = place.first();
    let unit = match place {
        Place::Output(_) => std::array::from_fn(|i| f64::from(u8::from(i == channel))),
        Place::Motor(_) | Place::AllMotors => motor_forces(screen.base, channel, 1.0),
    };
    let frames = |r: usize| -> Vec<Frame> {
        let (track, motions) = (&screen.tracks[r], &screen.motions[r]);
        let frame = |(k, motion)| {
            let [p, rate] = track.scheduling(k);
            let at = Moment {
                time: k as f64 * track.step,
                p,
                rate,
                step: track.step,
                motion,
                machine: screen.base,
                track,
                sample: k,
                part: 0.0,
            };
            let (input, reading) = (track.inputs[k][channel], track.outputs[k][channel]);
            law.frame(values, channel, &at, &law.start, input, reading)
        };
        motions.iter().copied().enumerate().map(frame).collect()
    };
    let mut all = Vec::with_capacity(screen.tracks.len());
    for (r, track) in screen.tracks.iter().enumerate() {
        let mut frames = frames(r);
        law.follow(&mut frames, track.step);
        let force = |frame: &Frame| {
            let force = law.output(frame);
            force.is_finite().then(|| unit.map(|u| u * force))
        };
        all.push(frames.iter().map(force).collect::<Option<Vec<Pair>>>()?);
    }
    Some(all)
}

impl Law {
    /// Fills its states in along the frames of a record, by the classical Runge-Kutta rule on frames between which all runs straight.
    fn follow(&self, frames: &mut [Frame], step: f64) {
        let states = self.first_state()..self.first_state() + self.rates.len();
        if states.is_empty() {
            return;
        }
        let h = step / PARTS as f64;
        let mut own = self.start.clone();
        for k in 1..frames.len() {
            let [from, to] = [frames[k - 1], frames[k]];
            let rates = |part: f64, own: &[f64]| -> Vec<f64> {
                let mut frame: Frame = std::array::from_fn(|i| from[i] + part * (to[i] - from[i]));
                frame[states.clone()].copy_from_slice(own);
                self.rates.iter().map(|rate| rate.at(&frame)).collect()
            };
            let moved = |own: &[f64], by: f64, rates: &[f64]| -> Vec<f64> {
                own.iter().zip(rates).map(|(x, r)| x + by * r).collect()
            };
            for part in 0..PARTS {
                let at = |half: usize| (2 * part + half) as f64 / (2 * PARTS) as f64;
                let k1 = rates(at(0), &own);
                let k2 = rates(at(1), &moved(&own, 0.5 * h, &k1));
                let k3 = rates(at(1), &moved(&own, 0.5 * h, &k2));
                let k4 = rates(at(2), &moved(&own, h, &k3));
                let mean = |i: usize| (k1[i] + k4[i] + 2.0 * (k2[i] + k3[i])) / 6.0;
                own.iter_mut().enumerate().for_each(|(i, x)| *x += h * mean(i));
            }
            frames[k][states.clone()].copy_from_slice(&own);
        }
    }
}
