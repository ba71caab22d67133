//! Moving p: the state coordinates are those of the machine.
//!
//! Models with equal frozen responses differ when p moves: `x~ = T(p) x` leaves every frozen response alone and adds
//! `dp/dt (dT/dp) T^-1` to the dynamics. Records along a moving p decide. [`turn`] finds the rate `G(p) = -T^-1 dT/dp` at
//! which the coordinates of a frozen model turn, in which the error is nearly linear; [`settle`] takes the model to
//! parameter-independent coordinates and fits an LFR there; [`refine_with_moves`] refines it on frozen responses and records
//! together. [`stand_still`] does the three for one number of deltas after the other.

mod along;
mod data;
mod fixed;
mod flow;
mod joint;
mod settle;
mod standing;
mod turning;

pub use data::MovingData;
pub use joint::{JointAccount, Jointly, refine_with_moves, simulate_errors};
pub use settle::{Settled, settle};
pub use standing::{Standing, StandingSettings, stand_still};
pub use turning::{Turning, TurningAccount, TurningFit, turn};
