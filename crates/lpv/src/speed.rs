//! Outputs that are speeds, for what is made for positions.

use crate::PipelineError;
use experiment_data::{ChannelGroup, Quantity};
use lpv_core::{AxisOutput, Discrete, Record, RigidBody};
use lti_ident::rigid_body::integrated;

/// What the output of each servo axis is.
///
/// # Errors
/// [`PipelineError::NoAxis`] for one that is neither a position nor a speed.
pub(crate) fn axis_outputs(outputs: &ChannelGroup) -> Result<Vec<AxisOutput>, PipelineError> {
    (0..outputs.len())
        .map(|k| match outputs.quantity_of(k) {
            Quantity::Position => Ok(AxisOutput::Position),
            Quantity::Speed => Ok(AxisOutput::Speed),
            other => Err(PipelineError::NoAxis {
                output: outputs.columns[k].clone(),
                quantity: other.name(),
            }),
        })
        .collect()
}

/// The record with the positions of axes whose output is a speed, from zero, and those of their references.
pub(crate) fn with_positions(mut record: Record, axes: &[AxisOutput], clock: Discrete) -> Record {
    for (k, axis) in axes.iter().enumerate() {
        if axis.is_position() {
            continue;
        }
        for signals in [&mut record.outputs, &mut record.references] {
            if let Some(column) = signals.columns.get_mut(k) {
                *column = integrated(column, clock);
            }
        }
    }
    record
}

/// What the outputs of a model are.
pub(crate) fn outputs_of(body: &RigidBody) -> Vec<AxisOutput> {
    body.axes().iter().map(|a| a.output).collect()
}
