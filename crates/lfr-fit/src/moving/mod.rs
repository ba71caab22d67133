//! Moving p: the state coordinates are those of the machine.
//!
//! Models with equal frozen responses differ when p moves: `x~ = T(p) x` leaves every frozen response alone and adds
//! `dp/dt (dT/dp) T^-1` to the dynamics. Records along a moving p decide. [`fit_transformation`] finds the rate
//! `G(p) = -T^-1 dT/dp` of the state transformation, in which the error is nearly linear; [`static_dependence`] takes the model to
//! parameter-independent coordinates and fits an LFR there; [`refine_with_moves`] refines it on frozen responses and records
//! together. [`fit_static`] does the three for one number of deltas after the other.

mod along;
mod data;
mod fixed;
mod flow;
mod joint;
mod static_dependence;
mod static_lfr;
mod transformation;

pub use data::MovingData;
pub use joint::{JointAccount, Jointly, refine_with_moves, simulate_errors};
pub use static_dependence::{StaticDependence, static_dependence};
pub use static_lfr::{StaticLfr, StaticLfrSettings, fit_static};
pub use transformation::{StateTransformation, TransformationAccount, TransformationFit, fit_transformation};
