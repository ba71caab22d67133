//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, clippy::panic)]

mod axes_by_themselves;
mod axis_by_hand;
mod changes;
mod common;
mod far_starts;
mod gravity;
mod held_axis;
mod in_band;
mod motor_and_load;
mod slower;
mod temperature;
mod two_axes_by_hand;
mod user_effects;
mod workshop;
