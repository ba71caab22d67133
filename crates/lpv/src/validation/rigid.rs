//! Forces and velocities of rigid-body axes, as the literature on servo axes states them.

use crate::PipelineError;
use crate::speed::{outputs_of, with_positions};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{AxisOutput, Discrete, Record, RigidBody};
use lpv_simulate::Run;
use lti_ident::rigid_body::{Filter, Motion, RigidBodySettings, integrated};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Errors of one axis: `100 |measured - model| / |measured|`, norms over the record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisCheck {
    /// The input.
    pub input: String,
    /// Force from the inverse dynamics along the measured motion, filtered as in the identification.
    pub force_percent: f64,
    /// Root mean square of that error, in units of the input; in no file.
    #[serde(skip)]
    pub force_rms: f64,
    /// Cut-off of the filter, Hz; in no file.
    #[serde(skip)]
    pub force_band_hz: f64,
    /// Velocity simulated from the recorded force, against the filtered derivative of the measured position.
    pub open_loop_velocity_percent: f64,
    /// Position simulated from the recorded force, root mean square of its error; of a speed, its integral.
    pub open_loop_position_rms: f64,
    /// Simulated in closed loop; none without a controller.
    pub closed_loop: Option<ClosedLoopAxis>,
}

/// One axis in closed loop with the bundle's controller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClosedLoopAxis {
    /// Position.
    pub position_percent: f64,
    /// Velocity.
    pub velocity_percent: f64,
    /// Force of the simulated controller against the recorded one.
    pub force_percent: f64,
}

pub(super) fn check(
    body: &RigidBody,
    clock: Discrete,
    record: &Record,
    open: &Run,
    closed: Option<&Run>,
) -> Result<Vec<AxisCheck>, PipelineError> {
    let record = &with_positions(record.clone(), &outputs_of(body), clock);
    // Of a speed, what is compared is its integral.
    let position = |m: &DMatrix<f64>, i: usize| -> Vec<f64> {
        let own: Vec<f64> = m.row(i).iter().copied().collect();
        match body.axes()[i].output {
            AxisOutput::Position => own,
            AxisOutput::Speed => integrated(&own, clock),
        }
    };
    let row = |m: &DMatrix<f64>, i: usize| -> Vec<f64> { m.row(i).iter().copied().collect() };
    body.axes()
        .iter()
        .enumerate()
        .map(|(i, axis)| {
            let open = position(&open.outputs, i);
            let closed = closed.map(|run| (position(&run.outputs, i), row(&run.inputs, i)));
            check_axis(
                (clock, f64::INFINITY),
                axis.output,
                record,
                i,
                |m| m.force(axis),
                &open,
                closed,
            )
        })
        .collect()
}

/// One axis: the force that it needs along a motion, its position in open loop, position and force in closed loop. Forces are compared
/// in the band of the acceleration, and up to `most_hz` at the most.
pub(crate) fn check_axis(
    (clock, most_hz): (Discrete, f64),
    output: AxisOutput,
    record: &Record,
    i: usize,
    force: impl Fn(&Motion) -> Vec<f64>,
    open: &[f64],
    closed: Option<(Vec<f64>, Vec<f64>)>,
) -> Result<AxisCheck, PipelineError> {
    let (q, u) = (&record.outputs.columns[i], &record.inputs.columns[i]);
    let filter_of = |settings: &RigidBodySettings| match output {
        AxisOutput::Position => Filter::new(&[q], clock, settings),
        AxisOutput::Speed => Filter::of_speeds(&[q], clock, settings),
    };
    let mut filter = filter_of(&RigidBodySettings::default())?;
    if filter.regression_cutoff_hz > most_hz {
        let settings = RigidBodySettings {
            regression_cutoff_hz: Some(most_hz),
            ..RigidBodySettings::default()
        };
        filter = filter_of(&settings)?;
    }
    // Simulated positions go through the same filter, so that derivatives compare like with like.
    let motion = |q: &[f64]| Motion::new(q, clock, filter.position_cutoff_hz);
    let measured = motion(q)?;
    let (pushed, told) = (filter.held(u, clock)?, filter.reduced(&force(&measured), clock)?);
    let left: f64 = pushed.iter().zip(&told).map(|(a, b)| (a - b).powi(2)).sum();
    let squares: f64 = q.iter().zip(open).map(|(a, b)| (a - b) * (a - b)).sum();
    Ok(AxisCheck {
        input: record.inputs.names[i].clone(),
        force_percent: relative(&pushed, &told),
        force_rms: (left / pushed.len().max(1) as f64).sqrt(),
        force_band_hz: filter.regression_cutoff_hz,
        open_loop_velocity_percent: relative(&measured.velocity, &motion(open)?.velocity),
        open_loop_position_rms: (squares / q.len().max(1) as f64).sqrt(),
        closed_loop: match closed {
            Some((outputs, inputs)) => Some(ClosedLoopAxis {
                position_percent: relative(q, &outputs),
                velocity_percent: relative(&measured.velocity, &motion(&outputs)?.velocity),
                force_percent: relative(u, &inputs),
            }),
            None => None,
        },
    })
}

fn relative(measured: &[f64], model: &[f64]) -> f64 {
    let error: f64 = measured.iter().zip(model).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = measured.iter().map(|a| a * a).sum();
    100.0 * (error / size).sqrt()
}
