//! Where the small LFR begins: the middle position, with the rigid body that the data show.

use crate::PipelineError;
use crate::config::RigidBody;
use crate::poles::{PoleStage, RigidTerms};
use crate::rigid::gain_and_rate;
use lfr_fit::{
    FitError, FrozenData, LocalSettings, RefineSettings, Rigid, RigidGain, local_body, local_model,
};
use lpv_core::nalgebra::DMatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, Discrete, FrfEstimate, StateSpace};

/// What the rigid body of a small LFR is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Body {
    Absent,
    /// Masses that do not depend on p.
    Constant,
    /// The same, each axis by itself, because that was given.
    Decoupled,
    /// Masses that do.
    Varying,
    /// With friction to ground.
    Friction,
}

impl Body {
    /// # Errors
    /// One integrator without friction to ground, which no such LFR has.
    pub(super) fn of(poles: &PoleStage) -> Result<Self, PipelineError> {
        match poles.rigid_terms() {
            RigidTerms::Absent => Ok(Self::Absent),
            RigidTerms::Constant if poles.rigid_body == Some(RigidBody::Decoupled) => Ok(Self::Decoupled),
            RigidTerms::Constant => Ok(Self::Constant),
            RigidTerms::Varying { .. } if poles.slow_poles => Ok(Self::Friction),
            RigidTerms::Varying { double: true, .. } => Ok(Self::Varying),
            RigidTerms::Varying { .. } => Err(FitError::Empty {
                what: "masses with friction to ground, which one integrator stands for; set `integrators` to 0 or 2, or take position as output",
            }
            .into()),
        }
    }

    /// In words, as part of the account.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Absent => "",
            Self::Constant => " with the rigid body exact",
            Self::Decoupled => " with the rigid body exact, decoupled as given",
            Self::Varying => " with the integrators of the rigid body exact and its gain a function of p",
            Self::Friction => {
                " with the integrators of the rigid body exact, its gain and friction functions of p"
            }
        }
    }
}

/// The model of the middle position.
pub(super) struct Local {
    pub(super) model: StateSpace<Continuous>,
    gamma: Option<DMatrix<f64>>,
    body: Body,
}

impl Local {
    /// `middle` and `estimate`: data and response of the middle position; `modes`: its sampled poles.
    pub(super) fn new(
        middle: &FrozenData,
        (estimate, clock): (&FrfEstimate, Discrete),
        modes: &[Complex<f64>],
        body: Body,
    ) -> Result<Self, PipelineError> {
        let rigid = match body {
            Body::Absent => RigidGain::Absent,
            Body::Constant => RigidGain::Decide,
            Body::Decoupled => RigidGain::Diagonal,
            Body::Varying | Body::Friction => {
                let first = modes.iter().map(|z| z.ln().norm() / clock.sample_time());
                let first = first.fold(f64::INFINITY, f64::min) / std::f64::consts::TAU;
                let (gain, mut rate) =
                    gain_and_rate(estimate, clock, first).ok_or(FitError::Empty {
                        what: "lines below a quarter of the first mode that tell the mass of the rigid body, which depends on p or has friction",
                    })?;
                let kind = if body == Body::Friction {
                    Rigid::Friction
                } else {
                    Rigid::Varying
                };
                if body == Body::Varying {
                    rate.fill(0.0);
                }
                let settings = RefineSettings::default();
                let found = local_body(middle, modes, kind, (&gain, &rate), &settings)?;
                return Ok(Self {
                    model: found.model,
                    gamma: None,
                    body,
                });
            }
        };
        let settings = LocalSettings {
            rigid,
            ..LocalSettings::default()
        };
        let found = local_model(Continuous, middle, modes, &settings)?;
        Ok(Self {
            model: found.flexible,
            gamma: found.gamma,
            body,
        })
    }

    pub(super) fn rigid(&self) -> Rigid<'_> {
        match self.body {
            Body::Absent | Body::Constant | Body::Decoupled => self.gamma.as_ref().into(),
            Body::Varying => Rigid::Varying,
            Body::Friction => Rigid::Friction,
        }
    }
}
