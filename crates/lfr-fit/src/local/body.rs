//! A local model whose rigid body has friction to ground, or a gain that depends on p.

use super::residues::{Beside, Residues};
use super::{RigidGain, around, only_position, upper_half};
use crate::{
    Candidate, FitError, FrozenData, RandomChannels, RefineAccount, RefineSettings, Rigid, refine, sampled,
};
use lpv_core::linalg::{block_diagonal, dimension, from_blocks};
use lpv_core::{Continuous, CoreError, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;

/// A model at one position with the states `[q; v; modes]`: positions and speeds of the rigid body first, one of each an output.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalBody {
    /// The model.
    pub model: StateSpace<Continuous>,
    /// How the fit went.
    pub account: RefineAccount,
}

/// The rigid body `dq/dt = v`, `dv/dt = -R v + Gamma u`, residues of known poles by linear least squares beside it, then a fit of all
/// entries that `rigid` leaves free.
///
/// `data`: one position. `poles`: values of z of the modes; of a conjugate pair one is enough. `gain`: Gamma, `n_y x n_u`; `rate`: R,
/// `n_y x n_y`, one over the unit of time, zero without friction.
///
/// # Errors
/// [`FitError::Data`] for several positions, [`FitError::Pole`], [`FitError::Empty`] without poles or with a rigid body of another kind,
/// [`FitError::TooFewEquations`], and those of [`refine`].
pub fn local_body(
    data: &FrozenData,
    poles: &[Complex<f64>],
    rigid: Rigid<'_>,
    (gain, rate): (&DMatrix<f64>, &DMatrix<f64>),
    settings: &RefineSettings,
) -> Result<LocalBody, FitError> {
    settings.check()?;
    let position = only_position(data)?;
    if !matches!(rigid, Rigid::Varying | Rigid::Friction) {
        return Err(FitError::Empty {
            what: "rigid bodies within the local model",
        });
    }
    let (ny, nu) = (data.outputs(), gain.ncols());
    dimension("rigid body: rows of its gain", ny, gain.nrows())?;
    dimension("rigid body: rows of its rates", ny, rate.nrows())?;
    dimension("rigid body: columns of its rates", ny, rate.ncols())?;
    let (zero, one) = (DMatrix::zeros(ny, ny), DMatrix::identity(ny, ny));
    let body = StateSpace::new(
        from_blocks(&[&[&zero, &one], &[&zero, &-rate]])?,
        from_blocks(&[&[&DMatrix::zeros(ny, nu)], &[gain]])?,
        from_blocks(&[&[&one, &zero]])?,
        DMatrix::zeros(ny, nu),
        Continuous,
    )?;
    let held = sampled(&body, data.clock())?.ok_or(CoreError::Singular {
        operation: "the hold of a rigid body",
    })?;
    let alone = held.frequency_response(position.frf.frequencies_hz())?;
    let upper = upper_half(Continuous, poles, RigidGain::Full)?;
    let residues = Residues::new(Continuous, data, &upper, Beside::Known(&alone))?;
    let (modes, _) = residues.realise(Continuous, data)?;
    let whole = StateSpace::new(
        block_diagonal(body.a(), modes.a()),
        from_blocks(&[&[body.b()], &[modes.b()]])?,
        from_blocks(&[&[body.c(), modes.c()]])?,
        DMatrix::zeros(ny, nu),
        Continuous,
    )?;
    let candidate = Candidate::flexible(
        &whole,
        rigid,
        &[],
        around(&position.p)?,
        RandomChannels::default(),
    )?;
    let fitted = refine(&candidate, data, settings)?;
    let model = fitted
        .candidate
        .shape()
        .system(fitted.candidate.matrix(), Continuous)?;
    Ok(LocalBody {
        model,
        account: fitted.account,
    })
}
