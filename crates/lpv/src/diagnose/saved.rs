//! The linear part of a machine, as a model file keeps it.

use super::Diagnosed;
use crate::summary::Summary;
use crate::{IdentifyConfig, ModelFile, Outcome, PipelineError, Stages};
use experiment_data::Bundle;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{AxisOutput, Continuous, Model, RigidBody, RigidBodyAxis, SchedulingRange, StateSpace};
use lpv_diagnose::Base;
use std::path::Path;

/// The range of some positions; about a single one a little of it, since a range is wide.
pub(crate) fn range_of(positions: &[f64]) -> Result<SchedulingRange, PipelineError> {
    let (low, high) = lpv_numerics::statistics::range(positions);
    let least = 1e-6 * low.abs().max(high.abs()).max(1e-3);
    let more = (0.5 * (least - (high - low))).max(0.0);
    Ok(SchedulingRange::interval(low - more, high + more)?)
}

/// The linear part of a machine, as a model file keeps it.
pub(super) fn saved(
    base: &Base,
    identified: Option<Model>,
    deviations: &[f64],
    positions: &[f64],
) -> Result<Model, PipelineError> {
    let parameters = base.parameters();
    match base {
        Base::XyTable(table) => Ok(Model::ContinuousLpv(table.to_lpv(range_of(positions)?)?)),
        Base::Axis(axis) if axis.stiffness().is_some() || axis.load().is_some() => {
            let [a, b, c] = base.frozen(0.0)?;
            let d = DMatrix::zeros(c.nrows(), b.ncols());
            Ok(Model::ContinuousStateSpace(StateSpace::new(
                a, b, c, d, Continuous,
            )?))
        }
        Base::Axis(_) => {
            let value = |i: usize| (parameters[i].value, deviations.get(i).copied());
            let known = |d: Option<f64>| d.filter(|d| d.is_finite()).unwrap_or(0.0);
            let [inertia, viscous, offset] = [0, 1, 2].map(value);
            Ok(Model::RigidBody(RigidBody::new(vec![RigidBodyAxis {
                inertia: inertia.0,
                viscous: viscous.0,
                offset: offset.0,
                inertia_deviation: known(inertia.1),
                viscous_deviation: known(viscous.1),
                offset_deviation: known(offset.1),
                output: AxisOutput::Position,
            }])?))
        }
        Base::Lpv(_) => identified.ok_or(PipelineError::Structure {
            problem: "the model behind the base is gone",
        }),
    }
}

impl Diagnosed {
    /// The model with its effects for the file `output`.
    ///
    /// # Errors
    /// None for a bundle that could be diagnosed.
    pub fn model_file(&self, bundle: &Bundle, output: &Path) -> Result<ModelFile, PipelineError> {
        let verdict = std::iter::once(self.diagnosis.verdict_in_words.clone());
        let reasons = verdict.chain(self.explanation.lines()).collect();
        let outcome = Outcome {
            summary: Summary::of_axes(&self.model, Vec::new(), reasons),
            model: self.model.clone(),
            deviation: None,
            // A file keeps the effects of one machine; those of several axes stand in `diagnosis.json`.
            explanation: self.axes.is_empty().then(|| self.explanation.clone()),
            stages: Stages::Diagnosis,
        };
        ModelFile::of(outcome, bundle, IdentifyConfig::default(), output)
    }
}
