//! Any model, and what all of them can be asked.

use crate::{
    Continuous, CoreError, Discrete, InnovationModel, Lfr, LpvStateSpace, RigidBody, SchedulingRange,
    SeriesExpansion, StateSpace, counted,
};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Any model that a file can hold.
///
/// Whoever matches on it names every kind, so that a new one does not compile until each place knows it; what can be asked of all
/// kinds is a method here.
///
/// ```
/// use lpv_core::nalgebra::dmatrix;
/// use lpv_core::{Continuous, FrozenModel, Model, StateSpace};
///
/// // 1 / (s + 2)
/// let system = StateSpace::new(dmatrix![-2.0], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0], Continuous)?;
/// let model = Model::from(system.clone());
/// assert_eq!(model.describe(), "continuous state space with 1 state, 1 input, 1 output");
/// assert_eq!((model.inputs(), model.outputs(), model.range()), (1, 1, None));
/// assert_eq!(model.frozen(&[])?, FrozenModel::Continuous(system));
/// # Ok::<(), lpv_core::CoreError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", content = "model")]
pub enum Model {
    /// Discrete linear time-invariant state space.
    DiscreteStateSpace(StateSpace<Discrete>),
    /// Continuous linear time-invariant state space.
    ContinuousStateSpace(StateSpace<Continuous>),
    /// Discrete LPV state space.
    DiscreteLpv(LpvStateSpace<Discrete>),
    /// Continuous LPV state space.
    ContinuousLpv(LpvStateSpace<Continuous>),
    /// Discrete LFR.
    DiscreteLfr(Lfr<Discrete>),
    /// Continuous LFR.
    ContinuousLfr(Lfr<Continuous>),
    /// Series expansion in fixed filters.
    SeriesExpansion(SeriesExpansion),
    /// Discrete state space with the predictor of its noise.
    InnovationStateSpace(InnovationModel),
    /// Axes that move as one mass each.
    RigidBody(RigidBody),
}

/// A model at a constant scheduling value, in the time in which it was written.
#[derive(Debug, Clone, PartialEq)]
pub enum FrozenModel {
    /// In continuous time.
    Continuous(StateSpace<Continuous>),
    /// In discrete time.
    Discrete(StateSpace<Discrete>),
}

impl Model {
    /// Kind, size and channels in a few words.
    pub fn describe(&self) -> String {
        let kind = match self {
            Self::DiscreteStateSpace(s) => {
                "discrete state space with ".to_owned() + &counted(s.states(), "state")
            }
            Self::ContinuousStateSpace(s) => {
                "continuous state space with ".to_owned() + &counted(s.states(), "state")
            }
            Self::InnovationStateSpace(m) => {
                "state space in innovation form with ".to_owned() + &counted(m.model().states(), "state")
            }
            Self::RigidBody(m) => {
                return match m.axes().len() {
                    1 => "rigid body, one axis".to_owned(),
                    n => format!("rigid body, {n} axes"),
                };
            }
            Self::DiscreteLfr(m) => lfr(m.states(), m.delta_count()),
            Self::ContinuousLfr(m) => "continuous ".to_owned() + &lfr(m.states(), m.delta_count()),
            Self::DiscreteLpv(m) => "LPV state space with ".to_owned() + &counted(m.states(), "state"),
            Self::ContinuousLpv(m) => {
                "continuous LPV state space with ".to_owned() + &counted(m.states(), "state")
            }
            Self::SeriesExpansion(m) => {
                "LPV series expansion in ".to_owned() + &counted(m.functions(), "basis function")
            }
        };
        let (inputs, outputs) = (counted(self.inputs(), "input"), counted(self.outputs(), "output"));
        format!("{kind}, {inputs}, {outputs}")
    }

    /// Inputs.
    pub fn inputs(&self) -> usize {
        match self {
            Self::DiscreteStateSpace(s) => s.inputs(),
            Self::ContinuousStateSpace(s) => s.inputs(),
            Self::DiscreteLpv(s) => s.inputs(),
            Self::ContinuousLpv(s) => s.inputs(),
            Self::DiscreteLfr(s) => s.inputs(),
            Self::ContinuousLfr(s) => s.inputs(),
            Self::SeriesExpansion(s) => s.direct().shape().1,
            Self::InnovationStateSpace(s) => s.model().inputs(),
            Self::RigidBody(s) => s.axes().len(),
        }
    }

    /// Outputs.
    pub fn outputs(&self) -> usize {
        match self {
            Self::DiscreteStateSpace(s) => s.outputs(),
            Self::ContinuousStateSpace(s) => s.outputs(),
            Self::DiscreteLpv(s) => s.outputs(),
            Self::ContinuousLpv(s) => s.outputs(),
            Self::DiscreteLfr(s) => s.outputs(),
            Self::ContinuousLfr(s) => s.outputs(),
            Self::SeriesExpansion(s) => s.direct().shape().0,
            Self::InnovationStateSpace(s) => s.model().outputs(),
            Self::RigidBody(s) => s.axes().len(),
        }
    }

    /// Scheduling values for which it holds; none for a time-invariant model.
    pub fn range(&self) -> Option<&SchedulingRange> {
        match self {
            Self::DiscreteLpv(s) => Some(s.range()),
            Self::ContinuousLpv(s) => Some(s.range()),
            Self::DiscreteLfr(s) => Some(s.range()),
            Self::ContinuousLfr(s) => Some(s.range()),
            Self::SeriesExpansion(s) => Some(s.range()),
            Self::DiscreteStateSpace(_)
            | Self::ContinuousStateSpace(_)
            | Self::InnovationStateSpace(_)
            | Self::RigidBody(_) => None,
        }
    }

    /// The clock of a discrete model; none in continuous time.
    pub fn clock(&self) -> Option<Discrete> {
        match self {
            Self::DiscreteStateSpace(s) => Some(s.clock()),
            Self::DiscreteLpv(s) => Some(s.clock()),
            Self::DiscreteLfr(s) => Some(s.clock()),
            Self::SeriesExpansion(s) => Some(s.basis().clock()),
            Self::InnovationStateSpace(s) => Some(s.model().clock()),
            Self::ContinuousStateSpace(_)
            | Self::ContinuousLpv(_)
            | Self::ContinuousLfr(_)
            | Self::RigidBody(_) => None,
        }
    }

    /// Inputs and outputs of the working point about which it is linear; none where that is zero.
    pub fn offsets(&self) -> Option<(DVector<f64>, DVector<f64>)> {
        match self {
            Self::InnovationStateSpace(s) => Some((s.input_offset().clone(), s.output_offset().clone())),
            Self::RigidBody(s) => {
                let n = s.axes().len();
                let forces = DVector::from_iterator(n, s.axes().iter().map(|a| a.offset));
                Some((forces, DVector::zeros(n)))
            }
            Self::DiscreteStateSpace(_)
            | Self::ContinuousStateSpace(_)
            | Self::DiscreteLpv(_)
            | Self::ContinuousLpv(_)
            | Self::DiscreteLfr(_)
            | Self::ContinuousLfr(_)
            | Self::SeriesExpansion(_) => None,
        }
    }

    /// The model at a constant scheduling value, which a time-invariant one does not look at.
    ///
    /// # Errors
    /// A value outside the range or of another number of parameters; an LFR that is singular there.
    pub fn frozen(&self, p: &[f64]) -> Result<FrozenModel, CoreError> {
        Ok(match self {
            Self::DiscreteStateSpace(s) => FrozenModel::Discrete(s.clone()),
            Self::ContinuousStateSpace(s) => FrozenModel::Continuous(s.clone()),
            Self::DiscreteLpv(s) => FrozenModel::Discrete(s.frozen(p)?),
            Self::ContinuousLpv(s) => FrozenModel::Continuous(s.frozen(p)?),
            Self::DiscreteLfr(s) => FrozenModel::Discrete(s.frozen(p)?),
            Self::ContinuousLfr(s) => FrozenModel::Continuous(s.frozen(p)?),
            Self::SeriesExpansion(s) => FrozenModel::Discrete(s.to_state_space()?.frozen(p)?),
            Self::InnovationStateSpace(s) => FrozenModel::Discrete(s.model().clone()),
            Self::RigidBody(s) => FrozenModel::Continuous(s.to_state_space()?),
        })
    }

    /// The same model in the form in which it freezes fastest: a series expansion as a state space.
    ///
    /// # Errors
    /// As [`SeriesExpansion::to_state_space`].
    pub fn in_states(&self) -> Result<Cow<'_, Self>, CoreError> {
        Ok(match self {
            Self::SeriesExpansion(s) => Cow::Owned(Self::DiscreteLpv(s.to_state_space()?)),
            other => Cow::Borrowed(other),
        })
    }
}

fn lfr(states: usize, deltas: usize) -> String {
    format!(
        "LFR with {} and {}",
        counted(states, "state"),
        counted(deltas, "delta")
    )
}

impl FrozenModel {
    /// In discrete time, the input held over a sample; a discrete model as it is.
    ///
    /// # Errors
    /// A continuous model that cannot be sampled.
    pub fn held(self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        match self {
            Self::Continuous(s) => s.zero_order_hold(clock),
            Self::Discrete(s) => Ok(s),
        }
    }

    /// In continuous time: the system whose input, held over a sample, gives a discrete one.
    ///
    /// # Errors
    /// A discrete model that no continuous one gives.
    pub fn continuous(self) -> Result<StateSpace<Continuous>, CoreError> {
        match self {
            Self::Continuous(s) => Ok(s),
            Self::Discrete(s) => s.undo_zero_order_hold(),
        }
    }
}

macro_rules! from {
    ($($kind:ty => $variant:ident),* $(,)?) => {
        $(impl From<$kind> for Model {
            fn from(model: $kind) -> Self {
                Self::$variant(model)
            }
        })*
    };
}

from! {
    StateSpace<Discrete> => DiscreteStateSpace,
    StateSpace<Continuous> => ContinuousStateSpace,
    LpvStateSpace<Discrete> => DiscreteLpv,
    LpvStateSpace<Continuous> => ContinuousLpv,
    Lfr<Discrete> => DiscreteLfr,
    Lfr<Continuous> => ContinuousLfr,
    SeriesExpansion => SeriesExpansion,
    InnovationModel => InnovationStateSpace,
    RigidBody => RigidBody,
}
