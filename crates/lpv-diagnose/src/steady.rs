//! A constant force that is not the same in all records.

use crate::{Base, Explained, Track};
use lpv_core::ControllerState;

/// Part of the squared error that a constant of each record must be for its force to be the cause.
const CAUSE: f64 = 0.85;

/// One part in so many of a record in which the observer settles.
const SETTLED: usize = 4;

/// The constant force of each record, where one of its own in each explains what a model of a free axis with one force for all leaves:
/// a load that hangs, a cable, an amplifier whose zero drifts. `controller`: the observer, whose static stiffness turns the mean of an
/// error into a force. None for another base, or where the error is something else.
pub fn steady_forces(model: &Explained, controller: &ControllerState, tracks: &[&Track]) -> Option<Vec<f64>> {
    let Base::Axis(axis) = &model.base else {
        return None;
    };
    if axis.stiffness().is_some() || tracks.len() < 2 || tracks.iter().any(|t| !t.follows) {
        return None;
    }
    let offset = model.base.parameters().iter().find(|p| p.name == "offset")?.value;
    let stiffness = static_gain(controller);
    let (mut of_means, mut whole) = (0.0, 0.0);
    let mut forces = Vec::with_capacity(tracks.len());
    for track in tracks {
        let mut error = model.closed_loop(controller, track)?.error(track);
        // The observer takes its time to yield to a force.
        error.drain(..error.len() / SETTLED);
        let count = error.len().max(1) as f64;
        let mean = error.iter().map(|e| e[0]).sum::<f64>() / count;
        of_means += count * mean * mean;
        whole += error.iter().map(|e| e[0] * e[0]).sum::<f64>();
        forces.push(offset - stiffness * mean);
    }
    (of_means > CAUSE * whole).then_some(forces)
}

/// What an observer answers to an error of one that lasts.
fn static_gain(controller: &ControllerState) -> f64 {
    let mut state = controller.clone();
    let mut force = [0.0];
    // The second step sees no rate.
    for _ in 0..2 {
        state.step(&[1.0], &[0.0], &mut force);
    }
    force[0]
}
