//! A base model with effects in the loop of the experiment.

mod exponential;
mod lane;
mod late;
mod run;

use crate::base::{Forces, MOST_STATES, Motion, Pair};
use crate::effect::Moment;
use crate::fit::Explained;
use crate::track::Track;
use lpv_core::ControllerState;
pub(crate) use run::{LANES, Run, side_by_side};

/// Response of a closed loop to the references of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Outputs as the sensors tell them, by sample.
    pub outputs: Vec<Pair>,
    /// Inputs of the machine, by sample.
    pub inputs: Vec<Pair>,
    /// Where effects find the machine, by sample; empty unless they were asked for.
    pub(crate) motions: Vec<Motion>,
}

impl Response {
    /// What the outputs of a record are beside these, by sample.
    pub fn error(&self, track: &Track) -> Vec<Pair> {
        track.error(&self.outputs)
    }
}

impl Explained {
    /// Response in the closed loop of a record. None where the numbers leave all bounds.
    pub fn closed_loop(&self, controller: &ControllerState, track: &Track) -> Option<Response> {
        let blocks = self.blocks();
        Run::new(&self.base, &blocks, track)
            .in_loop(controller)
            .response()
    }

    /// Response to the recorded inputs. None where the numbers leave all bounds.
    pub fn open_loop(&self, track: &Track) -> Option<Response> {
        Run::new(&self.base, &self.blocks(), track).response()
    }

    /// Motion in the closed loop of a record, by sample. None where the numbers leave all bounds.
    pub fn motions(&self, controller: &ControllerState, track: &Track) -> Option<Vec<Motion>> {
        let blocks = self.blocks();
        let run = Run::new(&self.base, &blocks, track).in_loop(controller);
        Some(run.with_motions().response()?.motions)
    }

    /// What the effects do to the forces of the motors along a motion of a record, by sample; effects with states of their own
    /// stay at their start.
    pub fn forces_along(&self, track: &Track, motions: &[Motion]) -> Vec<Pair> {
        let blocks = self.blocks();
        let mut own = [0.0; MOST_STATES];
        let mut rates = own;
        motions
            .iter()
            .enumerate()
            .map(|(k, motion)| {
                let [p, rate] = track.scheduling(k);
                let at = Moment {
                    time: k as f64 * track.step,
                    p,
                    rate,
                    step: track.step,
                    motion: *motion,
                    machine: &self.base,
                    track,
                    sample: k,
                    part: 0.0,
                };
                let mut forces = Forces::default();
                for block in &blocks {
                    let states = block.states();
                    block.start(&at, &mut own[..states]);
                    block.act(&at, &own[..states], &mut rates[..states], &mut forces);
                }
                // What the mass takes that is more.
                forces.motors[0] -= forces.mass * acceleration(motions, k, track.step);
                forces.motors
            })
            .collect()
    }
}

/// Acceleration of the load at a sample, from its speeds at those beside it.
pub(crate) fn acceleration(motions: &[Motion], k: usize, step: f64) -> f64 {
    let (first, last) = (k.saturating_sub(1), (k + 1).min(motions.len() - 1));
    let speed = |k: usize| motions[k].load_speed[0];
    match last - first {
        0 => 0.0,
        samples => (speed(last) - speed(first)) / (samples as f64 * step),
    }
}

#[cfg(test)]
mod tests;
