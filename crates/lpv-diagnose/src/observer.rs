//! An observer in the place of a controller that nobody knows.
//!
//! A free axis that is simulated with the recorded inputs alone drifts away from its record. Here a weak feedback keeps it there:
//! the recorded inputs are the injection, the measured outputs the reference, and
//! `u = u_logged + k_p (y - y_hat) + k_d d(y - y_hat)/dt` with `k_p = J w^2`, `k_d = 2 d w J`. Errors slower than `w` are made
//! smaller by it, which the likelihood takes into account: it is that of the error one step ahead, whitened. Where a spring joins a
//! load to the motor, the feedback acts on both by their masses: it moves the rigid body and does not let the spring swing.

use crate::base::Pair;
use crate::fit::{Problem, Seen};
use crate::whiten::Whitening;
use crate::{Base, Explained, TraceError, Track, roughness};
use lpv_core::linalg::least_squares;
use lpv_core::{Controller, ControllerState, Discrete, Record};
use lpv_numerics::statistics::mean;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, TAU};

/// Bandwidth over the mean frequency of the motion.
const OVER_MOTION: f64 = 2.0;
/// It has at least so many periods in the longest record: a wrong force at rest, which makes a free axis drift, then costs little.
const PERIODS: f64 = 8.0;
/// And at most this part of the sample rate, where the sampled feedback is still that of the formula.
const MOST: f64 = 0.02;
/// Times its bandwidth up to which the force that a model lacks counts: above, a noise that is not white looks like one.
pub const FORCE_BAND: f64 = 4.0;
/// Damping.
pub(crate) const DAMPING: f64 = 0.7;

/// An observer.
#[derive(Debug, Clone)]
pub struct Observer {
    /// What stands in for the controller.
    pub controller: Controller,
    /// Its bandwidth, Hz.
    pub hz: f64,
}

impl Observer {
    /// Of a servo axis.
    ///
    /// # Errors
    /// [`TraceError::NoController`] for any other base.
    pub fn new(base: &Base, records: &[Record], clock: Discrete) -> Result<Self, TraceError> {
        let Base::Axis(axis) = base else {
            return Err(TraceError::NoController);
        };
        let inertia = axis.mass().abs();
        let h = clock.sample_time();
        let longest = records.iter().map(Record::len).max().unwrap_or(0) as f64 * h;
        let slowest = PERIODS / longest.max(h);
        let hz = (OVER_MOTION * mean_frequency(records, h))
            .max(slowest)
            .min(MOST / h);
        Ok(Self::at(hz, inertia, clock))
    }

    /// Slower ones, down to a period of the longest record, with which a free axis runs nearly free.
    pub fn slower(&self, base: &Base, records: &[Record], clock: Discrete) -> Vec<Self> {
        /// Factor from one to the next.
        const STEP: f64 = 3.0;
        let Base::Axis(axis) = base else {
            return Vec::new();
        };
        let h = clock.sample_time();
        let longest = records.iter().map(Record::len).max().unwrap_or(0) as f64 * h;
        let least = 1.0 / longest.max(h);
        let steps = ((self.hz / least).ln() / STEP.ln()).ceil().max(0.0) as i32;
        (1..=steps)
            .map(|i| Self::at((self.hz / STEP.powi(i)).max(least), axis.mass().abs(), clock))
            .collect()
    }

    /// Of a bandwidth, for a mass.
    fn at(hz: f64, mass: f64, clock: Discrete) -> Self {
        let h = clock.sample_time();
        let w = TAU * hz;
        let (stiffness, damping) = (mass * w * w, 2.0 * DAMPING * w * mass);
        let feedback = vec![vec![stiffness + damping / h, -damping / h]];
        Self {
            controller: Controller {
                reference_numerator: feedback.clone(),
                feedback_numerator: feedback,
                denominator: vec![vec![1.0]],
                limit: None,
            },
            hz,
        }
    }
}

/// Whether the inputs of these records run on between the samples ([`Track::running_on`]): of an amplifier or a generator they were
/// measured like the outputs, of a drive they are commands that are held. The base is fitted to both; what it leaves of the outputs
/// goes with it, root mean squares: held, and running on.
pub fn runs_on(base: &Base, controller: &ControllerState, held: &[Track]) -> Option<(bool, [f64; 2])> {
    /// Part of the squared error that inputs running on may leave. Held ones are late by half a sample, and so is little else; but
    /// friction that the base lacks may be mimicked a little.
    const LEFT: f64 = 0.5;
    const ITERATIONS: usize = 20;
    const FINER: f64 = 1e3;
    let start = Explained {
        base: base.clone(),
        effects: Vec::new(),
    };
    let running: Vec<Track> = held.iter().map(Track::running_on).collect();
    let left = |tracks: &[Track]| -> Option<f64> {
        // In units far below the error, so that the fit minimises the logarithm of its size.
        let size = Whitening::by_size(&errors_of(&start, controller, tracks)?, 1).finer(FINER);
        let problem = Problem {
            tracks,
            controller,
            whitening: &size,
            prior: None,
            seen: Seen::Outputs,
        };
        let fit = problem.fit(&start, ITERATIONS, None).ok()?;
        let errors = errors_of(&fit.model, controller, tracks)?;
        let count = errors.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        Some((errors.iter().flatten().map(|e| e[0] * e[0]).sum::<f64>() / count).sqrt())
    };
    let found = [left(held)?, left(&running)?];
    Some((found[1].powi(2) < LEFT * found[0].powi(2), found))
}

fn errors_of(model: &Explained, controller: &ControllerState, tracks: &[Track]) -> Option<Vec<Vec<Pair>>> {
    let runs = tracks
        .iter()
        .map(|t| Some(model.closed_loop(controller, t)?.error(t)));
    runs.collect()
}

/// The record as the observer wants it: what was measured is the reference, what was logged the injection.
pub fn followed(record: Record) -> Record {
    Record {
        references: record.outputs.clone(),
        injection: record.inputs.clone(),
        ..record
    }
}

/// Refuses records in none of which an output moves.
///
/// # Errors
/// [`TraceError::Record`].
pub fn check_motion(records: &[Record]) -> Result<(), TraceError> {
    /// Size of a motion over its noise from which it is one; white noise has one.
    const MOVES: f64 = 3.0;
    let is_smooth = |y: &Vec<f64>| {
        let middle = mean(y);
        let size = (y.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / y.len().max(1) as f64).sqrt();
        size > MOVES * roughness(y.windows(4).map(|w| [w[0], w[1], w[2], w[3]]))
    };
    let moves = |record: &Record| record.outputs.columns.iter().any(is_smooth);
    match records.first() {
        Some(first) if !records.iter().any(moves) => Err(TraceError::Record {
            record: first.name.clone(),
            problem: match (first.inputs.columns.iter().any(is_smooth), records) {
                (true, _) => "its output is rough as a force is, and its input smooth as a motion is: exchange input and output in the description",
                (false, [_]) => "its output does not move beyond its noise: record moves that turn, at several speeds, and hold one of them out",
                (false, _) => "its output does not move beyond its noise, nor does that of any other: record moves that turn, at several speeds",
            }
            .to_owned(),
        }),
        _ => Ok(()),
    }
}

/// Mean frequency of the motion, Hz: root of the power of its speed over that of its position.
fn mean_frequency(records: &[Record], h: f64) -> f64 {
    let (mut speed, mut position) = (0.0, 0.0);
    for y in records.iter().filter_map(|r| r.outputs.columns.first()) {
        let middle = mean(y);
        position += y.iter().map(|v| (v - middle).powi(2)).sum::<f64>();
        // Central differences of a distance over which the noise of a reading is small.
        let reach = (y.len() / 200).clamp(1, 50);
        speed += (reach..y.len().saturating_sub(reach))
            .map(|k| ((y[k + reach] - y[k - reach]) / (2.0 * reach as f64 * h)).powi(2))
            .sum::<f64>();
    }
    if position > 0.0 {
        (speed / position).sqrt() / (2.0 * PI)
    } else {
        0.0
    }
}

/// The records with the beginnings that a model makes of them. The first samples tell them with some deviation, and a rate that is
/// wrong by it takes long to die out: least squares of that, and of the error along the record by its own size, so that a model
/// which lacks much moves nothing.
///
/// A record of a rigid axis may begin anywhere about there: what another beginning makes of an error is no part of it.
pub fn settled(model: &Explained, controller: &ControllerState, tracks: &[Track]) -> Vec<Track> {
    told_by(model, controller, tracks, false)
}

/// The same, by the error alone where nearly all of it is due to the beginning of a rigid axis.
pub(crate) fn told_by(
    model: &Explained,
    controller: &ControllerState,
    tracks: &[Track],
    by_error: bool,
) -> Vec<Track> {
    const STEPS: usize = 3;
    // Less is the rounding of a minimum.
    const FALL: f64 = 0.9999;
    // Part of an error of which nearly all was due to the beginning.
    const MOST: f64 = 0.2;
    let one = |told: &Track| {
        let told = told.held_to_its_beginning();
        // Of what swings on a spring the first samples tell the beginning roughly.
        let doubt = if model.base.has_load() { ROUGHLY } else { 1.0 };
        let mut track = told.clone();
        let alone = (by_error && !model.base.has_load()).then_some((f64::INFINITY, MOST));
        for (doubt, fall) in [(doubt, FALL)].into_iter().chain(alone) {
            for _ in 0..STEPS {
                match better(model, controller, (&told, doubt), (&track, fall)) {
                    Some(next) => track = next,
                    None => break,
                }
            }
        }
        track
    };
    let freed = |track: Track| match model.base.has_load() {
        true => track,
        false => anywhere(model, controller, &track).unwrap_or(track),
    };
    tracks.iter().map(|t| freed(one(t))).collect()
}

/// Deviations of what swings over those of the noise of its readings.
const ROUGHLY: f64 = 100.0;

/// A record that may begin anywhere, about where it begins: what another beginning makes of the errors of a model does not count, as if it
/// were fitted with whatever else is ([`Track::error`]). None where the simulation leaves all bounds.
fn anywhere(model: &Explained, controller: &ControllerState, track: &Track) -> Option<Track> {
    let errors = |track: &Track| Some(DVector::from_vec(first_errors(model, controller, track)?));
    let deviations = track.beginning_deviations();
    let now = errors(track)?;
    let at = track.beginning();
    let change = |i: usize| {
        let mut at = at;
        at[i] += deviations[i];
        Some(errors(&track.beginning_at(at))? - &now)
    };
    Some(track.anywhere([change(0)?, change(1)?]))
}

/// Errors of the first output along a record.
pub(crate) fn first_errors(
    model: &Explained,
    controller: &ControllerState,
    track: &Track,
) -> Option<Vec<f64>> {
    let run = model.closed_loop(controller, track)?;
    Some(run.error(track).iter().map(|e| e[0]).collect())
}

/// A likelier beginning than that of `track`, if there is one by which the error falls to a part of what it was; the first samples tell that of
/// `told`, with so many times the deviation of their noise.
fn better(
    model: &Explained,
    controller: &ControllerState,
    (told, doubt): (&Track, f64),
    (track, fall): (&Track, f64),
) -> Option<Track> {
    let errors = |track: &Track| first_errors(model, controller, track);
    let now = errors(track)?;
    let size = (now.iter().map(|e| e * e).sum::<f64>() / now.len() as f64).sqrt();
    let deviations = told.beginning_deviations();
    let (first, at) = (told.beginning(), track.beginning());
    if !(size > 0.0 && deviations.iter().all(|d| d.is_finite() && *d > 0.0)) {
        return None;
    }
    // Errors by their size, then departures from what the first samples tell.
    let all = |errors: Vec<f64>, at: [f64; 2]| {
        let departures = [0, 1].map(|i: usize| (at[i] - first[i]) / (doubt * deviations[i]));
        let scaled = errors.into_iter().map(|e| e / size);
        DVector::from_iterator(now.len() + 2, scaled.chain(departures))
    };
    let moved = |i: usize| {
        let mut at = at;
        at[i] += deviations[i];
        Some(all(errors(&track.beginning_at(at))?, at))
    };
    let here = all(now.clone(), at);
    let rows = DMatrix::from_columns(&[moved(0)? - &here, moved(1)? - &here]);
    let change = least_squares(rows, &-&here, 1e-12).ok()?;
    let at = [
        at[0] + deviations[0] * change[0],
        at[1] + deviations[1] * change[1],
    ];
    let next = track.beginning_at(at);
    let there = all(errors(&next)?, at);
    (there.norm() < fall * here.norm()).then_some(next)
}
