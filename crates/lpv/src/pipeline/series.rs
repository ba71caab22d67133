//! The series expansion: the regression on a basis, with a rigid body beside it.

use crate::PipelineError;
use crate::basis::BasisStage;
use crate::config::{IdentifyConfig, Weighting};
use crate::poles::RigidTerms;
use lpv_core::linalg::{block_diagonal, from_blocks};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::{Discrete, FrfEstimate, StateSpace};
use lpv_ident::{IdentError, LocalFits, RegressionSettings, RigidTerm, regress};

/// The regression on a basis, with a rigid body.
///
/// # Errors
/// Those of the regression; [`PipelineError::Structure`] for more than two integrators.
pub fn regress_on(
    estimates: &[FrfEstimate],
    basis: &BasisStage,
    rigid: RigidTerms,
    config: &IdentifyConfig,
) -> Result<LocalFits, PipelineError> {
    let axes = estimates
        .first()
        .map_or(0, |e| e.frf().outputs().min(e.frf().inputs()));
    let settings = RegressionSettings {
        rigid_body: match rigid {
            RigidTerms::Constant => RigidTerm::diagonal(axes),
            RigidTerms::Absent | RigidTerms::Varying { .. } => Vec::new(),
        },
        model_error: config.model_error.unwrap_or_else(|| basis.model_error()),
        weighting: match config.weighting {
            Weighting::Covariance => lpv_ident::Weighting::Covariance,
            Weighting::Relative => lpv_ident::Weighting::Relative,
        },
        ..RegressionSettings::default()
    };
    let filters = basis.basis.state_space();
    match rigid {
        RigidTerms::Absent | RigidTerms::Constant => Ok(regress(estimates, filters, &settings)?),
        RigidTerms::Varying { single, double } => {
            let beside = |kinds| beside_integrators(filters, kinds);
            match regress(estimates, &beside([single, double])?, &settings) {
                // Filters with poles as slow as these lines cannot tell from an integrator are one: the other kind is what they lack.
                Err(IdentError::RankDeficient { .. }) if single => {
                    Ok(regress(estimates, &beside([false, true])?, &settings)?)
                }
                other => Ok(other?),
            }
        }
    }
}

/// Most integrators of a model of several positions: those of a mass.
pub(super) const MOST_INTEGRATORS: usize = 2;

pub(super) const TOO_MANY: PipelineError = PipelineError::Structure {
    problem: "a model of several positions has at most two integrators; set `integrators` to 0, 1 or 2, or take another quantity as output",
};

/// The filters with `1 / (z - 1)` before them, or with `(z + 1) / (z - 1)^2`, or with both: gains that depend on p as all others do. They
/// have size one where a sampled machine moves slowly.
fn beside_integrators(
    basis: &StateSpace<Discrete>,
    [single, double]: [bool; 2],
) -> Result<StateSpace<Discrete>, PipelineError> {
    /// Radians a sample at which the filters have size one.
    const SLOW: f64 = 0.01;
    let one = (dmatrix![1.0], dmatrix![SLOW], dmatrix![1.0]);
    let two = (
        dmatrix![1.0, 1.0; 0.0, 1.0],
        dmatrix![0.5; 1.0] * (SLOW * SLOW),
        dmatrix![1.0, 0.0],
    );
    let mut all = basis.clone();
    for (a, b, c) in [double.then_some(two), single.then_some(one)]
        .into_iter()
        .flatten()
    {
        all = StateSpace::new(
            block_diagonal(&a, all.a()),
            from_blocks(&[&[&b], &[all.b()]])?,
            block_diagonal(&c, all.c()),
            from_blocks(&[&[&DMatrix::zeros(1, 1)], &[all.d()]])?,
            basis.clock(),
        )?;
    }
    Ok(all)
}
