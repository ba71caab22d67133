//! All tests of the crate that go through its public functions.

#![allow(clippy::unwrap_used, clippy::panic)]

mod axis_by_hand;
mod two_axes_by_hand;
