//! Simulations, several side by side: what one waits for, a processor fills with the others.

use super::Response;
use super::lane::Lane;
use crate::base::{Base, Body, MOST_STATES, Motion, Pair};
use crate::effect::{Block, Moment};
use crate::track::Track;
use lpv_core::ControllerState;

/// One simulation of a record from where it begins, see [`Track::new`], with the classical Runge-Kutta rule in equal parts of a sample.
/// Commands are held, unless the inputs of the record were measured ([`Track::running_on`]); where a delay changes them inside a part, or
/// a lag the forces of the motors, it gets the straight line with their mean and first moment there.
pub(crate) struct Run<'a> {
    pub(super) machine: Base,
    pub(super) blocks: &'a [Box<dyn Block>],
    /// States of the blocks.
    pub(super) own: Vec<usize>,
    pub(super) controller: Option<&'a ControllerState>,
    pub(super) track: &'a Track,
    pub(super) noise: Option<&'a [Pair]>,
    /// Part of what an observer gives that acts on the load.
    pub(super) to_load: f64,
    /// Parts of a sample, how many of those of the track one is, and its time.
    pub(super) parts: usize,
    pub(super) stride: usize,
    pub(super) part: f64,
    /// Whether the motions are kept.
    pub(super) is_watched: bool,
}

/// Runs side by side that keep a processor busy: two take hardly longer than one, and more no less for each.
pub(crate) const LANES: usize = 2;

/// Responses of some runs, in their order. None where the numbers leave all bounds.
///
/// Each is that of [`Run::response`], to the last bit.
pub(crate) fn side_by_side(runs: &[&Run<'_>]) -> Vec<Option<Response>> {
    let Some(first) = runs.first() else {
        return Vec::new();
    };
    let kind = |run: &Run<'_>| (run.parts, run.states(), std::mem::discriminant(&run.machine));
    if runs.iter().any(|run| kind(run) != kind(first)) {
        return runs.iter().map(|run| run.response()).collect();
    }
    match &first.machine {
        Base::XyTable(_) => wide(runs, |base| match base {
            Base::XyTable(body) => Some(body),
            Base::Axis(_) | Base::Lpv(_) => None,
        }),
        Base::Axis(_) => wide(runs, |base| match base {
            Base::Axis(body) => Some(body),
            Base::XyTable(_) | Base::Lpv(_) => None,
        }),
        Base::Lpv(_) => wide(runs, |base| match base {
            Base::Lpv(body) => Some(body),
            Base::XyTable(_) | Base::Axis(_) => None,
        }),
    }
}

/// With room for the states that there are.
fn wide<B: Body>(runs: &[&Run<'_>], body: impl Fn(&Base) -> Option<&B>) -> Vec<Option<Response>> {
    match runs.first().map_or(0, |run| run.states()) {
        0..=2 => together::<B, 2>(runs, body),
        3..=4 => together::<B, 4>(runs, body),
        5..=8 => together::<B, 8>(runs, body),
        9..=12 => together::<B, 12>(runs, body),
        13..=MOST_STATES => together::<B, MOST_STATES>(runs, body),
        _ => runs.iter().map(|_| None).collect(),
    }
}

/// Stage by stage, each time all of them; a run leaves where its record ends, or where its numbers leave all bounds.
fn together<B: Body, const N: usize>(
    runs: &[&Run<'_>],
    body: impl Fn(&Base) -> Option<&B>,
) -> Vec<Option<Response>> {
    let mut found: Vec<Option<Response>> = runs.iter().map(|_| None).collect();
    let begun = runs.iter().enumerate();
    let mut lanes: Vec<(usize, Lane<'_, B, N>)> = begun
        .filter_map(|(i, run)| Some((i, Lane::new(run, body(&run.machine)?))))
        .collect();
    let parts = runs.first().map_or(1, |run| run.parts);
    let mut k = 0;
    while !lanes.is_empty() {
        let mut at = 0;
        while at < lanes.len() {
            if k == lanes[at].1.run.track.samples {
                let (i, lane) = lanes.swap_remove(at);
                found[i] = Some(lane.response);
            } else if lanes[at].1.read(k) {
                at += 1;
            } else {
                lanes.swap_remove(at);
            }
        }
        for part in 0..parts {
            lanes.iter_mut().for_each(|(_, lane)| lane.drive(k, part));
            lanes.iter_mut().for_each(|(_, lane)| lane.stage::<0>(k));
            lanes.iter_mut().for_each(|(_, lane)| lane.stage::<1>(k));
            lanes.iter_mut().for_each(|(_, lane)| lane.stage::<2>(k));
            lanes.iter_mut().for_each(|(_, lane)| lane.stage::<3>(k));
            lanes.iter_mut().for_each(|(_, lane)| lane.advance(k));
        }
        k += 1;
    }
    found
}

impl<'a> Run<'a> {
    /// From the logged inputs, in the parts of a sample of the track.
    pub(crate) fn new(base: &Base, blocks: &'a [Box<dyn Block>], track: &'a Track) -> Self {
        let mut machine = base.clone();
        blocks.iter().for_each(|b| b.mount(&mut machine));
        Self {
            machine,
            blocks,
            own: blocks.iter().map(|b| b.states()).collect(),
            controller: None,
            track,
            noise: None,
            to_load: if track.follows {
                base.correction_of_load()
            } else {
                0.0
            },
            parts: track.substeps,
            stride: 1,
            part: track.step / track.substeps as f64,
            is_watched: false,
        }
    }

    /// The same in the loop of a controller.
    pub(crate) fn in_loop(self, controller: &'a ControllerState) -> Self {
        Self {
            controller: Some(controller),
            ..self
        }
    }

    /// The same in other equal parts of a sample, a divisor of those of the track.
    pub(crate) fn in_parts(self, parts: usize) -> Self {
        Self {
            parts,
            stride: self.track.substeps / parts,
            part: self.track.step / parts as f64,
            ..self
        }
    }

    /// The same with this noise added to the outputs before the controller reads them.
    pub(crate) fn with_noise(self, noise: &'a [Pair]) -> Self {
        Self {
            noise: Some(noise),
            ..self
        }
    }

    /// The same with the motions of the machine.
    pub(crate) fn with_motions(self) -> Self {
        Self {
            is_watched: true,
            ..self
        }
    }

    /// None where the numbers leave all bounds.
    pub(crate) fn response(&self) -> Option<Response> {
        side_by_side(&[self]).pop()?
    }

    fn states(&self) -> usize {
        self.machine.states() + self.own.iter().sum::<usize>()
    }

    #[inline(always)]
    pub(super) fn moment<const N: usize>(
        &self,
        body: &impl Body,
        x: &[f64; N],
        (k, point): (usize, usize),
        whole: bool,
    ) -> Moment<'_> {
        let part = point as f64 * self.track.half;
        let [p, rate] = self.track.at(k, point);
        Moment {
            time: (k as f64 + part) * self.track.step,
            p,
            rate,
            step: self.part,
            motion: if whole {
                body.motion(x, p)
            } else {
                Motion::default()
            },
            machine: &self.machine,
            track: self.track,
            sample: k,
            part,
        }
    }
}
